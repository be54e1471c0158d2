"""What a run is told, each argument declared once: its kind, its limits, its default.

The functions, the tables of a case file, checkpoints and comparisons with them read these
declarations. A new argument is a field here and in the signature of its function.
"""

from .control import Control
from .kinds import from_plain, plain
from .motion import SpatialSettings
from .simulation import PILOT, Settings
from .solution import SolverSettings

__all__ = [
    "PILOT",
    "Control",
    "Settings",
    "SolverSettings",
    "SpatialSettings",
    "from_plain",
    "plain",
]
