"""Loss and gain of the Smoluchowski equations on the sizes ``1 .. M``: direct, or by FFT."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from smolux.errors import InputError
from smolux.kernels.base import Kernel

from .cross import LowRankFactors, cross_approximation, given_factors, interpolation
from .low_rank import LowRank
from .trial import Sample, values

Float = NDArray[np.float64]

#: a kernel matrix up to this many bytes is kept
_CACHE = 320 << 20
#: entries of a kernel matrix that are handled at once
_BLOCK = 1 << 22
#: number of sizes on which low rank is tried before anything is computed
_TRIAL = 1024
#: seconds per number, of a transform per stage and of the direct sum; only their ratio matters
_FFT_COST, _DIRECT_COST = 1.0e-9, 2.5e-9


class Operator(Protocol):
    """Sums over pairs of sizes for several densities at once."""

    name: str
    largest: int
    #: number of forward transforms for a density, 0 for the direct sum
    rank: int
    #: largest relative error of the kernel found on random pairs
    error: float

    def loss(self, n: Float) -> Float:
        """Return ``L_k = sum_j K(k, j) n_j``, shape (S, M) as `n`."""

    def gain(self, n: Float) -> Float:
        """Return ``sum_{i+j=k} K(i, j) n_i n_j / 2``, shape (S, M) as `n`."""

    def gain_and_beyond(self, n: Float) -> tuple[Float, Float | None]:
        """Return the gain, and that of the sizes ``M + 1 .. 2 M``, shape (S, M) each.

        None for the latter if it is only found by `beyond`.
        """

    def beyond(self, n: Float) -> Float:
        """Return the gain of the sizes ``M + 1 .. 2 M`` for densities of shape (M,)."""

    def columns(self, count: int) -> Float:
        """Return ``K(i, j)`` for all i and ``j = 1 .. count``, shape (M, count)."""

    def prepare(self, n: Float | None) -> None:
        """Adapt to densities near `n`, shape (M,), or to any."""


class Direct:
    """All pairs, ``O(M^2)``: for kernels that are far from low rank, and for small windows.

    Parameters
    ----------
    kernel : Kernel
    largest : int
        The number of sizes M. The kernel matrix is kept if it fits into 320 MiB, else evaluated
        each time.
    """

    name = "direct"
    rank = 0
    error = 0.0

    def __init__(self, kernel: Kernel, largest: int) -> None:
        self.kernel, self.largest = kernel, largest
        self._cache = list(self._blocks()) if 8 * largest**2 <= _CACHE else None

    def _blocks(self) -> Iterator[tuple[int, Float]]:
        m = self.largest
        sizes = np.arange(1.0, m + 1.0)
        rows = max(1, min(_BLOCK // m, -(-m // 8)))
        for a in range(0, m, rows):
            yield a, np.ascontiguousarray(values(self.kernel, sizes[a : a + rows, None], sizes))

    def loss(self, n: Float) -> Float:
        """See `Operator.loss`."""
        blocks = self._cache or self._blocks()
        return np.concatenate([n @ block.T for _, block in blocks], axis=1)

    def gain(self, n: Float) -> Float:
        """See `Operator.gain`.

        The products that make one size lie along an anti-diagonal: read with a row stride shorter
        by one entry, a block of rows has them in a column. Each pair of blocks is taken once.
        """
        m = self.largest
        total = np.zeros_like(n)
        item = n.itemsize
        for a, block in self._cache or self._blocks():
            b, start = a + len(block), 2 * a
            if start >= m - 1:
                break
            shape = (len(block), m - 1 - start)
            # sheared[r, c] = K(a + r + 1, a + c - r + 1); where c < r it meets a zero of `shifted`
            sheared = np.lib.stride_tricks.as_strided(
                block[0, a:], shape, ((m - 1) * item, item), writeable=False
            )
            partner = np.concatenate([np.zeros((len(n), m)), n], axis=1)
            partner[:, m : m + a] = 0.0
            partner[:, m + a : m + b] *= 0.5
            for s in range(len(n)):
                shifted = np.lib.stride_tricks.as_strided(
                    partner[s, m + a :], shape, (-item, item), writeable=False
                )
                total[s, start + 1 :] += np.einsum("r,rc,rc->c", n[s, a:b], sheared, shifted)
        return total

    def gain_and_beyond(self, n: Float) -> tuple[Float, None]:
        """See `Operator.gain_and_beyond`."""
        return self.gain(n), None

    def beyond(self, n: Float) -> Float:
        """See `Operator.beyond`; rows shifted by one each have a size in a column."""
        m = self.largest
        total = np.zeros(2 * m)
        for a, block in self._cache or self._blocks():
            rows = len(block)
            shifted = np.zeros((rows, m + rows))
            shifted[:, :m] = (0.5 * n[a : a + rows, None]) * block * n
            width = m + rows - 1
            sums = shifted.ravel()[: rows * width].reshape(rows, width).sum(axis=0)
            total[a + 1 : a + 1 + width] += sums
        return total[m:]

    def columns(self, count: int) -> Float:
        """See `Operator.columns`."""
        sizes = np.arange(1.0, self.largest + 1.0)
        return values(self.kernel, sizes[:, None], sizes[:count])

    def prepare(self, n: Float | None) -> None:
        """See `Operator.prepare`; there is nothing to adapt."""


class OperatorFactory:
    """Makes the operator for a number of sizes: each time the window grows.

    Parameters
    ----------
    kernel : Kernel
    method : {"auto", "direct", "low-rank"}
    tolerance : float
        Largest relative error of the kernel's entries.

    Attributes
    ----------
    notes : list of str
        Fallbacks, once each.
    """

    def __init__(self, kernel: Kernel, method: str, tolerance: float) -> None:
        self.kernel, self.method = kernel, method
        self.tolerance = float(np.clip(tolerance, 1e-13, 1e-6))
        self.notes: list[str] = []
        self._missed = ""

    @property
    def may_change(self) -> bool:
        """Whether the direct sum may be taken where low rank is not exact enough."""
        return self.method == "auto"

    def direct_sum(self, largest: int) -> Direct:
        """Return the direct sum for the sizes ``1 .. largest``, and take it from now on."""
        self.method = "direct"
        return Direct(self.kernel, largest)

    @property
    def direct(self) -> bool:
        """Whether large windows will need the direct sum."""
        return self.method == "direct" or self._low_rank(_TRIAL) is None

    def __call__(self, largest: int) -> Operator:
        """Return the operator for the sizes ``1 .. largest``."""
        if self.method == "direct":
            return Direct(self.kernel, largest)
        operator = self._low_rank(largest)
        if operator is None:
            if self.method == "low-rank":
                raise InputError(
                    f"method = 'low-rank': the {self.kernel.label} kernel is far from low rank on "
                    f"{largest} sizes{self._missed}; use method='auto' or 'direct'"
                )
            if self._missed and largest >= _TRIAL:
                self._note(f"all pairs are summed, which takes longer{self._missed}")
            return Direct(self.kernel, largest)
        if self.method == "auto":
            length = 2 * largest
            transforms = (operator.rank + 1) * length * np.log2(length) * _FFT_COST
            if largest**2 * _DIRECT_COST < transforms:
                return Direct(self.kernel, largest)
        return operator

    def _low_rank(self, largest: int) -> LowRank | None:
        self._missed = ""
        sample = Sample(self.kernel, largest)
        factors = given_factors(sample)
        if factors is not None:
            return LowRank(factors, factors, self.tolerance)
        # the relative speed of free particles, sqrt(1/i + 1/j), holds a function of i + j
        for power in (0.5,):
            exact = cross_approximation(sample, 1e-11, power, max_rank=5)
            loss = interpolation(sample) if exact is not None and exact.error <= 1e-10 else None
            if exact is not None and loss is not None:
                return LowRank(exact, loss, self.tolerance)
        tolerance = self.tolerance
        while tolerance <= 1e-6:
            factors = cross_approximation(sample, tolerance)
            if factors is not None and factors.error <= 10.0 * tolerance:
                if tolerance > self.tolerance:
                    self._note(
                        f"low-rank factors of the kernel found to {tolerance:.0e} relative only"
                    )
                return LowRank(factors, factors, self.tolerance)
            if factors is not None and not self._missed:
                self._missed = _miss(self.kernel, factors)
            tolerance *= 10.0
        return None

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)


def _miss(kernel: Kernel, factors: LowRankFactors) -> str:
    """Say where factors are wrong."""
    i, j = factors.worst
    found = float(factors(np.array([i]), np.array([j]))[0])
    return (
        f": the factors found for the kernel miss K({i}, {j}) = {float(kernel(i, j)):.6g}, where "
        f"they give {found:.6g}"
    )
