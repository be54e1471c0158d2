"""Discs or spheres in a box: positions, velocities, radii, masses, checked once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.errors import InputError

from .analysis.overlaps import overlapping
from .box import Box

Float = NDArray[np.float64]

#: overlaps of up to this many radii come from rounding of coordinates
_ROUNDING = 1e-9
_SHOWN = 5


@dataclass(frozen=True, eq=False)
class System:
    """Discs (d = 2) or spheres (d = 3) in free flight in a box.

    They stick where they touch, and clusters move on with the mean velocity, weighted by mass; they
    do not rotate. A reflecting wall turns a whole cluster back when one of its discs touches it.

    Parameters
    ----------
    position : array_like of shape (N, d)
        Centres. Along a periodic axis they may lie outside the box.
    velocity : array_like of shape (N, d)
    radius : float or array_like of shape (N,)
    mass : float or array_like of shape (N,), optional
        By size if left out: one density for all, and a mean mass of 1.
    box : Box, float or sequence of float
        The box, its side if it is a square or a cube, or its sides.
    walls : {"reflecting", "periodic"} or sequence of these, optional
        For all axes or for each; "reflecting" if left out. A `Box` brings its own.
    wall_contact : {"surface", "centre"}
        What of a disc touches a reflecting wall.
    origin : mapping, optional
        How the system was made (its seed, ...); kept with results.

    Raises
    ------
    InputError
        With every mistake, and the numbers of the discs that make it: shapes, values that are
        not finite, radii and masses that are not positive, discs out of the box, discs that
        overlap, a periodic axis of at most two diameters.

    Examples
    --------
    >>> import smolux as sx
    >>> two = sx.spatial.System(position=[[1, 1], [3, 1]], velocity=[[1, 0], [0, 0]], radius=0.5, box=4)
    >>> two.volume_fraction
    0.09817477042468103
    """  # noqa: E501

    position: Float
    velocity: Float
    radius: Float
    mass: Float
    box: Box
    wall_contact: str = "surface"
    origin: Mapping[str, Any] = field(default_factory=dict)

    def __init__(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        radius: ArrayLike,
        mass: ArrayLike | None = None,
        *,
        box: Box | float | Sequence[float],
        walls: str | Sequence[str] | None = None,
        wall_contact: str = "surface",
        origin: Mapping[str, Any] | None = None,
    ) -> None:
        problems: list[str] = []
        x = _points("position", position, problems)
        v = _points("velocity", velocity, problems)
        if not problems and x.shape != v.shape:
            problems.append(
                f"velocity: has the shape {v.shape}, position {x.shape}; give one row for each disc"
            )
        n, d = x.shape if x.ndim == 2 else (0, 0)
        r = _positive("radius", radius, n, problems)
        m = _masses(mass, r, n, d, problems)
        frame = _box(box, walls, d, problems)
        if wall_contact not in ("surface", "centre"):
            problems.append(f"wall_contact = {wall_contact!r}: must be 'surface' or 'centre'")
        if not problems and frame is not None:
            problems += _misplaced(x, r, frame, wall_contact)
        if problems or frame is None:
            raise InputError(list(dict.fromkeys(problems)))
        for array in (x, v, r, m):
            array.setflags(write=False)
        values = (x, v, r, m, frame, wall_contact, dict(origin or {}))
        for entry, value in zip(fields(self), values, strict=True):
            object.__setattr__(self, entry.name, value)

    def __len__(self) -> int:
        return len(self.position)

    def __repr__(self) -> str:
        return (
            f"System({len(self)} {'discs' if self.dimension == 2 else 'spheres'}, box="
            f"{self.box.lengths}, walls={self.box.walls}, phi={self.volume_fraction:.4g})"
        )

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return self.box.dimension

    @property
    def volume_fraction(self) -> float:
        """Share of the box that the discs cover."""
        unit = np.pi if self.dimension == 2 else 4.0 / 3.0 * np.pi
        return float(unit * np.sum(self.radius**self.dimension) / self.box.volume)

    @property
    def monodisperse(self) -> bool:
        """Whether all radii are equal."""
        return bool((self.radius == self.radius[0]).all())

    @property
    def kinetic_energy(self) -> float:
        """``sum m |v|^2 / 2``."""
        return float(0.5 * np.sum(self.mass[:, None] * self.velocity**2))


def _points(name: str, value: Any, problems: list[str]) -> Float:
    """Return an array of shape (N, d) of finite numbers, or note what is wrong with it."""
    try:
        x = np.array(value, np.float64, order="C")
    except (TypeError, ValueError):
        problems.append(f"{name}: must be an array of numbers of shape (N, 2) or (N, 3)")
        return np.empty(0)
    if x.ndim != 2 or x.shape[1] not in (2, 3) or not len(x):
        problems.append(
            f"{name}: has the shape {x.shape}; must be (N, 2) or (N, 3), one row a disc"
        )
        return np.empty(0)
    bad = np.flatnonzero(~np.isfinite(x).all(1))
    if bad.size:
        problems.append(f"{name}: not finite for {_discs(bad)}; first: {x[bad[0]].tolist()}")
    return x


def _positive(name: str, value: Any, n: int, problems: list[str]) -> Float:
    """Return one positive number for each disc, or note what is wrong."""
    try:
        given = np.asarray(value, np.float64)
        x = np.array(np.broadcast_to(given, (n,) if n else given.shape), order="C")
    except (TypeError, ValueError):
        shape = np.shape(value) if not isinstance(value, str) else repr(value)
        problems.append(f"{name}: must be a number or one for each of the {n} discs, not {shape}")
        return np.ones(n)
    bad = np.flatnonzero(~(np.isfinite(x) & (x > 0)))
    if bad.size:
        problems.append(
            f"{name} = {float(x.flat[bad[0]])!r} for {_discs(bad)}: must be a positive number"
        )
    return x


def _masses(mass: Any, radius: Float, n: int, d: int, problems: list[str]) -> Float:
    if mass is not None:
        return _positive("mass", mass, n, problems)
    if problems or not n:
        return np.ones(n)
    size = (radius / radius.max()) ** d
    return size / size.mean()


def _box(box: Any, walls: Any, d: int, problems: list[str]) -> Box | None:
    if isinstance(box, Box):
        if walls is not None:
            problems.append(f"walls = {walls!r}: the Box has its own; leave them out here")
    else:
        try:
            sides = (box,) * d if d and np.ndim(box) == 0 else box
            box = Box(sides, "reflecting" if walls is None else walls)
        except InputError as error:
            problems += error.problems
            return None
    if d and box.dimension != d:
        problems.append(f"box = {box.lengths}: has {box.dimension} axes, the positions {d}")
    return box


def _discs(numbers: Any) -> str:
    """Name some discs: ``"disc 7"``, ``"3 discs (1, 5, 6)"``."""
    shown = ", ".join(str(int(k)) for k in numbers[:_SHOWN])
    more = ", ..." if len(numbers) > _SHOWN else ""
    return f"disc {shown}" if len(numbers) == 1 else f"{len(numbers)} discs ({shown}{more})"


def _misplaced(x: Float, r: Float, box: Box, contact: str) -> list[str]:
    """Discs out of the box, axes too short, discs that overlap."""
    problems = []
    room = r if contact == "surface" else np.zeros_like(r)
    slack = _ROUNDING * r
    for axis, side in enumerate(box.lengths):
        if box.walls[axis] == "periodic":
            if side <= 4 * r.max():
                problems.append(
                    f"box: the periodic axis {axis} of length {side:g} must be longer than two "
                    f"diameters, {4 * r.max():g}: a disc would touch its own image's neighbours"
                )
            continue
        out = (x[:, axis] < room - slack) | (x[:, axis] > side - room + slack)
        bad = np.flatnonzero(out)
        if bad.size:
            k = bad[0]
            problems.append(
                f"position: {_discs(bad)} beyond a wall of axis {axis}; first: centre "
                f"{x[k, axis]:g}, radius {r[k]:g}, box from 0 to {side:g}"
            )
    if problems:
        return problems
    pairs = overlapping(box.wrap(x), r * (1 - _ROUNDING), box, _SHOWN + 1)
    if len(pairs):
        text = ", ".join(f"{i} and {j}" for i, j in pairs[:_SHOWN])
        more = ", ..." if len(pairs) > _SHOWN else ""
        i, j = pairs[0]
        gap = np.linalg.norm(box.nearest(x[j] - x[i])) - r[i] - r[j]
        problems.append(
            f"position: discs overlap: {text}{more}; the first two by {-gap:g}. "
            "Use smaller radii, or smolux.spatial.random for positions without overlap"
        )
    return problems
