"""Bounds of a function over boxes by branch and bound with intervals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .intervals import Interval
from .sides import Ranges

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Function = Callable[[Interval, Interval], Any]

#: the most cells looked at in one call, besides 32 for each box
_MOST = 16384
#: pieces in which what depends on one variable is followed, over all sides of cells together
_FINE = 16384
#: halvings of a cell in a row, if cells are few, and if they are not
_DEEP, _FEW, _SHALLOW = 4, 256, 2
#: the weight of what is missing below
_LOWER = 0.25
#: what is known not to be smaller than the upper bound by this factor needs no close lower bound
_NEAR = 0.05


def subdivided(
    fn: Function,
    a: ArrayLike,
    b: ArrayLike,
    c: ArrayLike,
    d: ArrayLike,
    pieces: int = 4,
    *,
    tolerance: float = 0.02,
    work: int = 4096,
    geometric: bool = True,
    least: float = -np.inf,
) -> tuple[Float, Float]:
    """Bounds of ``fn(x, y)`` over boxes ``a <= x <= b``, ``c <= y <= d``.

    Each box is cut into ``pieces**2`` cells; the cells that may hold a value beyond those attained
    are halved again, until the bound is within `tolerance` of an attained value.

    Parameters
    ----------
    fn : callable
        Takes two `Interval` objects.
    a, b, c, d : array_like
        Edges of the boxes, broadcast against each other.
    pieces : int
        Cells along each side to begin with.
    tolerance : float
        Relative distance of a bound from an attained value at which cells are left alone.
    work : int
        The most cells that are looked at for each box, besides the first ones; a call for many
        boxes looks at fewer.
    geometric : bool
        Whether sides are cut in equal ratios (their edges must be positive) or equal lengths.
    least : float
        What the function is known not to fall below.

    Returns
    -------
    lower, upper : ndarray
        Infinite where no bound was found.
    """
    sides = np.broadcast_arrays(*(np.asarray(x, float) for x in (a, b, c, d)))
    shape = sides[0].shape
    boxes = np.stack([side.ravel() for side in sides])
    if boxes.shape[1] == 0:
        return np.empty(shape), np.empty(shape)
    # The whole call is limited too: many boxes are looked at for pairs of classes of sizes.
    budget = min(work * boxes.shape[1], _MOST + 32 * boxes.shape[1])
    x = Ranges(0, boxes[0], boxes[1], pieces, geometric)
    y = Ranges(1, boxes[2], boxes[3], pieces, geometric)
    # of one variable alone, cells are its pieces
    flat = (boxes[0] == boxes[1]).all() or (boxes[2] == boxes[3]).all()
    over = _Over(fn, least, x, y, 0 if flat else _FINE)
    lower, upper = _bounded(over, boxes.shape[1], tolerance, budget)
    return lower.reshape(shape), upper.reshape(shape)


class _Over(NamedTuple):
    """The function over cells, which are pairs of ranges by their numbers."""

    fn: Function
    least: float
    x: Ranges
    y: Ranges
    fine: int

    def __call__(self, cells: Int) -> tuple[Float, Float]:
        found = self.fn(self.x.side(cells[0], self.fine), self.y.side(cells[1], self.fine))
        if not isinstance(found, Interval):
            found = Interval(float(found))
        shape = cells.shape[1:]
        lo = np.broadcast_to(np.maximum(found.lo, self.least), shape)
        return lo, np.broadcast_to(np.maximum(found.hi, self.least), shape)

    def divisible(self, cells: Int) -> NDArray[np.bool_]:
        x, y = cells
        return (self.x.high[x] > self.x.low[x]) | (self.y.high[y] > self.y.low[y])


class _Parts(NamedTuple):
    """Cells, and points at corners of them, each with the number of its box."""

    cells: Int
    owner: Int
    points: Int
    place: Int

    @classmethod
    def of_boxes(cls, over: _Over, boxes: int) -> _Parts:
        """All cells to begin with."""

        def all_of(x: Int, y: Int) -> tuple[Int, Int]:
            shape = (len(x), len(y), boxes)
            pairs = np.broadcast_to(x[:, None], shape), np.broadcast_to(y[None], shape)
            box = np.broadcast_to(np.arange(boxes), shape)
            return np.stack([side.ravel() for side in pairs]), box.ravel()

        return cls(*all_of(over.x.pieces, over.y.pieces), *all_of(over.x.corners, over.y.corners))

    @classmethod
    def of_cells(cls, over: _Over, cells: Int, owner: Int, times: int) -> _Parts:
        """Halve cells, as often as said; corners only where they are new."""
        points, place = [], []
        for _ in range(times):
            cells, corners = _halves(over, cells)
            owner = np.tile(owner, 2)
            points.append(corners)
            place.append(owner)
        return cls(cells, owner, np.concatenate(points, axis=1), np.concatenate(place))


def _bounded(over: _Over, count: int, tolerance: float, budget: int) -> tuple[Float, Float]:
    #: values attained, and bounds of the cells that are left as they are
    highest, lowest = np.full(count, -np.inf), np.full(count, np.inf)
    upper, lower = np.full(count, -np.inf), np.full(count, np.inf)
    parts = _Parts.of_boxes(over, count)
    while True:
        cells, owner = parts.cells, parts.owner
        found = over(np.concatenate([cells, parts.points], axis=1))
        (bottom, low), (top, high) = (np.split(x, [cells.shape[1]]) for x in found)
        np.maximum.at(highest, parts.place, low)
        np.minimum.at(lowest, parts.place, high)
        excess = _excess(bottom, top, owner, (lower, upper), (lowest, highest), tolerance)
        chosen = np.flatnonzero((excess > 0.0) & over.divisible(cells))
        times = _DEEP if len(chosen) <= _FEW else _SHALLOW
        affordable = budget >> times
        if len(chosen) > affordable:  # the widest of them
            chosen = chosen[np.argsort(-excess[chosen], kind="stable")[:affordable]]
        left = np.ones(len(owner), bool)
        left[chosen] = False
        np.maximum.at(upper, owner[left], top[left])
        np.minimum.at(lower, owner[left], bottom[left])
        if not len(chosen):
            return lower, upper
        budget -= len(chosen) << times
        parts = _Parts.of_cells(over, cells[:, chosen], owner[chosen], times)


def _excess(
    bottom: Float,
    top: Float,
    owner: Int,
    settled: tuple[Float, Float],
    attained: tuple[Float, Float],
    tolerance: float,
) -> Float:
    """How far beyond the values attained those in a cell may be; none is worth no effort."""
    lowest, highest = attained
    size = np.abs(highest)
    most = np.maximum(highest + tolerance * size, settled[1])
    # A lower bound need not be followed to far below the upper one.
    scale = np.where(np.isfinite(size), _NEAR * size, 0.0)
    least = np.minimum(lowest - tolerance * np.maximum(np.abs(lowest), scale), settled[0])
    with np.errstate(all="ignore"):
        above = (top - most[owner]) / np.abs(most[owner])
        below = _LOWER * (least[owner] - bottom) / np.maximum(np.abs(least), scale)[owner]
    # An attained value that is not finite leaves nothing to improve.
    above[~np.isfinite(highest)[owner] | (top <= most[owner])] = 0.0
    below[~np.isfinite(lowest)[owner] | (bottom >= least[owner])] = 0.0
    return np.fmax(above, below)


def _halves(over: _Over, cells: Int) -> tuple[Int, Int]:
    """Halve each cell along its longer side; return the halves, and the corners that are new."""
    x, y = cells
    a, b, c, d = over.x.low[x], over.x.high[x], over.y.low[y], over.y.high[y]
    with np.errstate(all="ignore"):
        first = b / a >= d / c if over.x.geometric else b - a >= d - c
    halves, corners = np.tile(cells, 2), np.empty((2, 2 * len(x)), np.int64)
    for axis, side, mine in ((0, over.x, first), (1, over.y, ~first)):
        lower, upper, middle = side.halved(cells[axis, mine])
        both = np.tile(mine, 2)
        halves[axis, both] = np.concatenate([lower, upper])
        corners[axis, both] = np.tile(middle, 2)
        other = (over.y, over.x)[axis]
        corners[1 - axis, both] = other.ends[:, cells[1 - axis, mine]].ravel()
    return halves, corners
