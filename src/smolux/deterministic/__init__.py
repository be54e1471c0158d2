"""The same model by rate equations: `solve`, steady states and their stability."""

from smolux.errors import SolverError
from smolux.runtime.progress import Progress

from .hopf import HopfThreshold, hopf_threshold
from .solver import solve
from .steady import SteadyState, eigenvalues, steady_state

#: former name of `Progress`
SteadyProgress = Progress

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
