"""The spatial methods: how the discs are moved."""

from __future__ import annotations

from .base import SpatialMethod
from .direct import AllPairs, Cells
from .time_stepping import TimeStepping
from .windowed import Windowed

#: every method
METHODS: tuple[type[SpatialMethod], ...] = (Windowed, Cells, AllPairs, TimeStepping)
