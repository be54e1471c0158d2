"""What an encounter of two particles leads to: one file per mechanism."""

from .aggregation import Aggregation
from .base import PairProcess
from .shattering import Shattering

#: every process; the name in a case file is its ``name``
PROCESSES: tuple[type[PairProcess], ...] = (Aggregation, Shattering)

__all__ = ["PROCESSES", "Aggregation", "PairProcess", "Shattering"]
