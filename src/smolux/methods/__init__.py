"""Ways to draw the next event: one file per method."""

from .acceptance_rejection import AcceptanceRejection
from .base import Method
from .inverse import Inverse
from .low_rank import FictitiousJumps, LowRank
from .size_class import SizeClass

#: every method
METHODS: tuple[type[Method], ...] = (
    SizeClass,
    AcceptanceRejection,
    Inverse,
    LowRank,
    FictitiousJumps,
)

__all__ = [
    "METHODS",
    "AcceptanceRejection",
    "FictitiousJumps",
    "Inverse",
    "LowRank",
    "Method",
    "SizeClass",
]
