"""Ways to draw the next event: one file per method."""

from .acceptance_rejection import AcceptanceRejection
from .base import Method
from .inverse import Inverse

#: every method
METHODS: tuple[type[Method], ...] = (AcceptanceRejection, Inverse)

__all__ = ["METHODS", "AcceptanceRejection", "Inverse", "Method"]
