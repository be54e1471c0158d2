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
    "SpatialProgress": "running",
    "System": "system",
    "Windowed": "windowed",
    "bimodal_radii": "initial",
    "lattice": "initial",
    "log_of": "result",
    "lognormal_radii": "initial",
    "mean_field_model": "kernel",
    "measured_kernel": "kernel",
    "random": "initial",
    "replay": "result",
    "simulate": "running",
    "system_of": "result",
    "write_trajectory": "trajectory",
}

__all__ = [
    "METHODS",
    "AllPairs",
    "Box",
    "Cells",
    "SpatialProgress",
    "System",
    "Windowed",
    "bimodal_radii",
    "lattice",
    "log_of",
    "lognormal_radii",
    "mean_field_model",
    "measured_kernel",
    "random",
    "replay",
    "simulate",
    "system_of",
    "write_trajectory",
]

if TYPE_CHECKING:
    from .box import Box
    from .direct import AllPairs, Cells
    from .initial import bimodal_radii, lattice, lognormal_radii, random
    from .kernel import mean_field_model, measured_kernel
    from .methods import METHODS
    from .result import log_of, replay, system_of
    from .running import SpatialProgress, simulate
    from .system import System
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
