"""The constant kernel with shattering, at all times."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from smolux.errors import InputError

from .base import Float, Solution
from .constant import Constant
from .generating import generating_function
from .special import log_central

#: Gauss-Legendre rule of one panel
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(20)


@dataclass(frozen=True)
class ConstantShattering(Solution):
    """Constant kernel with shattering at a constant rate ``lam``, monomers at the start.

    ``M0 = 2 lam / (1 + 2 lam - exp(-lam t))`` and ``n_1`` are elementary, M2 and M3 one integral
    each; the whole distribution follows from its generating function, a ratio of hypergeometric
    functions (see `smolux.exact.generating`). Time may be infinite: the steady state.

    Parameters
    ----------
    lam : float
        Shattering rate over aggregation rate, above 0.

    References
    ----------
    Steady state: N. V. Brilliantov et al., PNAS 112, 9536 (2015), doi:10.1073/pnas.1503957112.
    Time dependence: derived in the manual, page "Exact solutions".
    """

    lam: float = 0.1
    name: ClassVar[str] = "constant kernel with shattering"
    formula: ClassVar[str] = "K = scale, shattering lam K"
    reference: ClassVar[str] = "steady state: N. V. Brilliantov et al., PNAS 112, 9536 (2015)"

    def _problems(self) -> list[str]:
        if 1e-8 <= self.lam <= 1e3:
            return []
        return [f"lam = {self.lam!r}: the exact solution serves shattering rates of 1e-6 to 1e3"]

    def _integral(self, t: float) -> float:
        """Logarithm of ``D = ((1 + 2 lam) exp(lam t) - 1) / (2 lam)``; ``int M0 dt`` over ``q``."""
        lam = self.lam
        return lam * t + math.log1p(-math.expm1(-lam * t) / (2 * lam))

    def _moments(self, t: float) -> tuple[float, float, float, float]:
        lam = self.lam
        if math.isinf(t):
            second = 1 + (1 + 2 * lam) / (2 * lam**2)
            return 2 * lam / (1 + 2 * lam), 1.0, second, 1 + 3 * second * (0.5 + lam) / lam**2
        total = 2 * lam / (2 * lam - math.expm1(-lam * t))
        # (M2 - 1)' = 1 - lam M0 (M2 - 1) and (M3 - 1)' = 3 M2 - lam M0 (M3 - 1)
        s, w = _panels(t, lam)
        growth = np.log1p(-np.expm1(-lam * s) / (2 * lam)) + lam * (s - t)
        growth -= math.log1p(-math.expm1(-lam * t) / (2 * lam))
        weight = w * np.exp(2 * lam / (1 + 2 * lam) * growth)
        first = float(weight.sum())
        return total, 1.0, 1 + first, 1 + 3 * first + 3 * float(weight @ (t - s))

    def _collisions(self, t: float) -> float:
        lam = self.lam
        if math.isinf(t):
            return math.inf
        integral = 2 / (1 + 2 * lam) * self._integral(t)
        total = 2 * lam / (2 * lam - math.expm1(-lam * t))
        return (1 + lam) * (lam * integral + 1 - total) / (1 + 2 * lam)

    def _densities(self, t: float, k: Float) -> Float:
        lam = self.lam
        if t == 0:
            return (k == 1).astype(float)
        if (1 + lam) * t < 1e-14:  # shattering has not begun to show
            return Constant()._densities(t, k)
        if math.isinf(t):
            decay = math.log1p(-((lam / (1 + lam)) ** 2))
            shape = np.exp(log_central(k) + k * decay) / (2 * k - 1)
            return 2 * lam * (1 + lam) / (1 + 2 * lam) * shape
        largest = int(k.max(initial=1))
        if largest > 1 << 20:
            raise InputError(
                f"size {largest}: the exact solution with shattering serves sizes up to {1 << 20}"
            )
        n = np.empty(k.shape)
        for low, high in _bands(largest):
            inside = (k > low) & (k <= high)
            if inside.any():
                band = _small_band if high <= 1024 else _band
                n[inside] = band(lam, t, high)[k[inside].astype(int)]
        power = 2 * (1 + lam) / (1 + 2 * lam)
        first = (lam + math.exp(-power * self._integral(t))) / (1 + lam)
        return np.where(k == 1, first, n)


def _panels(t: float, lam: float) -> tuple[Float, Float]:
    """Nodes and weights on ``0 .. t``, refined to the scales of the integrand at both ends."""
    if t == 0:
        return np.zeros(1), np.zeros(1)
    fine = min(1.0, 1 / lam)
    reach = fine * 2.0 ** np.arange(-1, 60)
    decay = (0.5 + lam) / lam**2  # 1 / (lam M0) in the steady state
    start = max(0.0, t - 60 * decay - 60 / lam)
    inner = np.concatenate((start + reach, t - min(fine, decay) * 2.0 ** np.arange(-1, 60)))
    edges = np.unique(np.concatenate(([start], inner[(inner > start) & (inner < t)], [t])))
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (1 + _NODES)).ravel(), (half * _WEIGHTS).ravel()


def _bands(largest: int) -> list[tuple[int, int]]:
    """Ranges of sizes that share one contour: up to 64, 128, 256, ..."""
    tops = [64]
    while tops[-1] < largest:
        tops.append(2 * tops[-1])
    return list(zip([0, *tops[:-1]], tops, strict=True))


def _band(lam: float, t: float, high: int) -> Float:
    return generating_function(lam, t).coefficients(high)


_small_band = lru_cache(maxsize=1024)(_band)
