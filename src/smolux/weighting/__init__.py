"""What one simulated particle stands for: one file per weighting."""

from .base import Weighting
from .number import Number

#: every weighting
WEIGHTINGS: tuple[type[Weighting], ...] = (Number,)

__all__ = ["WEIGHTINGS", "Number", "Weighting"]
