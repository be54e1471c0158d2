"""The same model by rate equations: `solve`, steady states and their stability."""

from .integrate import SolverError
from .solve import Progress, solve

__all__ = ["Progress", "SolverError", "solve"]
