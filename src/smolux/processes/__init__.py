"""What happens to particles, in pairs, alone, or from outside: one file per mechanism."""

from .aggregation import Aggregation
from .base import PairProcess, Process, UnaryProcess
from .disruption import CollisionalFragmentation
from .evaporation import Evaporation
from .fragmentation import Fragmentation
from .removal import Removal
from .shattering import Shattering
from .source import Source

#: every process; the name in a case file is its ``name``
PROCESSES: tuple[type[Process], ...] = (
    Aggregation,
    Shattering,
    CollisionalFragmentation,
    Evaporation,
    Fragmentation,
    Removal,
    Source,
)

__all__ = [
    "PROCESSES",
    "Aggregation",
    "CollisionalFragmentation",
    "Evaporation",
    "Fragmentation",
    "PairProcess",
    "Process",
    "Removal",
    "Shattering",
    "Source",
    "UnaryProcess",
]
