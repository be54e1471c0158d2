"""Logarithms of the combinatorial factors, accurate for any size."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[np.float64]

#: below this size the remainder is tabulated, above it five terms of the series are exact
_TABLE = 16


def _tabulated(k: int) -> float:
    if k == 0:
        return 0.0
    return math.log(math.factorial(k)) - (k * math.log(k) - k + 0.5 * math.log(2 * math.pi * k))


_REMAINDER = np.array([_tabulated(k) for k in range(_TABLE)])


def stirling_remainder(k: ArrayLike) -> Float:
    """Return ``ln k! - (k ln k - k + ln(2 pi k) / 2)``, to one part in 1e15 of ``ln k!``.

    The large terms of ``ln k!`` cancel in every density of this package; what stays is this.
    """
    k = np.asarray(k, float)
    u = 1.0 / np.maximum(k, _TABLE)
    v = u * u
    series = u * (1 / 12 - v * (1 / 360 - v * (1 / 1260 - v * (1 / 1680 - v / 1188))))
    return np.where(k < _TABLE, _REMAINDER[np.minimum(k, _TABLE - 1).astype(int)], series)


def log_borel(k: ArrayLike, x: float, complement: float | None = None) -> Float:
    """Logarithm of the Borel law, ``ln[(k x)**(k - 1) exp(-k x) / k!]``.

    Parameters
    ----------
    k : array_like
        Sizes, at least 1.
    x : float
        Parameter, above 0.
    complement : float, optional
        ``1 - x``, where it is known more accurately than the difference.
    """
    k = np.asarray(k, float)
    d = 1.0 - x if complement is None else complement
    log_x = math.log1p(-d) if abs(d) < 0.5 else math.log(x)
    prefactor = -0.5 * math.log(2 * math.pi) - 1.5 * np.log(k) - log_x
    return prefactor + k * (d + log_x) - stirling_remainder(k)


def log_central(k: ArrayLike) -> Float:
    """Logarithm of ``C(2k, k) / 4**k``, which falls like ``(pi k)**(-1/2)``."""
    k = np.asarray(k, float)
    return stirling_remainder(2 * k) - 2 * stirling_remainder(k) - 0.5 * np.log(math.pi * k)
