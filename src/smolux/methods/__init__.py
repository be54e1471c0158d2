"""Ways to draw the next event: one file per method."""

from .acceptance_rejection.method import AcceptanceRejection
from .base import Method
from .inverse.method import Inverse
from .low_rank.method import FictitiousJumps, LowRank
from .size_class.method import SizeClass

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
