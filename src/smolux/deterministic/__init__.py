"""The same model by rate equations: `solve`, steady states and their stability."""

from .hopf import HopfThreshold, hopf_threshold
from .integrate import SolverError
from .solver import Progress, solve
from .steady import SteadyProgress, SteadyState, eigenvalues, steady_state

__all__ = [
    "HopfThreshold",
    "Progress",
    "SolverError",
    "SteadyProgress",
    "SteadyState",
    "eigenvalues",
    "hopf_threshold",
    "solve",
    "steady_state",
]
