"""smolux: exact Monte Carlo and deterministic solvers for aggregation and fragmentation.

One description of the physics (`Model`), many ways to compute it (`simulate`, `solve`), one shape
of result (an `xarray.Dataset`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .runtime.lazy import lazily

__version__ = "0.1.0"

_MODULES = (
    "analysis",
    "attributes",
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

__getattr__, __dir__ = lazily(
    __name__,
    {
        "InputError": "errors",
        "Interrupted": "errors",
        "Model": "model",
        "Progress": "runtime.progress",
        "SmoluxWarning": "errors",
        "WorkerError": "errors",
        "efficiency": "ensembles",
        "ensemble": "ensembles",
        "law": "functions.stated",
        "plot": "plotting.",
        "resume": "stochastic.simulation",
        "simulate": "stochastic.simulation",
        "solve": "deterministic",
        "summary": "analysis",
        "sweep": "sweeps",
        **{name: f"{name}." for name in _MODULES},
    },
)

__all__ = [
    "InputError",
    "Interrupted",
    "Model",
    "Progress",
    "SmoluxWarning",
    "WorkerError",
    "__version__",
    "analysis",
    "attributes",
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
        attributes,
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
