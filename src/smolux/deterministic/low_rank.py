"""Sums over pairs by low-rank factors of the kernel and fast Fourier transforms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from .cross import LowRankFactors
from .tilt import Tilt, Tilts

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: transforms of several densities at once up to this many numbers, one by one beyond
_BATCH = 1 << 18
#: tilts are chosen anew when rounding has grown by so much, and to more than is allowed
_GROWN = 1e3


class LowRank:
    """Low-rank factors and real FFT, ``O(M R log M)``.

    The gain is one quadratic form of the transforms of ``rows[r] * n``: R forward transforms and
    one back. The rounding of transforms is the same for every size. To keep it below small
    densities, everything is multiplied by ``exp(theta k)`` before and divided after, which
    commutes with the convolution; see `Tilts`.

    Parameters
    ----------
    gain, loss : LowRankFactors
        Of the kernel; the same unless ``gain.power`` is not zero.
    tolerance : float
        Of the kernel; rounding is kept below, if it can be.

    Attributes
    ----------
    noise : ndarray of shape (4,)
        What rounding adds to the gains of the moments of order 0 to 3 at most, for the densities
        that were prepared for.
    """

    name = "low-rank"

    def __init__(self, gain: LowRankFactors, loss: LowRankFactors, tolerance: float = 1e-9) -> None:
        self._gain, self._loss = gain, loss
        self.rank, self.error = gain.rank, max(gain.error, loss.error)
        self.largest = gain.rows.shape[1]
        self._allowed = tolerance
        self.sizes = np.arange(1.0, self.largest + 1.0)
        self._tilts: Tilts | None = None
        self._untilt()

    def _untilt(self) -> None:
        flat = Tilt(0, self.largest, 0.0, 0.0, np.full(4, np.inf))
        self._parts = [_Part(self._gain, flat)]
        self._room = np.inf

    @property
    def noise(self) -> Float:
        """See the class."""
        return np.asarray(sum(part.tilt.noise for part in self._parts))

    def loss(self, n: Float) -> Float:
        """See `Operator.loss`."""
        return ((n @ self._loss.rows.T) @ self._loss.core) @ self._loss.rows

    def gain(self, n: Float) -> Float:
        """See `Operator.gain`."""
        return self._all(n)[:, : self.largest]

    def gain_and_beyond(self, n: Float) -> tuple[Float, Float]:
        """See `Operator.gain_and_beyond`: the transforms are long enough to hold all sums."""
        total = self._all(n)
        return total[:, : self.largest], total[:, self.largest :]

    def beyond(self, n: Float) -> Float:
        """See `Operator.beyond`."""
        return self._all(n[None, :])[0, self.largest :]

    def _all(self, n: Float) -> Float:
        """Return the gain of the sizes ``1 .. 2 M``."""
        if np.isfinite(self._room):
            self._watch(n)
        if self.rank * n.size <= _BATCH:
            return self._sum(n)
        return np.concatenate([self._sum(row[None, :]) for row in n])

    def _sum(self, n: Float) -> Float:
        total = np.zeros((len(n), 2 * self.largest))
        for part in self._parts:
            out = total[:, part.out]
            if part is self._parts[0]:
                np.multiply(part.product(n), part.back, out=out)
            else:
                out += part.product(n) * part.back
        return total

    def _watch(self, n: Float) -> None:
        """Choose tilts anew if densities have grown where they are amplified."""
        for part in self._parts:
            rounding = part.rounding(n)
            worst = int(np.argmax(rounding))
            if rounding[worst] > self._room and np.isfinite(n[worst]).all():
                self.prepare(n[worst])
                return

    def columns(self, count: int) -> Float:
        """See `Operator.columns`."""
        return self._gain.columns(count)

    def prepare(self, n: Float | None) -> None:
        """See `Operator.prepare`: choose the tilts."""
        lost = None if n is None else n * self.loss(n[None, :])[0]
        if n is None or lost is None or not lost.any():  # nothing meets
            self._untilt()
            return
        if self._tilts is None:
            self._tilts = Tilts(self._gain.rows, self._gain.core, self._gain.power)
        tilts, excess = self._tilts(n, lost, self._allowed)
        self._parts = [_Part(self._gain, tilt) for tilt in tilts]
        self._room = max(_GROWN, 1.0 / max(excess, 1e-300))


class _Part:
    """The gain by pairs of which the larger size is in a range, with its own tilt."""

    def __init__(self, gain: LowRankFactors, tilt: Tilt) -> None:
        self.tilt, self._core = tilt, gain.core
        low, high = tilt.low, tilt.high
        end = 2 * high
        sizes = np.arange(1.0, end + 1.0)
        self._length = fft.next_fast_len(max(2 * high - low - 1, 1), real=True)
        self._rows = gain.rows[:, :high] * np.exp(tilt.theta * sizes[:high] - tilt.top)
        self._squares = self._rows.T**2
        self.out = slice(low + 1, end)
        back = np.exp(2.0 * tilt.top - tilt.theta * sizes[self.out])
        self.back = 0.5 * sizes[self.out] ** gain.power * back
        diagonal = np.diag(gain.core)
        self._diagonal = diagonal if np.array_equal(gain.core, np.diag(diagonal)) else None

    def rounding(self, n: Float) -> Float:
        """Return the rounding, one for what the tilt was made for; shape (S,)."""
        low, high = self.tilt.low, self.tilt.high
        squares = n[:, :high] ** 2
        own = both = squares[:, low:] @ self._squares[low:]
        if low > 0:
            both = own + 4.0 * (squares[:, :low] @ self._squares[:low])
        return np.asarray(((np.sqrt(own) @ np.abs(self._core)) * np.sqrt(both)).sum(axis=1))

    def product(self, n: Float) -> Float:
        """Return the sums over pairs for the sizes `out`, to be multiplied by `back`."""
        low, high = self.tilt.low, self.tilt.high
        spectrum = self._transform(n[:, low:high], self._rows[:, low:])
        if low > 0:
            other = n[:, :high].copy()
            other[:, :low] *= 2.0
            product = self._form(spectrum, self._transform(other, self._rows))
        elif self._diagonal is None:
            product = self._form(spectrum, spectrum)
        else:
            np.multiply(spectrum, spectrum, out=spectrum)
            product = self._diagonal @ spectrum.view(float).reshape(len(spectrum), -1)
        back = fft.irfft(product.view(complex).reshape(len(n), -1), self._length, overwrite_x=True)
        return np.asarray(back[:, : len(self.back)])

    def _transform(self, n: Float, rows: Float) -> Complex:
        return fft.rfft(rows[:, None, :] * n[None, :, :], self._length, overwrite_x=True)

    def _form(self, left: Complex, right: Complex) -> Float:
        """Return the quadratic form of the core, as real numbers."""
        mixed = self._core @ right.view(float).reshape(len(right), -1)
        product = (left * mixed.view(complex).reshape(left.shape)).sum(axis=0)
        return product.view(float)
