"""Where time steps must end, so that what varies in time is neither stepped over nor bridged.

A step of the solution sees a function of time at four times only. So before the first step each
function is looked at over the whole time: where intervals follow it, an upper bound that exceeds
all that was seen leads to what is narrow, however narrow it is; others are tried at many times,
beside those that they name. Then time is cut into pieces on each of which the function is a
polynomial of the degree that a step can take, to within the tolerance. Jumps are located to the
last bit, and ends of pieces lie at kinks. No step reaches over the end of a piece.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from smolux.errors import InputError
from smolux.functions.intervals import Interval
from smolux.functions.time import TimeFunction
from smolux.functions.user_function import spread

Float = NDArray[np.float64]
Bool = NDArray[np.bool_]

#: pieces in which a function is looked at first, at most, and times at which others are tried
_FIRST, _MOST, _TRIED = 64, 1 << 17, 4096
#: share of the integral that all that was not seen may have; what is narrow has less of it still
_UNSEEN = 1e-3
#: the degree of a polynomial on a piece, which a step of four stages takes exactly
_DEGREE = 7
#: in how many parts a piece is looked at for a jump
_LOOKS = 16
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class TimeMesh:
    """Ends of pieces of time, ascending, the first and the last time with them."""

    edges: Float

    @classmethod
    def of(cls, laws: Sequence[TimeFunction], end: float, tolerance: float) -> TimeMesh:
        """Make the pieces for all functions that multiply rates.

        Parameters
        ----------
        laws : sequence of TimeFunction
        end : float
            The last time.
        tolerance : float
            Relative error of a function on a piece.

        Raises
        ------
        InputError
            If a function is negative or not finite somewhere.
        """
        varying = [law for law in laws if law.constant is None]
        edges = [_Pieces(law, end, tolerance).edges for law in varying]
        merged = np.unique(np.concatenate([np.array([0.0, end]), *edges]))
        # ends that differ by rounding, of two functions with the same jumps, are one
        far = np.append(True, np.diff(merged) > 4.0 * _EPS * merged[1:])
        far[-1] = True
        return cls(merged[far])

    def piece(self, t: float) -> tuple[float, float]:
        """Return the ends of the piece that begins at or holds the time t."""
        k = int(np.searchsorted(self.edges, t, side="right"))
        k = min(max(k, 1), len(self.edges) - 1)
        return float(self.edges[k - 1]), float(self.edges[k])


def within(low: float, high: float) -> tuple[float, float]:
    """Return the first and the last time strictly between both: a function may jump at either."""
    return float(np.nextafter(low, high)), float(np.nextafter(high, low))


def factor_at(law: TimeFunction, times: Float, what: str) -> Float:
    """Evaluate a function of time that multiplies a rate.

    Raises
    ------
    InputError
        If it is negative or not finite, with the time.
    """
    values = np.asarray(law(times), float)
    wrong = ~(np.isfinite(values) & (values >= 0.0))
    if wrong.any():
        k = int(np.argmax(wrong))
        raise InputError(
            f"{what} is {values.flat[k]:g} at t = {times.flat[k]:.6g}: it must be a finite number, "
            "zero or more, up to the last output time"
        )
    return values


class _Pieces:
    """Ends of the pieces of one function."""

    def __init__(self, law: TimeFunction, end: float, tolerance: float) -> None:
        self._law, self._end, self._tolerance = law, end, tolerance
        self._seen = self._look()
        self._values = self._at(self._seen)
        widths = np.diff(self._seen, prepend=0.0)
        self._integral = float(widths @ self._values)
        given = law.edges[(law.edges > 0.0) & (law.edges < end)]
        low, high, jumps = self._halve(np.unique(np.concatenate([[0.0], given, [end]])))
        self.edges = self._merge(low, high, np.concatenate([given, jumps]))

    def _at(self, times: Float) -> Float:
        return factor_at(self._law, times, f"{self._law.text}:")

    def _look(self) -> Float:
        """Return times at which what the function does shows, ascending."""
        law, end = self._law, self._end
        named = law.numbers[(law.numbers > 0.0) & (law.numbers < end)]
        beside = [named, np.nextafter(named, -np.inf), np.nextafter(named, np.inf)]
        if law.followed or law.stated is not None:
            low, high = self._narrowed(np.unique(np.concatenate([[0.0], law.edges, [end]])))
            times = [low, 0.5 * (low + high), high]
        else:
            times = [end * spread(_TRIED)]
        found = np.unique(np.concatenate([*times, *beside]))
        return found[(found >= 0.0) & (found <= end)]

    def _narrowed(self, edges: Float) -> tuple[Float, Float]:
        """Halve ranges of time until what bounds allow beyond what was seen is little."""
        edges = edges[(edges >= 0.0) & (edges <= self._end)]
        parts = np.linspace(0.0, 1.0, _FIRST + 1)[:-1]
        starts = (edges[:-1, None] + np.diff(edges)[:, None] * parts).ravel()
        low, high = starts, np.append(starts[1:], self._end)
        unseen, seen = self._beyond(low, high)
        while len(low) < _MOST:
            total = max(float(seen.sum()), 1e-12 * float(unseen[np.isfinite(unseen)].sum()))
            open_ = unseen > _UNSEEN * total / max(len(low), 1024)
            open_ &= high - low > 4.0 * _EPS * self._end
            if not open_.any():
                break
            middle = 0.5 * (low[open_] + high[open_])
            a, b = np.append(low[open_], middle), np.append(middle, high[open_])
            more, there = self._beyond(a, b)
            low, high = np.append(low[~open_], a), np.append(high[~open_], b)
            unseen, seen = np.append(unseen[~open_], more), np.append(seen[~open_], there)
        return low, high

    def _beyond(self, low: Float, high: Float) -> tuple[Float, Float]:
        """Return what bounds allow beyond three values, and these, times the length of ranges."""
        if self._law.stated is not None:
            upper = self._law.stated_bounds(low, high)[1]
        else:
            upper = np.broadcast_to(self._law.interval(Interval(low, high)).hi, low.shape)
        inside = low + (high - low) * np.array([[0.0], [0.5], [1.0]])
        values = self._at(np.minimum(inside, self._end))
        width = high - low
        return (upper - values.max(axis=0)) * width, values.mean(axis=0) * width

    def _fits(self, low: Float, high: Float, count: int) -> Bool:
        """Whether the function is a polynomial on each of some ranges, ascending and disjoint.

        Or differs from it by so little that this does not matter if all of `count` ranges do so.
        """
        k = np.arange(_DEGREE + 1)
        nodes = 0.5 * (1.0 - np.cos(np.pi * (k + 0.5) / (_DEGREE + 1)))
        weights = np.where(k % 2, -1.0, 1.0) * np.sin(np.pi * (k + 0.5) / (_DEGREE + 1))
        between = np.concatenate([[0.0], 0.5 * (nodes[1:] + nodes[:-1]), [1.0]])
        first, last = np.nextafter(low, high), np.nextafter(high, low)
        width = high - low
        values = self._inside(nodes, low, width, first, last)
        tried = self._inside(between, low, width, first, last)
        fitted = _interpolate(nodes, weights, values, between[:, None])
        size = np.maximum(np.abs(values).max(axis=0), np.abs(tried).max(axis=0))
        error = np.abs(fitted - tried).max(axis=0)
        # what was looked at before: it may lie between the others
        place = np.searchsorted(low, self._seen, side="right") - 1
        held = (self._seen > low[place]) & (self._seen < high[place])
        place, seen, there = place[held], self._seen[held], self._values[held]
        share = (seen - low[place]) / width[place]
        off = np.abs(_interpolate(nodes, weights, values[:, place], share[None, :])[0] - there)
        np.maximum.at(error, place, off)
        np.maximum.at(size, place, np.abs(there))
        small = error * width <= self._tolerance * self._integral / (4.0 * count)
        return (error <= self._tolerance * size) | small

    def _inside(self, shares: Float, low: Float, width: Float, first: Float, last: Float) -> Float:
        return self._at(np.clip(low + shares[:, None] * width, first, last))

    def _halve(self, edges: Float) -> tuple[Float, Float, Float]:
        """Halve pieces until the function is a polynomial on each; return them, and its jumps."""
        low, high = edges[:-1], edges[1:]
        done: list[tuple[Float, Float]] = []
        jumps: list[Float] = []
        pieces = 0
        while len(low):
            good = self._fits(low, high, pieces + len(low))
            done.append((low[good], high[good]))
            pieces += int(good.sum())
            low, high = low[~good], high[~good]
            short = high - low <= 2.0 * np.spacing(high)
            jumps.append(high[short])
            low, high = low[~short], high[~short]
            if pieces + len(low) > _MOST:
                raise InputError(
                    f"{self._law.text}: varies too fast up to t = {self._end:.6g} to be followed: "
                    f"{_MOST} pieces of time are not enough; take an earlier last time"
                )
            middle, jumped = self._cut(low, high)
            jumps.append(middle[jumped])
            low = np.stack([low, middle], axis=1).ravel()
            high = np.stack([middle, high], axis=1).ravel()
        lows = np.concatenate([a for a, _ in done])
        order = np.argsort(lows)
        return lows[order], np.concatenate([b for _, b in done])[order], np.concatenate(jumps)

    def _cut(self, low: Float, high: Float) -> tuple[Float, Bool]:
        """Return where to cut ranges: in the middle, or at the jump if there seems to be just one.

        That is where most of the variation lies between two neighbours of some values; it is
        followed there to the last bit.
        """
        middle = 0.5 * (low + high)
        shares = np.linspace(0.0, 1.0, _LOOKS + 1)[:, None]
        times = low + (high - low) * shares
        times[0], times[-1] = np.nextafter(low, high), np.nextafter(high, low)
        values = self._at(times)
        steps = np.abs(np.diff(values, axis=0))
        place = steps.argmax(axis=0)
        largest = steps.max(axis=0)
        jumped = (largest > 0.0) & (largest >= 0.9 * steps.sum(axis=0))
        one = np.flatnonzero(jumped)
        a, b = times[place[one], one], times[place[one] + 1, one]
        below, above = values[place[one], one], values[place[one] + 1, one]
        for _ in range(64):
            half = 0.5 * (a + b)
            inside = (half > a) & (half < b)
            if not inside.any():
                break
            value = self._at(half)
            left = np.abs(value - below) > np.abs(above - value)
            b, above = np.where(left, half, b), np.where(left, value, above)
            a, below = np.where(left, a, half), np.where(left, below, value)
        # a steep slope ends in differences that vanish
        real = np.abs(above - below) >= 0.5 * largest[one]
        jumped[one[~real]] = False
        middle[one[real]] = b[real]
        return middle, jumped

    def _merge(self, low: Float, high: Float, jumps: Float) -> Float:
        """Join neighbours on which the function is one polynomial: what is left ends at kinks."""
        # the last bit before a jump belongs to what is before it
        edges = np.unique(np.concatenate([low, high, jumps]))
        edges = edges[np.append(np.diff(edges) > 4.0 * np.spacing(edges[1:]), True)]
        edges[0] = 0.0
        kept = np.isin(edges, jumps)
        before = 0
        while len(edges) != before:
            before = len(edges)
            for first in (0, 1):
                edges, kept = self._join(edges, kept, first)
        return edges

    def _join(self, edges: Float, kept: Bool, first: int) -> tuple[Float, Bool]:
        """Take out every other inner edge, from the `first` on, that is not needed."""
        place = np.arange(1 + first, len(edges) - 1, 2)
        place = place[~kept[place]]
        if not len(place):
            return edges, kept
        good = self._fits(edges[place - 1], edges[place + 1], len(edges))
        stay = np.ones(len(edges), bool)
        stay[place[good]] = False
        return edges[stay], kept[stay]


def _interpolate(nodes: Float, weights: Float, values: Float, at: Float) -> Float:
    """Return polynomials through values at nodes, barycentric, shape (nodes, P), at shares of each.

    J. P. Berrut and L. N. Trefethen, SIAM Rev. 46, 501 (2004), doi:10.1137/S0036144502417715.
    """
    difference = at[:, None, :] - nodes[None, :, None]
    near = np.abs(difference) < 1e-14
    difference[near] = 1.0
    share = weights[None, :, None] / difference
    found = (share * values).sum(axis=1) / share.sum(axis=1)
    hit = near.any(axis=1)
    exact = (near * values).sum(axis=1)
    return np.where(hit, exact, found)
