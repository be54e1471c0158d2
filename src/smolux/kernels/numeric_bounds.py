"""Bounds of laws that are known by their values only."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.functions.bounds import subdivided
from smolux.functions.intervals import Interval

from .base import Float, widen

#: sampled bounds are widened by this factor
SAFETY = 1.1

#: evaluations in one call for many boxes
_EVALUATIONS = 200_000
#: the most numbers of a law that are looked at
NUMBERS = 16
_FINEST, _COARSEST = 9, 3
_ZOOMS = 3
_LARGEST_SIZE = 2.0**62


def interval_bounds(
    interval: Callable[[Interval, Interval], Interval],
    a: ArrayLike,
    b: ArrayLike,
    c: ArrayLike,
    d: ArrayLike,
) -> tuple[Float, Float]:
    """Bounds by interval arithmetic; infinite where none is found."""
    return widen(*subdivided(interval, a, b, c, d, least=0.0))


def always_bounded(interval: Callable[[Interval, Interval], Interval]) -> bool:
    """Whether intervals give a finite bound over all sizes, and so over each box of them."""
    sizes = Interval(1.0, _LARGEST_SIZE)
    try:
        found = interval(sizes, sizes)
    except TypeError:
        return False
    return bool(np.isfinite(found.lo).all() and np.isfinite(found.hi).all())


def sampled_bounds(
    values: Callable[[Float, Float], Float],
    a: ArrayLike,
    b: ArrayLike,
    c: ArrayLike,
    d: ArrayLike,
    numbers: Float | None = None,
) -> tuple[Float, Float]:
    """Bounds found by trying, widened by `SAFETY`; they may be wrong.

    The corners and a grid of whole sizes in equal ratios, then finer grids around the largest and
    the smallest value found. If the `numbers` that the law reads are given, also pairs of these,
    and pairs that have one as their sum or difference: where a law has branches.
    """
    sides = np.broadcast_arrays(*(np.asarray(x, float) for x in (a, b, c, d)))
    shape = sides[0].shape
    box = np.stack([side.ravel() for side in sides])
    if box.shape[1] == 0:
        return np.empty(shape), np.empty(shape)
    points = int(np.sqrt(_EVALUATIONS / (2 * (1 + _ZOOMS) * box.shape[1])))
    points = min(max(points, _COARSEST), _FINEST)
    upper = _largest(values, box, points)
    lower = -_largest(lambda i, j: -values(i, j), box, points)
    if numbers is not None and len(numbers):
        low, high = _special(values, box, numbers)
        lower, upper = np.minimum(lower, low), np.maximum(upper, high)
    single = (box[0] == box[1]) & (box[2] == box[3])
    factor = np.where(single, 1.0, SAFETY)
    lower, upper = widen(np.maximum(lower, 0.0) / factor, upper * factor)
    return lower.reshape(shape), upper.reshape(shape)


def _largest(values: Callable[[Float, Float], Float], box: Float, points: int) -> Float:
    best = np.full(box.shape[1], -np.inf)
    rows = np.arange(box.shape[1])
    for _ in range(1 + _ZOOMS):
        x, y = _grid(box[0], box[1], points), _grid(box[2], box[3], points)
        found = values(*np.broadcast_arrays(x[:, :, None], y[:, None, :]))
        found = np.where(np.isnan(found), -np.inf, found).reshape(box.shape[1], -1)
        k = found.argmax(axis=1)
        best = np.maximum(best, found[rows, k])
        kx, ky = np.divmod(k, points)
        last = points - 1
        box = np.stack(
            [
                x[rows, np.maximum(kx - 1, 0)],
                x[rows, np.minimum(kx + 1, last)],
                y[rows, np.maximum(ky - 1, 0)],
                y[rows, np.minimum(ky + 1, last)],
            ]
        )
    return best


def _special(
    values: Callable[[Float, Float], Float], box: Float, numbers: Float
) -> tuple[Float, Float]:
    """Smallest and largest value at the pairs of sizes that the numbers single out in each box."""
    low, high = np.full(box.shape[1], np.inf), np.full(box.shape[1], -np.inf)
    a, b, c, d = box
    whole = np.unique(np.rint(numbers))[:NUMBERS]
    for x, y in _singled(box, whole):
        inside = np.flatnonzero((x >= a) & (x <= b) & (y >= c) & (y <= d))
        if len(inside):
            found = values(x[inside], y[inside])
            low[inside] = np.fmin(low[inside], found)
            high[inside] = np.fmax(high[inside], found)
    return low, high


def _singled(box: Float, whole: Float) -> Iterator[tuple[Float, Float]]:
    """Pairs of sizes, one a box, that may lie outside it."""
    a, b, c, d = box
    for n in whole:
        first, last = np.maximum(a, n - d), np.minimum(b, n - c)
        for x in (first, np.rint(0.5 * (first + last)), last):
            yield x, n - x
        for x in (np.maximum(a, c + n), np.minimum(b, d + n)):
            yield x, x - n
        for y in (np.maximum(c, a + n), np.minimum(d, b + n)):
            yield y - n, y
        for m in whole:
            yield np.full_like(a, n), np.full_like(a, m)
        for y in (c, d):
            yield np.full_like(a, n), y
        for x in (a, b):
            yield x, np.full_like(a, n)


def _grid(low: Float, high: Float, points: int) -> NDArray[np.float64]:
    """Whole sizes from `low` to `high` in about equal ratios; the ends as they are."""
    share = np.linspace(0.0, 1.0, points)
    grid = low[:, None] * (high / low)[:, None] ** share
    whole = np.clip(np.rint(grid), low[:, None], high[:, None])
    whole[:, 0], whole[:, -1] = low, high
    return whole
