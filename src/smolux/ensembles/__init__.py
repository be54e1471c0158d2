"""Very many replicas of small systems: statistics without rows, and what a sample costs."""

from .efficiency import efficiency
from .ensemble import ensemble
from .moments import Moments
from .table import efficiency_table

__all__ = ["Moments", "efficiency", "efficiency_table", "ensemble"]
