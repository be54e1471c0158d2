"""Bounds of a function over boxes by branch and bound with intervals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .intervals import Interval

Float = NDArray[np.float64]
Function = Callable[[Interval, Interval], Any]

#: the most cells looked at in one call for each bound, besides 32 for each box
_MOST = 65536


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
        The most cells that are looked at for each bound of each box, besides the first ones; a call
        for many boxes looks at fewer.
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
    plan = (boxes, pieces, tolerance, budget, geometric)
    upper = _upper(_values(fn, 1.0, least), np.zeros(boxes.shape[1]), *plan)
    # A lower bound need not be followed to far below the upper one.
    scale = np.where(np.isfinite(upper), 0.05 * np.abs(upper), 0.0)
    lower = -_upper(_values(fn, -1.0, least), scale, *plan)
    return lower.reshape(shape), upper.reshape(shape)


def _values(fn: Function, sign: float, least: float) -> Callable[[Float], Interval]:
    def values(cells: Float) -> Interval:
        found = fn(Interval(cells[0], cells[1]), Interval(cells[2], cells[3]))
        if not isinstance(found, Interval):
            found = Interval(float(found))
        lo = np.broadcast_to(np.maximum(found.lo, least), cells.shape[1:])
        hi = np.broadcast_to(np.maximum(found.hi, least), cells.shape[1:])
        return Interval(lo, hi) if sign > 0 else Interval(-hi, -lo)

    return values


def _upper(
    values: Callable[[Float], Interval],
    scale: Float,
    boxes: Float,
    pieces: int,
    tolerance: float,
    budget: int,
    geometric: bool,
) -> Float:
    count = boxes.shape[1]
    attained, settled = np.full(count, -np.inf), np.full(count, -np.inf)
    cells, owner = _cut(boxes, pieces, geometric)
    while True:
        top = values(cells).hi
        a, b, c, d = cells
        for x, y in ((a, c), (a, d), (b, c), (b, d)):
            np.maximum.at(attained, owner, values(np.stack([x, x, y, y])).lo)
        goal = np.maximum(attained + tolerance * np.maximum(np.abs(attained), scale), settled)[
            owner
        ]
        # An attained value that is not finite leaves nothing to improve.
        open_ = (top > goal) & np.isfinite(attained[owner]) & ((b > a) | (d > c))
        chosen = np.flatnonzero(open_)
        if 2 * len(chosen) > budget:
            chosen = np.empty(0, int)
        left = np.ones(len(owner), bool)
        left[chosen] = False
        np.maximum.at(settled, owner[left], top[left])
        if not len(chosen):
            return settled
        budget -= 2 * len(chosen)
        cells, owner = _halve(cells[:, chosen], geometric), np.tile(owner[chosen], 2)


def _cut(boxes: Float, pieces: int, geometric: bool) -> tuple[Float, NDArray[np.int64]]:
    """Cut boxes into cells; the outer edges are kept to the last bit."""
    share = np.linspace(0.0, 1.0, pieces + 1)[:, None]

    def edges(low: Float, high: Float) -> Float:
        inner = low * (high / low) ** share if geometric else low + (high - low) * share
        inner = np.clip(inner, low, high)
        inner[0], inner[-1] = low, high
        return inner

    x, y = edges(boxes[0], boxes[1]), edges(boxes[2], boxes[3])
    shape = (pieces, pieces, boxes.shape[1])
    sides = (x[:-1, None], x[1:, None], y[None, :-1], y[None, 1:])
    cells = np.stack([np.broadcast_to(side, shape).ravel() for side in sides])
    return cells, np.broadcast_to(np.arange(boxes.shape[1]), shape).ravel()


def _halve(cells: Float, geometric: bool) -> Float:
    """Halve each cell along its longer side."""
    a, b, c, d = cells
    with np.errstate(all="ignore"):
        first = b / a >= d / c if geometric else b - a >= d - c
    low, high = np.where(first, a, c), np.where(first, b, d)
    middle = np.clip(np.sqrt(low) * np.sqrt(high) if geometric else 0.5 * (low + high), low, high)
    one = np.stack([a, np.where(first, middle, b), c, np.where(first, d, middle)])
    two = np.stack([np.where(first, middle, a), b, np.where(first, c, middle), d])
    return np.concatenate([one, two], axis=1)
