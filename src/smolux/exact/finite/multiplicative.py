"""The finite multiplicative kernel: components of a random graph."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from .base import FiniteLaw, Float, binomial, log_repeats


def _log_sum(terms: Float) -> float:
    top = float(terms.max())
    return top + math.log(float(np.exp(terms - top).sum())) if top > -math.inf else top


@lru_cache(maxsize=8)
def log_connected(most: int, clock: float) -> Float:
    """Logarithms of the probabilities that the random graphs on 0, 1, ..., `most` points connect.

    Each edge is absent with the probability ``q = exp(-clock)``. By the component, of size b, in
    which a given point lies once another one, the root, is taken away:
    ``C_{m+1} = sum_b C(m-1, b-1) C_b (1 - q**b) q**(b (m-b)) C_{m-b+1}``. All terms are positive;
    the usual ``C_s = 1 - sum ...`` loses all digits.
    """
    log_c = np.full(most + 1, -np.inf)
    log_c[: min(2, most + 1)] = 0.0
    if clock == 0:
        return log_c
    b = np.arange(1.0, most + 1)
    joined = np.log(-np.expm1(-clock * b))
    for m in range(1, most):
        c = b[:m]
        terms = binomial(m - 1, c - 1) + log_c[1 : m + 1] + joined[:m] + log_c[m:0:-1]
        log_c[m + 1] = _log_sum(terms - clock * c * (m - c))
    log_c.setflags(write=False)
    return log_c


@dataclass(frozen=True)
class Multiplicative(FiniteLaw):
    """Multiplicative kernel: the clusters are the components of the random graph G(N, p).

    Two points are joined by the time ``t`` with the probability ``p = 1 - exp(-t / V)``, and so for
    ``V = N`` a giant component, the gel, grows from ``t = 1`` on.

    References
    ----------
    E. Buffet and J. V. Pulé, J. Stat. Phys. 64, 87 (1991), doi:10.1007/BF01057869.
    """

    name: ClassVar[str] = "multiplicative"
    reference: ClassVar[str] = "E. Buffet and J. V. Pulé, J. Stat. Phys. 64, 87 (1991)"

    def _log_counts(self, clock: float, k: Float) -> Float:
        n = self.particles
        log_c = log_connected(n, clock)[k.astype(int)]
        return binomial(n, k) + log_c - clock * k * (n - k)

    def _counts(self, clock: float, k: Float) -> Float:
        return np.exp(self._log_counts(clock, k))

    def number_moments(self, t: float) -> tuple[float, float]:
        """See `FiniteLaw.number_moments`; takes ``O(N**2)`` operations."""
        n, clock = self.particles, self._clock(t)
        k = np.arange(1.0, n + 1)
        log_c = log_connected(n, clock)[1:]
        mean = float(self._counts(clock, k).sum())
        pairs = 0.0
        for a in range(1, n):
            b = k[: n - a]
            rest = n - a - b
            log = binomial(n - a, b) + log_c[: n - a] - clock * (a * b + (a + b) * rest)
            pairs += math.exp(float(binomial(n, a)) + log_c[a - 1] + _log_sum(log))
        return mean, pairs + mean - mean**2

    def number_pmf(self, t: float) -> Float:
        """See `FiniteLaw.number_pmf`; takes ``O(N**3)`` operations."""
        n, clock = self.particles, self._clock(t)
        log_c = log_connected(n, clock)
        table = np.zeros((n + 1, n + 1))  # points, components
        table[0, 0] = 1.0
        for m in range(1, n + 1):
            s = np.arange(1.0, m + 1)
            first = binomial(m - 1, s - 1) + log_c[1 : m + 1] - clock * s * (m - s)
            table[m, 1:] = np.exp(first) @ table[m - 1 :: -1, :-1][:m]
        return table[n]

    def _log_probability(self, clock: float, sizes: Float) -> float:
        n = self.particles
        log_c = log_connected(n, clock)[sizes.astype(int)]
        ways = math.lgamma(n + 1) - sum(math.lgamma(s + 1) for s in sizes) - log_repeats(sizes)
        return ways + float(log_c.sum()) - clock * (n * n - float(sizes @ sizes)) / 2
