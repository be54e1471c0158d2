"""Discs and spheres in a box that fly freely and stick where they touch."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

#: public name -> module that defines it
_LAZY = {
    "METHODS": "methods",
    "AllPairs": "direct",
    "Box": "box",
    "Cells": "direct",
    "Contacts": "morphology",
    "Dimension": "dimensions",
    "Snapshot": "morphology",
    "SpatialProgress": "running",
    "System": "system",
    "TimeStepping": "time_stepping",
    "Windowed": "windowed",
    "bimodal_radii": "initial",
    "box_dimension": "dimensions",
    "contacts": "morphology",
    "lattice": "initial",
    "log_of": "result",
    "lognormal_radii": "initial",
    "mass_dimension": "dimensions",
    "mean_field_model": "kernel",
    "measured_kernel": "kernel",
    "pair_distribution": "correlations",
    "random": "initial",
    "replay": "result",
    "resume": "resuming",
    "shapes": "morphology",
    "simulate": "running",
    "snapshot": "morphology",
    "structure_factor": "correlations",
    "system_of": "result",
    "write_trajectory": "trajectory",
}

__all__ = [
    "METHODS",
    "AllPairs",
    "Box",
    "Cells",
    "Contacts",
    "Dimension",
    "Snapshot",
    "SpatialProgress",
    "System",
    "TimeStepping",
    "Windowed",
    "bimodal_radii",
    "box_dimension",
    "contacts",
    "lattice",
    "log_of",
    "lognormal_radii",
    "mass_dimension",
    "mean_field_model",
    "measured_kernel",
    "pair_distribution",
    "random",
    "replay",
    "resume",
    "shapes",
    "simulate",
    "snapshot",
    "structure_factor",
    "system_of",
    "write_trajectory",
]

if TYPE_CHECKING:
    from .box import Box
    from .correlations import pair_distribution, structure_factor
    from .dimensions import Dimension, box_dimension, mass_dimension
    from .direct import AllPairs, Cells
    from .initial import bimodal_radii, lattice, lognormal_radii, random
    from .kernel import mean_field_model, measured_kernel
    from .methods import METHODS
    from .morphology import Contacts, Snapshot, contacts, shapes, snapshot
    from .result import log_of, replay, system_of
    from .resuming import resume
    from .running import SpatialProgress, simulate
    from .system import System
    from .time_stepping import TimeStepping
    from .trajectory import write_trajectory
    from .windowed import Windowed


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module 'smolux.spatial' has no attribute {name!r}")
    module = importlib.import_module(f"smolux.spatial.{_LAZY[name]}")
    value = getattr(module, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
