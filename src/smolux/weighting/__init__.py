"""What one simulated particle stands for: one file per weighting."""

from .base import Weighting
from .mass_flow import MassFlow
from .number import Number
from .weight_function import WeightFunction

#: every weighting
WEIGHTINGS: tuple[type[Weighting], ...] = (Number, MassFlow, WeightFunction)
#: their names
NAMES = tuple(weighting.name for weighting in WEIGHTINGS)

__all__ = ["NAMES", "WEIGHTINGS", "MassFlow", "Number", "WeightFunction", "Weighting"]
