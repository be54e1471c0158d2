"""smolux: exact Monte Carlo and deterministic solvers for aggregation and fragmentation.

One description of the physics (`Model`), many ways to compute it (`simulate`, `solve`), one shape
of result (an `xarray.Dataset`).
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

#: public name -> module that defines it; a module stands for itself
_LAZY = {
    "Model": "smolux.model",
    "simulate": "smolux.stochastic.simulation",
    "resume": "smolux.stochastic.simulation",
    "solve": "smolux.deterministic",
    "sweep": "smolux.sweeps",
    "ensemble": "smolux.ensembles",
    "efficiency": "smolux.ensembles",
    "summary": "smolux.analysis",
    "law": "smolux.functions.stated",
    "InputError": "smolux.errors",
    "WorkerError": "smolux.errors",
    "Interrupted": "smolux.errors",
    "SmoluxWarning": "smolux.errors",
    "Progress": "smolux.runtime.progress",
    **dict.fromkeys(
        (
            "analysis",
            "case",
            "conformance",
            "deterministic",
            "ensembles",
            "exact",
            "initial",
            "kernels",
            "methods",
            "plotting",
            "processes",
            "results",
            "spatial",
            "weighting",
        )
    ),
    "plot": "smolux.plotting",
}
_MODULES = {"plot"}

__all__ = [
    "InputError",
    "Interrupted",
    "Model",
    "Progress",
    "SmoluxWarning",
    "WorkerError",
    "__version__",
    "analysis",
    "case",
    "conformance",
    "deterministic",
    "efficiency",
    "ensemble",
    "ensembles",
    "exact",
    "initial",
    "kernels",
    "law",
    "methods",
    "plot",
    "plotting",
    "processes",
    "results",
    "resume",
    "simulate",
    "solve",
    "spatial",
    "summary",
    "sweep",
    "weighting",
]

if TYPE_CHECKING:
    from . import (
        analysis,
        case,
        conformance,
        deterministic,
        ensembles,
        exact,
        initial,
        kernels,
        methods,
        plotting,
        processes,
        results,
        spatial,
        weighting,
    )
    from . import plotting as plot
    from .analysis.summary import summary
    from .deterministic.solver import solve
    from .ensembles.efficiency import efficiency
    from .ensembles.ensemble import ensemble
    from .errors import InputError, Interrupted, SmoluxWarning, WorkerError
    from .functions.stated import law
    from .model import Model
    from .runtime.progress import Progress
    from .stochastic.simulation import resume, simulate
    from .sweeps import sweep


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module 'smolux' has no attribute {name!r}")
    module = importlib.import_module(_LAZY[name] or f"smolux.{name}")
    value = module if _LAZY[name] is None or name in _MODULES else getattr(module, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
