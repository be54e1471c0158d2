"""Intervals that know of which variable they are.

Natural intervals are wide where a variable occurs again and again. What depends on one variable
alone, as the radius, the diffusion and the slip of one particle, is therefore followed over many
fine pieces of its range, until the other variable comes in: ranges of one variable are few where
cells of two are many.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .intervals import UFUNCS, Interval

Float = NDArray[np.float64]
Int = NDArray[np.int64]

#: pieces of a range
_LEAST, _MOST = 4, 128


class Side(Interval):
    """Intervals of one of two variables, in fine pieces until the other one comes in.

    Parameters
    ----------
    axis : int
        Which variable.
    place : ndarray of int
        The row of `fine` for each cell.
    fine : Interval
        One row for each range of the variable.
    """

    __slots__ = ("_hull", "axis", "fine", "place")

    def __init__(self, axis: int, place: Int, fine: Interval) -> None:
        self.axis, self.place, self.fine = axis, place, fine
        self._hull: Interval | None = None

    @property
    def plain(self) -> Interval:
        """One interval for each cell."""
        if self._hull is None:
            shape = np.broadcast_shapes(self.fine.lo.shape, self.fine.hi.shape)
            low, high = (np.broadcast_to(x, shape) for x in (self.fine.lo, self.fine.hi))
            low, high = (low.min(axis=1), high.max(axis=1)) if len(shape) == 2 else (low, high)
            found = (x[self.place] if x.ndim else np.full(len(self.place), x) for x in (low, high))
            self._hull = Interval(*found)
        return self._hull

    @property
    def lo(self) -> Float:  # type: ignore[override]
        """See `Interval`."""
        return self.plain.lo

    @property
    def hi(self) -> Float:  # type: ignore[override]
        """See `Interval`."""
        return self.plain.hi

    def _applied(self, function: Callable[..., Any], *operands: Any) -> Any:
        """Apply to fine pieces if all is of one variable, else to the cells."""
        same = all(
            x.axis == self.axis if isinstance(x, Side) else isinstance(x, (int, float, np.number))
            for x in operands
        )
        if not same:
            return function(*(x.plain if isinstance(x, Side) else x for x in operands))
        found = function(*(x.fine if isinstance(x, Side) else x for x in operands))
        return Side(self.axis, self.place, found) if isinstance(found, Interval) else found

    def __neg__(self) -> Any:
        return self._applied(operator.neg, self)

    def __abs__(self) -> Any:
        return self._applied(abs, self)

    def __add__(self, other: Any) -> Any:
        return self._applied(operator.add, self, other)

    def __radd__(self, other: Any) -> Any:
        return self._applied(operator.add, other, self)

    def __sub__(self, other: Any) -> Any:
        return self._applied(operator.sub, self, other)

    def __rsub__(self, other: Any) -> Any:
        return self._applied(operator.sub, other, self)

    def __mul__(self, other: Any) -> Any:
        return self._applied(operator.mul, self, other)

    def __rmul__(self, other: Any) -> Any:
        return self._applied(operator.mul, other, self)

    def __truediv__(self, other: Any) -> Any:
        return self._applied(operator.truediv, self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return self._applied(operator.truediv, other, self)

    def __pow__(self, other: Any) -> Any:
        return self._applied(operator.pow, self, other)

    def __rpow__(self, other: Any) -> Any:
        return self._applied(operator.pow, other, self)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **kwargs: Any) -> Any:
        if method != "__call__" or kwargs or ufunc not in UFUNCS:
            return NotImplemented
        return self._applied(UFUNCS[ufunc], *inputs)


class Ranges:
    """Ranges of one variable, each cut once, of however many cells it is a side.

    Points are ranges, too.

    Parameters
    ----------
    axis : int
        Which variable.
    low, high : ndarray
        The ranges to begin with.
    pieces : int
        In how many pieces these are cut.
    geometric : bool
        Whether ranges are cut in equal ratios or equal lengths.

    Attributes
    ----------
    low, high : ndarray
        The ends of the ranges; a range is known by its number, its place here.
    ends : ndarray of int
        Its ends as points.
    pieces, corners : ndarray of int
        The pieces of each range to begin with, and the points at their ends.
    """

    def __init__(self, axis: int, low: Float, high: Float, pieces: int, geometric: bool) -> None:
        self.axis, self.geometric = axis, geometric
        self.low = self.high = np.empty(0)
        self.ends, self._cut = np.empty((2, 0), np.int64), np.empty((3, 0), np.int64)
        ranges, place = np.unique(np.stack([low, high]), axis=1, return_inverse=True)
        edges = cut(ranges[0], ranges[1], pieces, geometric)
        points = self._points(edges.ravel()).reshape(edges.shape)
        found = self._added(
            edges[:-1].ravel(), edges[1:].ravel(), points[:-1].ravel(), points[1:].ravel()
        )
        self.pieces = found.reshape(pieces, -1)[:, place.ravel()]
        self.corners = points[:, place.ravel()]

    def _added(self, low: Float, high: Float, first: Int, last: Int) -> Int:
        number = len(self.low) + np.arange(len(low))
        self.low, self.high = np.append(self.low, low), np.append(self.high, high)
        self.ends = np.append(self.ends, np.stack([first, last]), axis=1)
        self._cut = np.append(self._cut, np.full((3, len(low)), -1), axis=1)
        return number

    def _points(self, at: Float) -> Int:
        number = len(self.low) + np.arange(len(at))
        return self._added(at, at, number, number)

    def halved(self, wanted: Int) -> Int:
        """Return the lower and the upper half of ranges, and the points between."""
        asked = np.zeros(len(self.low), bool)
        asked[wanted] = True
        new = np.flatnonzero(asked & (self._cut[0] < 0))
        if len(new):
            low, high = self.low[new], self.high[new]
            with np.errstate(all="ignore"):
                middle = np.sqrt(low) * np.sqrt(high) if self.geometric else 0.5 * (low + high)
            middle = np.clip(middle, low, high)
            point = self._points(middle)
            first, last = self.ends[:, new]
            lower = self._added(low, middle, first, point)
            upper = self._added(middle, high, point, last)
            self._cut[:, new] = lower, upper, point
        return self._cut[:, wanted]

    def side(self, wanted: Int, fine: int) -> Side:
        """Return ranges as intervals in about so many pieces in all; whole, if it is none."""
        asked = np.zeros(len(self.low), bool)
        asked[wanted] = True
        row = np.cumsum(asked) - 1
        pieces = min(max(fine // (row[-1] + 1), _LEAST), _MOST) if fine else 1
        edges = cut(self.low[asked], self.high[asked], pieces, self.geometric).T
        return Side(self.axis, row[wanted], Interval(edges[:, :-1], edges[:, 1:]))


def cut(low: Float, high: Float, pieces: int, geometric: bool) -> Float:
    """Cut ranges; the ends are kept to the last bit."""
    if pieces == 1:
        return np.stack([low, high])
    share = np.linspace(0.0, 1.0, pieces + 1)[:, None]
    inner = low * (high / low) ** share if geometric else low + (high - low) * share
    inner = np.clip(inner, low, high)
    inner[0], inner[-1] = low, high
    return inner
