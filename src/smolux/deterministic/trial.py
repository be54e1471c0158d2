"""Values of a kernel at pairs of sizes, and the pairs on which factors of it are tried."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.errors import InputError
from smolux.functions.intervals import Interval
from smolux.kernels.base import Kernel
from smolux.kernels.check import verdict

if TYPE_CHECKING:
    from .cross import LowRankFactors

Float = NDArray[np.float64]
Int = NDArray[np.int64]

#: pairs that factors are tried on: so many of a kind, and of so many sizes each
_SAMPLES, _SIZES = 1024, 1 << 16
#: entries below this share of the largest are only approximated to within it
FLOOR = 1e-6
#: of a user's kernel: all pairs of sizes up to this, and so many on each line that it names
_ALL, _LINE = 256, 512


def values(kernel: Kernel, i: ArrayLike, j: ArrayLike) -> Float:
    """Return a kernel's values at pairs of sizes.

    Raises
    ------
    InputError
        If one is negative or not finite, with the pair.
    """
    found = kernel(i, j)
    if not found.size or (found.min() >= 0.0 and found.max() < np.inf):
        return found
    i, j = np.broadcast_arrays(np.asarray(i, float), np.asarray(j, float))
    bad = np.argwhere(~((found >= 0.0) & (found < np.inf)))
    place = tuple(min(bad, key=lambda at: max(i[tuple(at)], j[tuple(at)])))
    value = float(found[place])
    raise InputError(
        f"kernel {kernel.label}: K({i[place]:.0f}, {j[place]:.0f}) = {value:.6g}: {verdict(value)}"
    )


class Sample:
    """Pairs of sizes on which factors are tried: each with itself, each with any, small with any.

    Of a user's kernel, which may be anything, also every pair of small sizes; each sum and each
    difference of two sizes; what the numbers in the law single out; and where intervals say that
    it may be largest and smallest.

    Attributes
    ----------
    i, j : ndarray of int64
    """

    def __init__(self, kernel: Kernel, largest: int) -> None:
        self.kernel, self.largest = kernel, largest
        rng = np.random.default_rng([largest, 0])
        pairs = [_common(rng, largest)]
        if kernel.arbitrary:
            pairs += [
                _all(min(largest, _ALL)),
                _sums(rng, largest),
                _singled_out(rng, kernel.singled_out, largest),
                _extremes(kernel, largest),
            ]
        self.i, self.j = np.minimum(np.concatenate(pairs, axis=1), largest)
        self._exact = values(kernel, self.i, self.j)
        floor = FLOOR * max(float(self._exact.max()), 1e-300)
        self._scale = self._exact + floor

    def errors(self, factors: LowRankFactors) -> Float:
        """Return the errors of factors relative to the kernel."""
        return np.abs(factors(self.i, self.j) - self._exact) / self._scale

    def tried(self, factors: LowRankFactors) -> LowRankFactors:
        """Return factors with the largest error that was found, and where."""
        errors = self.errors(factors)
        worst = int(np.argmax(errors))
        return replace(
            factors, error=float(errors[worst]), worst=(int(self.i[worst]), int(self.j[worst]))
        )


def _common(rng: np.random.Generator, largest: int) -> Int:
    each = rng.permutation(largest)[:_SIZES] + 1
    any_size = rng.integers(1, largest + 1, each.size)
    spread = np.floor((largest + 1.0) ** rng.random((2, _SAMPLES))).astype(np.int64)
    small = rng.integers(1, min(largest, 64) + 1, _SAMPLES)
    mixed = np.stack([small, rng.integers(1, largest + 1, _SAMPLES)])
    paired = np.stack([np.tile(each, 2), np.concatenate([each, any_size])])
    return np.concatenate([paired, spread, mixed], axis=1)


def _all(largest: int) -> Int:
    return np.stack(np.triu_indices(largest)) + 1


def _sums(rng: np.random.Generator, largest: int) -> Int:
    """Return a pair for each sum of two sizes, and for each difference."""
    total = rng.permutation(np.arange(2, 2 * largest + 1))[:_SIZES]
    low, high = np.maximum(total - largest, 1), np.minimum(total - 1, largest)
    i = rng.integers(low, high + 1)
    apart = rng.permutation(largest)[:_SIZES]
    k = rng.integers(1, largest - apart + 1)
    return np.concatenate([np.stack([i, total - i]), np.stack([k, k + apart])], axis=1)


def _singled_out(rng: np.random.Generator, numbers: Float, largest: int) -> Int:
    """Return pairs that have a number of the law as a size, a sum or a difference."""
    found = [np.empty((2, 0), np.int64)]
    sizes = rng.permutation(largest)[:_LINE] + 1
    whole = numbers.astype(np.int64)
    for number in whole:
        near = rng.integers(1, max(min(number, largest), 2), _LINE)
        found += [
            np.stack([sizes, np.full_like(sizes, number)]),
            np.stack([near, number - near]),
            np.stack([sizes, sizes + number]),
            np.stack([whole, np.full_like(whole, number)]),
        ]
    pairs = np.concatenate(found, axis=1)
    return pairs[:, ((pairs >= 1) & (pairs <= largest)).all(axis=0)]


def _extremes(kernel: Kernel, largest: int) -> Int:
    """Return where intervals lead to: the largest and the smallest value in boxes of octaves.

    Each box is halved on both sides again and again, and the part is kept where the bound is best.
    """
    low = 2 ** np.arange(int(largest).bit_length())
    high = np.minimum(2 * low - 1, largest)
    a, b = np.triu_indices(len(low))
    found = []
    for sign in (1.0, -1.0):
        box = np.stack([low[a], high[a], low[b], high[b]])
        while (box[1] > box[0]).any() or (box[3] > box[2]).any():
            parts = _quarters(box)
            try:
                bounds = kernel.interval(
                    Interval(parts[:, 0].astype(float), parts[:, 1].astype(float)),
                    Interval(parts[:, 2].astype(float), parts[:, 3].astype(float)),
                )
            except TypeError:
                return np.empty((2, 0), np.int64)
            top = bounds.hi if sign > 0 else -bounds.lo
            top = np.broadcast_to(np.nan_to_num(top, nan=np.inf), parts[:, 0].shape)
            box = parts[np.argmax(top, axis=0), :, np.arange(box.shape[1])].T
        found.append(box[[0, 2]])
    return np.concatenate(found, axis=1)


def _quarters(box: Int) -> Int:
    """Return the four parts of boxes, shape (4, 4, B); a side of one size stays."""
    a, b, c, d = box
    left, right = (a + b) // 2, (c + d) // 2
    first, second = (a, left), (np.minimum(left + 1, b), b)
    third, fourth = (c, right), (np.minimum(right + 1, d), d)
    return np.stack([np.stack([*x, *y]) for x in (first, second) for y in (third, fourth)])
