"""The finite additive kernel: random forests."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .base import FiniteLaw, Float, binomial, log_repeats


@dataclass(frozen=True)
class Additive(FiniteLaw):
    """Additive kernel: the number of clusters less one is binomially distributed.

    The total rate from k clusters is ``(k - 1) N / V``, so each of the ``N - 1`` mergers has
    happened by ``t`` with the probability ``1 - exp(-N t / V)``, independently. Given k, the
    clusters are the trees of a random forest of k rooted trees on N labelled points.

    References
    ----------
    J. Pitman, J. Comb. Theory A 85, 165 (1999), doi:10.1006/jcta.1998.2919;
    A. A. Lushnikov, J. Colloid Interface Sci. 65, 276 (1978), doi:10.1016/0021-9797(78)90158-3.
    """

    name: ClassVar[str] = "additive"
    reference: ClassVar[str] = "J. Pitman, J. Comb. Theory A 85, 165 (1999)"

    def number_pmf(self, t: float) -> Float:
        k = np.arange(1.0, self.particles + 1)
        return np.concatenate(([0.0], np.exp(self._log_number(self._clock(t), k))))

    def _log_number(self, clock: float, k: Float) -> Float:
        n = self.particles
        if clock == 0:
            return np.where(k == n, 0.0, -np.inf)
        merged = -math.expm1(-n * clock)
        return binomial(n - 1, k - 1) - n * clock * (k - 1) + (n - k) * math.log(merged)

    def number_moments(self, t: float) -> tuple[float, float]:
        left = math.exp(-self.particles * self._clock(t))
        expected = (self.particles - 1) * left
        return 1 + expected, expected * -math.expm1(-self.particles * self._clock(t))

    def _counts(self, clock: float, k: Float) -> Float:
        n = self.particles
        if clock == 0:
            return np.where(k == 1, float(n), 0.0)
        merged = -math.expm1(-n * clock)
        log_x = np.log(k * merged / n)
        log_rest = np.log1p(-k * merged / n)
        return np.exp(binomial(n, k) + (k - 1) * log_x - n * clock + (n - k - 1) * log_rest)

    def _log_probability(self, clock: float, sizes: Float) -> float:
        n, k = self.particles, sizes.size
        number = float(self._log_number(clock, np.array(float(k))))
        trees = sum((s - 1) * math.log(s) - math.lgamma(s + 1) for s in sizes)
        ways = math.lgamma(n + 1) + trees - log_repeats(sizes)
        return number + ways - float(binomial(n - 1, k - 1)) - (n - k) * math.log(n)
