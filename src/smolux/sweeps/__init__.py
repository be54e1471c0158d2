"""Sweeps: a case at every point of a grid of its parameters, kept point by point."""

from __future__ import annotations

from .axes import Axis, read_axes
from .grid import SweepProgress, go_on, sweep
from .points import Folder, Point, Sweep

__all__ = ["Axis", "Folder", "Point", "Sweep", "SweepProgress", "go_on", "read_axes", "sweep"]
