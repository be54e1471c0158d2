"""Loss and gain by particles that fall into two, on the sizes ``1 .. M``."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from smolux.errors import InputError
from smolux.functions.content import frozen
from smolux.functions.user_function import golden
from smolux.kernels import Constant
from smolux.kernels.base import Kernel

Float = NDArray[np.float64]

#: entries of the law that are handled at once; sizes for which all are kept
_BLOCK, _KEPT = 1 << 22, 1 << 12
#: sizes for which all splits are compared, and how many of each larger one
_COMPARED, _TRIED = 512, 8
#: by so much may rates differ that depend on i + j alone
_ROUNDING = 1e-13


class Splits:
    """Sums over the splits of a law ``F(i, j)``.

    Where it depends on ``i + j`` alone, ``F = f(i + j)``, the gain is a sum from the end:
    ``sum_{l > k} f(l) n_l``. Else all splits are gone through.

    Parameters
    ----------
    law : Kernel
    count : int
        The number of sizes M.

    Attributes
    ----------
    rates : ndarray of shape (M,)
        Rate at which a particle of each size falls apart.
    """

    def __init__(self, law: Kernel, count: int) -> None:
        self._law, self._count = law, count
        self._of_sum = _of_sum(law, count)
        if self._of_sum is not None:
            self.rates = 0.5 * self._of_sum * np.arange(count, dtype=float)
        else:
            self.rates = 0.5 * sum((b.sum(axis=0) for b in self._blocks()), np.zeros(count))

    def gain(self, n: Float) -> Float:
        """Return ``sum_j F(k, j) n_{k+j}``, shape (S, M) as `n`."""
        if self._of_sum is not None:
            above = np.cumsum((self._of_sum * n)[:, :0:-1], axis=1)[:, ::-1]
            return np.pad(above, ((0, 0), (0, 1)))
        return np.concatenate([n @ block.T for block in self._blocks()], axis=1)

    def _blocks(self) -> list[Float]:
        m = self._count
        if m <= _KEPT:
            return [_matrix(frozen(self._law), m)]
        rows = max(1, _BLOCK // m)
        return [_rows(self._law, a, min(a + rows, m), m) for a in range(0, m, rows)]


def _of_sum(law: Kernel, count: int) -> Float | None:
    """Return f for the sizes ``1 .. count`` if the law is ``f(i + j)``, else None."""
    sizes = np.arange(1.0, count + 1.0)
    if isinstance(law, Constant):
        return np.full(count, law.scale)
    few = min(count, _COMPARED)
    first = np.append(0.0, _checked(law, np.ones(count - 1), sizes[1:] - 1.0))
    matrix = _rows(law, 0, few, few)
    shares = np.append(golden(_TRIED), 0.5)[:, None]
    i = np.clip(np.rint(shares * sizes[1:]), 1.0, sizes[1:] - 1.0)
    tried = _checked(law, i, sizes[1:] - i)
    same = np.abs(tried - first[1:]) <= _ROUNDING * first[1:]
    near = np.abs(matrix - np.triu(np.broadcast_to(first[:few], matrix.shape), 1))
    alike = bool(same.all()) and bool((near <= _ROUNDING * first[:few]).all())
    return first if alike else None


def _rows(law: Kernel, first: int, last: int, largest: int) -> Float:
    """Return ``F(k, l - k)`` for the sizes k of some rows and all sizes l, 0 for l up to k."""
    k = np.arange(first + 1.0, last + 1.0)[:, None]
    other = np.arange(1.0, largest + 1.0)[None, :] - k
    return _checked(law, k, other)


@lru_cache(maxsize=2)
def _matrix(law: Kernel, largest: int) -> Float:
    return _rows(law, 0, largest, largest)


def _checked(law: Kernel, i: Float, j: Float) -> Float:
    """Evaluate a law of splits; zero where there is no other fragment.

    Raises
    ------
    InputError
        If a rate is negative or no finite number, with the split.
    """
    rates = np.where(j > 0.0, law(i, np.maximum(j, 1.0)), 0.0)
    wrong = ~(np.isfinite(rates) & (rates >= 0.0))
    if wrong.any():
        place = np.unravel_index(int(np.argmax(wrong)), wrong.shape)
        one, two = (float(np.broadcast_to(x, wrong.shape)[place]) for x in (i, j))
        raise InputError(
            f"fragmentation: the rate is {rates[place]:g} for fragments of sizes {one:.0f} and "
            f"{two:.0f}: it must be a finite number, zero or more"
        )
    return rates
