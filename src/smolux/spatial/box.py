"""The box: its sides, and what its walls do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smolux.errors import InputError, did_you_mean

Float = NDArray[np.float64]

#: what happens at the two walls of an axis
WALLS = ("reflecting", "periodic")


@dataclass(frozen=True)
class Box:
    """A rectangle or a cuboid with one corner at the origin.

    Parameters
    ----------
    lengths : sequence of 2 or 3 floats
        The sides.
    walls : str or sequence of str
        "reflecting" or "periodic", for all axes or one for each.

    Raises
    ------
    InputError
        If a side is no positive number, or a kind of wall is not known.

    Examples
    --------
    >>> Box((10, 20), walls=("periodic", "reflecting")).volume
    200.0
    """

    lengths: tuple[float, ...]
    walls: tuple[str, ...] = ("reflecting",)

    def __init__(self, lengths: Sequence[float], walls: str | Sequence[str] = "reflecting") -> None:
        problems: list[str] = []
        sides = _sides(lengths, problems)
        kinds = _kinds(walls, len(sides), problems)
        if problems:
            raise InputError(problems)
        object.__setattr__(self, "lengths", sides)
        object.__setattr__(self, "walls", kinds)

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return len(self.lengths)

    @property
    def volume(self) -> float:
        """Area of a rectangle, volume of a cuboid."""
        return float(np.prod(self.lengths))

    @property
    def periodic(self) -> NDArray[np.bool_]:
        """Which axes are periodic, shape (d,)."""
        return np.array([kind == "periodic" for kind in self.walls])

    @property
    def periods(self) -> Float:
        """Side of each periodic axis, zero for the others, shape (d,)."""
        return np.where(self.periodic, self.lengths, 0.0)

    def wrap(self, position: Any) -> Float:
        """Bring positions into the box along its periodic axes.

        Parameters
        ----------
        position : array_like of shape (..., d)

        Returns
        -------
        ndarray of shape (..., d)
        """
        x = np.array(position, float)
        for axis in np.flatnonzero(self.periodic):
            side = self.lengths[axis]
            folded = np.mod(x[..., axis], side)
            x[..., axis] = np.where(folded == side, 0.0, folded)  # of -1e-20
        return x

    def nearest(self, separation: Any) -> Float:
        """Shorten separations to those of the nearest images along the periodic axes.

        Parameters
        ----------
        separation : array_like of shape (..., d)

        Returns
        -------
        ndarray of shape (..., d)
        """
        d = np.array(separation, float)
        for axis in np.flatnonzero(self.periodic):
            side = self.lengths[axis]
            d[..., axis] -= side * np.rint(d[..., axis] / side)
        return d


def _sides(lengths: Any, problems: list[str]) -> tuple[float, ...]:
    try:
        sides = tuple(float(x) for x in np.asarray(lengths, float).reshape(-1))
    except (TypeError, ValueError):
        sides = ()
    if len(sides) not in (2, 3):
        problems.append(
            f"box = {lengths!r}: must be the sides of a rectangle or a cuboid, as (10, 10)"
        )
    problems += [
        f"box: side {axis} = {side!r}: must be a positive finite number"
        for axis, side in enumerate(sides)
        if not (np.isfinite(side) and side > 0)
    ]
    return sides


def _kinds(walls: Any, dimension: int, problems: list[str]) -> tuple[str, ...]:
    kinds = (walls,) * dimension if isinstance(walls, str) else tuple(walls)
    problems += [
        f"walls = {kind!r}: unknown{did_you_mean(str(kind), WALLS)}"
        for kind in dict.fromkeys(kinds)
        if kind not in WALLS
    ]
    if dimension in (2, 3) and len(kinds) != dimension:
        problems.append(
            f"walls = {walls!r}: names {len(kinds)} axes, the box has {dimension}; "
            "give one kind for all or one for each axis"
        )
    return kinds
