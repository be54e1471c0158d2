"""A particle falls into two by itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np

from ..checks import is_number
from ..errors import InputError
from ..intervals import Interval
from ..kernels import Constant, formula, from_dict, from_function
from ..kernels.base import Kernel, widen
from ..kernels.numeric import SAFETY
from .base import Float, LoneProcess, Varying

#: entries of the law that are handled at once; sizes for which all are kept
_BLOCK, _KEPT = 1 << 22, 1 << 12
#: where the half of a diagonal is cut: by octaves, then in equal lengths
_SHARES = np.concatenate(([0.0], 2.0 ** np.arange(-61.0, -3.0), np.arange(2.0, 17.0) / 16.0))


def _split(k: int, u: float, sizes: Any, counts: Any) -> int:
    i = 1 + int(u * (k - 1))
    sizes[0], counts[0] = i, 1
    if i == k - i:
        counts[0] = 2
        return 1
    sizes[1], counts[1] = k - i, 1
    return 2


@dataclass(frozen=True)
class Fragmentation(Varying, LoneProcess):
    """Particles fall into two: ``(i + j) -> (i) + (j)`` at the rate ``F(i, j)``.

    As in ``dn_k/dt = sum_j F(k, j) n_{k+j} - n_k sum_{i+j=k} F(i, j) / 2``. A constant F is random
    scission: each of the k - 1 bonds of a chain breaks at the rate F/2.

    Parameters
    ----------
    rate : float, str, callable or Kernel
        F: a number, a formula in i and j such as ``"1/(i*j)"``, a function of two sizes, or one of
        `smolux.kernels`. Symmetric and never negative.
    varying : float, callable or str
        A function of time by which the rate is multiplied.

    References
    ----------
    P. J. Blatz and A. V. Tobolsky, J. Phys. Chem. 49, 77 (1945), doi:10.1021/j150440a004.
    """

    rate: Any
    varying: Any = 1.0
    name: ClassVar[str] = "fragmentation"
    least: ClassVar[int] = 2
    splits: ClassVar[bool] = True
    outcome: ClassVar[Callable[..., Any]] = staticmethod(_split)
    variables: ClassVar[Mapping[str, str]] = {"rate": "i and j", "varying": "t"}

    def __post_init__(self) -> None:
        _ = self.factor
        if self.pairs.problems():
            raise InputError(
                [p.replace("kernel", "the fragmentation rate", 1) for p in self.pairs.problems()]
            )

    @cached_property
    def pairs(self) -> Kernel:
        """The law F, which is of the same kind as a kernel."""
        given = self.rate
        if isinstance(given, Kernel):
            return given
        if isinstance(given, Mapping):  # as in files
            return from_dict(given)
        if isinstance(given, str):
            return formula(given)
        if is_number(given):
            if not 0.0 < given < np.inf:
                raise InputError(
                    f"the fragmentation rate = {given!r}: must be a finite number above zero"
                )
            return Constant(float(given))
        if callable(given):
            return from_function(given)
        raise InputError(
            f"the fragmentation rate = {given!r}: must be a number, a formula in i and j, a "
            "function of two sizes or a kernel"
        )

    @property
    def entries(self) -> int:
        """See `Process.entries`."""
        return 2

    @property
    def law(self) -> Callable[..., Any]:
        """See `LoneProcess.law`."""
        return self.pairs.rate

    @property
    def parameters(self) -> tuple[Any, ...]:
        """See `LoneProcess.parameters`."""
        return self.pairs.parameters

    def ceiling(self, low: Float, high: Float) -> Float:
        """See `LoneProcess.ceiling`."""
        return 0.5 * (high - 1.0) * _along_diagonals(self.pairs, low, high)

    def rates(self, sizes: Float) -> Float:
        """See `LoneProcess.rates`."""
        if isinstance(self.pairs, Constant):
            return 0.5 * self.pairs.scale * (sizes - 1.0)
        m = len(sizes)
        if m <= _KEPT:
            return np.asarray(0.5 * _matrix(self.pairs, m).sum(axis=0))
        rows = max(1, _BLOCK // m)
        return 0.5 * sum(
            (_rows(self.pairs, a, min(a + rows, m), m).sum(axis=0) for a in range(0, m, rows)),
            np.zeros(m),
        )

    def gain(self, sizes: Float, n: Float, lost: Float) -> Float:
        """See `LoneProcess.gain`: ``sum_j F(k, j) n_{k+j}``."""
        if isinstance(self.pairs, Constant):
            above = np.cumsum(n[::-1])[::-1]
            return self.pairs.scale * np.append(above[1:], 0.0)
        m = len(n)
        if m <= _KEPT:
            return np.asarray(_matrix(self.pairs, m) @ n)
        rows = max(1, _BLOCK // m)
        blocks = [_rows(self.pairs, a, min(a + rows, m), m) @ n for a in range(0, m, rows)]
        return np.concatenate(blocks)


def _along_diagonals(law: Kernel, low: Float, high: Float) -> Float:
    """Bound ``F(i, k - i)`` over all i, for the sizes k in ranges.

    Over all i and j below k it would be far above: F(1, 1) of small pieces, where a law falls.
    Each diagonal is covered by narrow boxes; F is symmetric, so i goes to half of k only.
    """
    half = np.maximum(np.floor(0.5 * high), 1.0)
    x, y = half * _SHARES[:-1, None], half * _SHARES[1:, None]
    slot = np.broadcast_to(np.arange(len(high)), x.shape)
    held = y >= 1.0
    slot, a = slot[held], np.maximum(np.floor(x[held]), 1.0)
    b = np.maximum(np.ceil(y[held]), a)
    c, d = np.maximum(low[slot] - b, 1.0), np.maximum(high[slot] - a, 1.0)
    try:
        found = law.interval(Interval(a, b), Interval(c, d))
    except TypeError:  # the law is known by its values only
        return _sampled(law, low, high)
    # a bare number if the law does not depend on the sizes
    upper = np.broadcast_to(found.hi if isinstance(found, Interval) else float(found), a.shape)
    bound = np.zeros(high.shape)
    np.maximum.at(bound, slot, widen(upper, upper)[1])
    open_ = ~np.isfinite(bound)
    if open_.any():
        bound[open_] = _sampled(law, low[open_], high[open_])
    return bound


def _sampled(law: Kernel, low: Float, high: Float) -> Float:
    """Largest value found over the smallest and the largest size of each range, widened.

    Of ranges of several sizes one of these is even and the other odd, so halves are tried.
    """
    largest = np.zeros(high.shape)
    for k in (low, high):
        i = np.ceil(np.floor(0.5 * k) * _SHARES[1:, None])
        _, slot = np.nonzero(i >= 1.0)
        i, slot = np.unique(np.stack([i[i >= 1.0], slot]), axis=1)
        slot = slot.astype(int)
        value = law(i, k[slot] - i)
        np.maximum.at(largest, slot, np.where(np.isnan(value), 0.0, value))
    return SAFETY * largest


def _rows(law: Kernel, first: int, last: int, largest: int) -> Float:
    """Return ``F(k, l - k)`` for the sizes k of some rows and all sizes l, 0 for l up to k."""
    k = np.arange(first + 1.0, last + 1.0)[:, None]
    other = np.arange(1.0, largest + 1.0)[None, :] - k
    return np.where(other > 0.0, law(k, np.maximum(other, 1.0)), 0.0)


@lru_cache(maxsize=2)
def _matrix(law: Kernel, largest: int) -> Float:
    return _rows(law, 0, largest, largest)
