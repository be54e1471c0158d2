"""Loss and gain of the Smoluchowski equations on the sizes ``1 .. M``: direct, or by FFT."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from ..errors import InputError
from ..kernels.base import Kernel
from .cross import Factors, cross_approximation, given_factors, interpolation

Float = NDArray[np.float64]

METHODS = ("auto", "direct", "low-rank")
#: a kernel matrix up to this many bytes is kept
_CACHE = 320 << 20
#: entries of a kernel matrix that are handled at once
_BLOCK = 1 << 22
#: transforms of several densities at once up to this many numbers, one by one beyond
_BATCH = 1 << 18
#: number of sizes on which low rank is tried before anything is computed
_TRIAL = 1024
#: range of the exponential tilt over the window, as a power of e
_TILT = 80.0
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

    def gain_and_over(self, n: Float) -> tuple[Float, tuple[Float, Float] | None]:
        """Return the gain, and number and mass of pairs larger than M together, shape (S,) each.

        None for these if they are only what the others leave.
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
            yield a, np.ascontiguousarray(self.kernel(sizes[a : a + rows, None], sizes[None, :]))

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

    def gain_and_over(self, n: Float) -> tuple[Float, None]:
        """See `Operator.gain_and_over`."""
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
        return self.kernel(sizes[:, None], sizes[None, :count])

    def prepare(self, n: Float | None) -> None:
        """See `Operator.prepare`; there is nothing to adapt."""


class LowRank:
    """Factors and real FFT, ``O(M R log M)``.

    The gain is one quadratic form of the transforms of ``rows[r] * n``: R forward transforms and
    one back. To keep the rounding noise of the transforms, which is the same for every size, below
    small densities, everything is multiplied by ``exp(theta k)`` before and divided after; the
    convolution commutes with that.

    Parameters
    ----------
    gain, loss : Factors
        Of the kernel; the same unless ``gain.power`` is not zero.
    """

    name = "low-rank"

    def __init__(self, gain: Factors, loss: Factors) -> None:
        self._gain, self._loss = gain, loss
        self.rank, self.error = gain.rank, max(gain.error, loss.error)
        self.largest = m = gain.rows.shape[1]
        self._length = fft.next_fast_len(2 * m - 1, real=True)
        self.sizes = np.arange(1.0, m + 1.0)
        self._beyond = np.arange(m + 1.0, 2.0 * m + 1.0)
        diagonal = np.diag(gain.core)
        self._diagonal = diagonal if np.array_equal(gain.core, np.diag(diagonal)) else None
        self._tilt(0.0)

    def loss(self, n: Float) -> Float:
        """See `Operator.loss`."""
        return ((n @ self._loss.rows.T) @ self._loss.core) @ self._loss.rows

    def gain(self, n: Float) -> Float:
        """See `Operator.gain`."""
        return self._all(n)[:, : self.largest]

    def gain_and_over(self, n: Float) -> tuple[Float, tuple[Float, Float]]:
        """See `Operator.gain_and_over`: the transforms are long enough to hold all sums."""
        total = self._all(n)
        beyond = total[:, self.largest :]
        return total[:, : self.largest], (beyond.sum(axis=1), beyond @ self._beyond)

    def beyond(self, n: Float) -> Float:
        """See `Operator.beyond`."""
        return self._all(n[None, :])[0, self.largest :]

    def _all(self, n: Float) -> Float:
        """Return the gain of the sizes ``1 .. 2 M``."""
        if self.rank * n.size <= _BATCH:
            return self._convolve(n)
        return np.concatenate([self._convolve(row[None, :]) for row in n])

    def _convolve(self, n: Float) -> Float:
        spectrum = fft.rfft(self._rows[:, None, :] * n[None, :, :], self._length, overwrite_x=True)
        if self._diagonal is not None:
            np.multiply(spectrum, spectrum, out=spectrum)
            product = self._diagonal @ spectrum.view(float).reshape(self.rank, -1)
        else:
            mixed = self._gain.core @ spectrum.view(float).reshape(self.rank, -1)
            spectrum *= mixed.view(complex).reshape(spectrum.shape)
            product = spectrum.sum(axis=0).view(float)
        back = fft.irfft(product.view(complex).reshape(len(n), -1), self._length, overwrite_x=True)
        total = np.zeros((len(n), 2 * self.largest))
        np.multiply(back[:, : 2 * self.largest - 1], self._back[1:], out=total[:, 1:])
        return total

    def columns(self, count: int) -> Float:
        """See `Operator.columns`."""
        return self._gain.columns(count)

    def prepare(self, n: Float | None) -> None:
        """Choose the tilt for which the noise disturbs the moments of order 0 to 3 least.

        The noise of size k is ``exp(-theta k) sum_j n_j^2 exp(2 theta j)`` up to a factor. Its
        effect on the moments relative to them is a convex function of theta in the logarithm.
        """
        if n is None or not n.any():
            self._tilt(0.0)
            return
        theta, m = self._best_tilt(n), self.largest
        if abs(theta - self.theta) * m >= 1.0:
            self._tilt(theta)

    def _best_tilt(self, n: Float) -> float:
        m = self.largest
        k = np.unique(np.round(np.geomspace(1, m, 96)).astype(int))
        width = np.gradient(k.astype(float)) if len(k) > 1 else np.ones(1)
        density = np.maximum(np.abs(n[k - 1]), 1e-290 * max(float(np.abs(n).max()), 1e-10))
        sizes = k.astype(float)
        weight = sum((sizes**p / (width * density @ sizes**p)) ** 2 for p in range(4))
        signal = 2.0 * np.log(density) + np.log(width)
        noise = np.log(weight) + np.log(width)

        def logsumexp(x: Float) -> float:
            top = x.max()
            return float(top + np.log(np.exp(x - top).sum()))

        def cost(theta: float) -> float:
            return logsumexp(signal + 2 * theta * sizes) + 0.5 * logsumexp(
                noise - 2 * theta * sizes
            )

        return _minimise(cost, 0.0, _TILT / m)

    def _tilt(self, theta: float) -> None:
        self.theta, m = theta, self.largest
        self._rows = self._gain.rows * np.exp(theta * (self.sizes - 0.5 * m))
        all_sizes = np.concatenate([self.sizes, self._beyond])
        self._back = 0.5 * all_sizes**self._gain.power * np.exp(-theta * (all_sizes - m))


def _minimise(
    function: Callable[[float], float], low: float, high: float, steps: int = 16
) -> float:
    """Return the minimum of a convex function by golden section, to a thousandth of the range."""
    ratio = 0.5 * (np.sqrt(5.0) - 1.0)
    a, b = high - ratio * (high - low), low + ratio * (high - low)
    fa, fb = function(a), function(b)
    for _ in range(steps):
        if fa < fb:
            high, b, fb = b, a, fa
            a = high - ratio * (high - low)
            fa = function(a)
        else:
            low, a, fa = a, b, fb
            b = low + ratio * (high - low)
            fb = function(b)
    return 0.5 * (low + high)


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

    @property
    def may_change(self) -> bool:
        """Whether the direct sum may be taken where low rank is not exact enough."""
        return self.method == "auto"

    def direct_sum(self, largest: int) -> Direct:
        """Return the direct sum for the sizes ``1 .. largest``."""
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
                    f"{largest} sizes; use method='auto' or 'direct'"
                )
            return Direct(self.kernel, largest)
        if self.method == "auto":
            length = 2 * largest
            transforms = (operator.rank + 1) * length * np.log2(length) * _FFT_COST
            if largest**2 * _DIRECT_COST < transforms:
                return Direct(self.kernel, largest)
        return operator

    def _low_rank(self, largest: int) -> LowRank | None:
        factors = given_factors(self.kernel, largest)
        if factors is not None:
            return LowRank(factors, factors)
        # the relative speed of free particles, sqrt(1/i + 1/j), holds a function of i + j
        for power in (0.5,):
            exact = cross_approximation(self.kernel, largest, 1e-11, power, max_rank=5)
            loss = interpolation(self.kernel, largest) if exact is not None else None
            if exact is not None and loss is not None:
                return LowRank(exact, loss)
        tolerance = self.tolerance
        while tolerance <= 1e-6:
            factors = cross_approximation(self.kernel, largest, tolerance)
            if factors is not None:
                if tolerance > self.tolerance:
                    self._note(
                        f"low-rank factors of the kernel found to {tolerance:.0e} relative only"
                    )
                return LowRank(factors, factors)
            tolerance *= 10.0
        return None

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)
