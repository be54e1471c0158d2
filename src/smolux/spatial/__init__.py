"""Discs and spheres in a box that fly freely and stick where they touch."""

from __future__ import annotations

from typing import TYPE_CHECKING

from smolux.runtime.lazy import lazily

__getattr__, __dir__ = lazily(
    __name__,
    {
        "METHODS": "methods",
        "AllPairs": "methods.direct",
        "Box": "box",
        "Cells": "methods.direct",
        "Contacts": "analysis.morphology",
        "Dimension": "analysis.dimensions",
        "Snapshot": "analysis.morphology",
        "SpatialProgress": "simulation",
        "System": "system",
        "TimeStepping": "methods.time_stepping",
        "Windowed": "methods.windowed",
        "bimodal_radii": "initial",
        "box_dimension": "analysis.dimensions",
        "contacts": "analysis.morphology",
        "lattice": "initial",
        "log_of": "results.result",
        "lognormal_radii": "initial",
        "mass_dimension": "analysis.dimensions",
        "mean_field_model": "analysis.kernel",
        "measured_kernel": "analysis.kernel",
        "pair_distribution": "analysis.correlations",
        "random": "initial",
        "replay": "results.result",
        "resume": "resuming",
        "shapes": "analysis.morphology",
        "simulate": "simulation",
        "snapshot": "analysis.morphology",
        "structure_factor": "analysis.correlations",
        "system_of": "results.result",
        "write_trajectory": "results.trajectory",
    },
)

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
    from .analysis.correlations import pair_distribution, structure_factor
    from .analysis.dimensions import Dimension, box_dimension, mass_dimension
    from .analysis.kernel import mean_field_model, measured_kernel
    from .analysis.morphology import Contacts, Snapshot, contacts, shapes, snapshot
    from .box import Box
    from .initial import bimodal_radii, lattice, lognormal_radii, random
    from .methods import METHODS
    from .methods.direct import AllPairs, Cells
    from .methods.time_stepping import TimeStepping
    from .methods.windowed import Windowed
    from .results.result import log_of, replay, system_of
    from .results.trajectory import write_trajectory
    from .resuming import resume
    from .simulation import SpatialProgress, simulate
    from .system import System
