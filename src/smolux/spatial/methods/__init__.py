"""The spatial methods: how the discs are moved."""

from __future__ import annotations

from typing import TYPE_CHECKING

from smolux.runtime.lazy import lazily

if TYPE_CHECKING:
    from .base import SpatialMethod
    from .direct import AllPairs, Cells
    from .time_stepping import TimeStepping
    from .windowed import Windowed

    METHODS: tuple[type[SpatialMethod], ...]

#: every method by its name, with its module and class, which is loaded when it is used
NAMES = {
    "windowed": ("windowed", "Windowed"),
    "cells": ("direct", "Cells"),
    "all-pairs": ("direct", "AllPairs"),
    "time-stepping": ("time_stepping", "TimeStepping"),
}

__getattr__, __dir__ = lazily(
    __name__,
    {name: module for module, name in NAMES.values()}
    | {"SpatialMethod": "base", "METHODS": tuple(name for _, name in NAMES.values())},
)

__all__ = [
    "METHODS",
    "NAMES",
    "AllPairs",
    "Cells",
    "SpatialMethod",
    "TimeStepping",
    "Windowed",
]
