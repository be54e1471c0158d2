"""The spatial methods: how the discs are moved."""

from __future__ import annotations

from .direct import AllPairs, Cells
from .method import SpatialMethod

#: every method
METHODS: tuple[type[SpatialMethod], ...] = (Cells, AllPairs)
