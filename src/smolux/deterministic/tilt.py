"""The exponential tilts under which the rounding of a convolution disturbs the moments least."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

#: range of a tilt over its sizes, as a power of e, either way
_RANGE = 300.0
#: sizes are taken one by one up to this, and above in blocks of this share of their size
_FINE = 64
#: where sizes may be parted, as a share of all, and the least part
_CUTS, _LEAST = (1 / 8, 1 / 64, 1 / 512), 16
#: steps of the search for a minimum, to a thousandth of the range
_STEPS = 13
#: error of a transform relative to its largest number, per doubling of its length; measured: less
_ROUNDING = np.finfo(float).eps / 32.0


@dataclass(frozen=True)
class Tilt:
    """Of the products of two sizes of which the larger one is in ``low + 1 .. high``.

    Attributes
    ----------
    low, high : int
    theta : float
        Of the factor ``exp(theta j - top)`` of the densities.
    top : float
        Logarithm of the root of the sum of squares of what is transformed, without it.
    noise : ndarray of shape (4,)
        What rounding adds to ``sum_k k**p gain_k``.
    """

    low: int
    high: int
    theta: float
    top: float
    noise: Float


class Tilts:
    """The choice of tilts for densities, by the noise that they leave in the moments.

    Transforms of ``a_j exp(theta j)`` give a product ``a * b`` with an error that is the same for
    each size: the rounding unit times ``log2`` of the length, times the root of ``sum_j a_j**2
    exp(2 theta j)`` and of the same of b. Taken back, size k has ``exp(-theta k)`` of it, and the
    gain of the moment of order p the sum of that with ``k**p``. The logarithm of what this is over
    the moments of order 0 to 3 is a convex function of theta, in which each populated size counts.

    One tilt follows densities that fall about exponentially. Where they fall more slowly, small
    sizes drown large ones. Then these are parted: products of small sizes only are taken by
    themselves, with a tilt of their own.

    Parameters
    ----------
    rows, core : ndarray of shape (R, M) and (R, R)
        Low-rank factors of the kernel.
    power : float
        The sums are multiplied by ``k**power``.
    """

    def __init__(self, rows: Float, core: Float, power: float) -> None:
        if np.array_equal(core, np.diag(np.diag(core))):
            # one row that has the same sum of squares
            rows, core = np.sqrt(np.abs(np.diag(core)) @ rows**2)[None, :], np.ones((1, 1))
        self._rows, self._core = np.abs(rows), _log(np.abs(core))
        m = self.largest = rows.shape[1]
        self._starts = _blocks(m)
        ends = np.append(self._starts[1:], m)
        self._middles = 0.5 * (self._starts + 1.0 + ends)
        sizes = np.arange(1.0, m + 1.0)
        self._powers = sizes ** np.arange(4.0)[:, None]
        self._sums = _log(np.add.reduceat(self._powers * sizes**power, self._starts, axis=1))
        cuts = np.searchsorted(self._starts, np.multiply(_CUTS, m))
        self._cuts = [int(c) for c in np.unique(cuts) if self._starts[c] >= _LEAST]

    def __call__(self, n: Float, lost: Float, allowed: float) -> tuple[list[Tilt], float]:
        """Return one tilt, or two if rounding matters with one and parting the sizes helps.

        And how large rounding is relative to what is allowed.

        Parameters
        ----------
        n, lost : ndarray of shape (M,)
            Densities, not all zero, and what the loss takes of them per time.
        allowed : float
            Rounding in the gains of the moments, relative to what their losses are.
        """
        levels = self._levels(np.abs(n))
        moments = _log(self._powers @ np.abs(n))
        weights = _sum(self._sums - moments[:, None], axis=0)
        limit = allowed * (self._powers @ np.abs(lost))
        whole = len(self._starts)

        def parts(cut: int) -> tuple[float, list[Tilt]]:
            bounds = [(0, cut), (cut, whole)] if cut < whole else [(0, whole)]
            found = [self._part(a, b, levels, weights) for a, b in bounds]
            noise = np.sum([part.noise for part in found], axis=0)
            with np.errstate(divide="ignore", invalid="ignore"):
                return float(np.nanmax(noise / limit)), found

        best = parts(whole)
        if best[0] > 1.0:
            # a tilt for sizes that are empty says nothing of what will be there
            filled = [c for c in self._cuts if levels[:, :c].max() > -np.inf < levels[:, c:].max()]
            best = min([best, *map(parts, filled)], key=lambda choice: choice[0])
        return best[1], best[0]

    def _levels(self, n: Float) -> Float:
        """Return, for each row and block, the logarithm of the sum of squares, shape (R, B)."""
        values = self._rows * n
        top = np.maximum.reduceat(values, self._starts, axis=1)
        width = np.diff(np.append(self._starts, self.largest))
        scaled = values / np.repeat(np.where(top > 0.0, top, 1.0), width, axis=1)
        return 2.0 * _log(top) + _log(np.add.reduceat(scaled**2, self._starts, axis=1))

    def _part(self, a: int, b: int, levels: Float, weights: Float) -> Tilt:
        """Return the best tilt for the blocks from a up to b."""
        high = self.largest if b == len(self._starts) else int(self._starts[b])
        reached = int(np.searchsorted(self._starts, 2 * high))
        middles = self._middles
        out = slice(a, reached)

        def size(theta: float) -> float:
            """Logarithm of the sum over pairs of factors of the two roots."""
            tilted = levels[:, :b] + 2.0 * theta * middles[:b]
            own = 0.5 * _sum(tilted[:, a:], axis=1)
            if a == 0:
                both = own
            else:
                both = 0.5 * np.logaddexp(2 * own, np.log(4.0) + _sum(tilted[:, :a], axis=1))
            return float(_sum((self._core + own[:, None] + both).ravel()))

        def cost(theta: float) -> float:
            return size(theta) + float(_sum(weights[out] - theta * middles[out]))

        theta = _minimise(cost, -_RANGE / high, _RANGE / high)
        rounding = np.log(_ROUNDING * np.log2(2.0 * high))
        spread = _sum(self._sums[:, out] - theta * middles[out], axis=1)
        noise = np.exp(rounding + size(theta) + spread)
        low = 0 if a == 0 else int(self._starts[a])
        return Tilt(low, high, theta, 0.5 * size(theta), noise)


def _blocks(largest: int) -> NDArray[np.int64]:
    """Return the first index of each block: single sizes, then a share of the size."""
    starts = list(range(min(_FINE, largest)))
    while starts[-1] + max(1, starts[-1] // _FINE) < largest:
        starts.append(starts[-1] + max(1, starts[-1] // _FINE))
    return np.array(starts)


def _log(values: Float) -> Float:
    with np.errstate(divide="ignore"):
        return np.log(values)


def _sum(logs: Float, axis: int = -1) -> Float:
    """Return the logarithm of a sum of exponentials."""
    top = logs.max(axis=axis, keepdims=True, initial=-np.inf)
    top = np.where(np.isfinite(top), top, 0.0)
    return _log(np.exp(logs - top).sum(axis=axis)) + top.squeeze(axis)


def _minimise(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the minimum of a convex function by golden section."""
    ratio = 0.5 * (np.sqrt(5.0) - 1.0)
    a, b = high - ratio * (high - low), low + ratio * (high - low)
    fa, fb = function(a), function(b)
    for _ in range(_STEPS):
        if fa < fb:
            high, b, fb = b, a, fa
            a = high - ratio * (high - low)
            fa = function(a)
        else:
            low, a, fa = a, b, fb
            b = low + ratio * (high - low)
            fb = function(b)
    return 0.5 * (low + high)
