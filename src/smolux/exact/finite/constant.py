"""The finite constant kernel: Kingman's coalescent."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .base import FiniteLaw, Float, binomial, log_repeats

#: mean number of jumps in one step of uniformisation, and the terms it needs
_MEAN, _TERMS = 32.0, 120
#: probabilities below this are dropped from both ends
_TAIL = 1e-40


def death_pmf(rates: Float, start: int, time: float) -> Float:
    """Distribution of a pure death process, by uniformisation: sums of positive terms.

    Parameters
    ----------
    rates : ndarray
        Rate of leaving each state ``0, 1, ...``, which must not fall with the state.
    start : int
        State at time zero.
    time : float

    Returns
    -------
    ndarray of shape (start + 1,)
        Absolute error about 1e-14.
    """
    p = np.zeros(start + 1)
    p[start] = 1.0
    low = high = start
    left = time
    while left > 0 and rates[high] > 0:
        rate = rates[high]
        step = min(left, _MEAN / rate)
        left -= step
        low = max(0, low - _TERMS)
        leave = rates[low : high + 1] / rate
        v = p[low : high + 1].copy()
        weight = math.exp(-rate * step)
        total = weight * v
        for m in range(1, _TERMS):
            moved = leave * v
            v -= moved
            v[:-1] += moved[1:]
            weight *= rate * step / m
            total += weight * v
        p[low : high + 1] = total
        present = np.flatnonzero(p > _TAIL)
        low, high = int(present[0]), int(present[-1])
    return p


@dataclass(frozen=True)
class Constant(FiniteLaw):
    """Constant kernel: the number of clusters is Kingman's death process.

    From k clusters the rate is ``k (k - 1) / (2 V)``; given their number, the sizes in random order
    are a uniform composition of N.

    References
    ----------
    J. F. C. Kingman, Stoch. Process. Appl. 13, 235 (1982), doi:10.1016/0304-4149(82)90011-4;
    S. Tavaré, Theor. Popul. Biol. 26, 119 (1984), doi:10.1016/0040-5809(84)90027-3 (moments).
    """

    name: ClassVar[str] = "constant"
    reference: ClassVar[str] = "J. F. C. Kingman, Stoch. Process. Appl. 13, 235 (1982)"

    def number_pmf(self, t: float) -> Float:
        return self._number_pmf(self._clock(t))

    def _number_pmf(self, clock: float) -> Float:
        k = np.arange(self.particles + 1.0)
        return death_pmf(k * (k - 1) / 2, self.particles, clock)

    def number_moments(self, t: float) -> tuple[float, float]:
        """See `FiniteLaw.number_moments`; a sum of positive terms for each factorial moment."""
        n, clock = self.particles, self._clock(t)
        most = n if clock == 0 else min(n, 2 + math.isqrt(int(min(1500 / clock, 1e17))))
        k = np.arange(1.0, most + 1)
        # falling over rising factorials of N: the product of (N - i) / (N + i) for i < k
        log = np.cumsum(np.log1p(-2 * (k - 1) / (n + k - 1)))
        term = (2 * k - 1) * np.exp(log - clock * k * (k - 1) / 2)
        mean = math.fsum(term)
        return mean, math.fsum(term * k * (k - 1)) + mean - mean**2

    def _counts(self, clock: float, k: Float) -> Float:
        return self._given_number(self._number_pmf(clock), k, 1)

    def pairs(self, t: float, sizes: Float) -> Float:
        """Means of ``n_s (n_s - 1)`` for given sizes: with `counts` they give the variances.

        Parameters
        ----------
        t : float
        sizes : ndarray
        """
        return self._given_number(self.number_pmf(t), np.asarray(sizes, float), 2)

    def _given_number(self, number: Float, sizes: Float, order: int) -> Float:
        """Factorial moment of the number of clusters of each size, given the law of the number."""
        n = self.particles
        present = np.flatnonzero(number > 0)
        present = present[present >= order]
        falling = present if order == 1 else present * (present - 1.0)
        weight = number[present] * falling
        log_all = binomial(n - 1, present - 1)
        out = np.empty(sizes.shape)
        for index, s in np.ndenumerate(sizes):
            rest = n - order * s  # to be shared by the other clusters, if there are any
            if rest == 0:
                ways = (present == order) * 1.0
            else:
                ways = np.exp(binomial(rest - 1, present - 1 - order) - log_all)
            out[index] = weight @ ways
        return out

    def second_moment(self, t: float) -> float:
        """See `FiniteLaw.second_moment`: ``N - (N - 1) exp(-t / V)``."""
        return 1 - (self.particles - 1) * math.expm1(-self._clock(t))

    def _log_probability(self, clock: float, sizes: Float) -> float:
        k = sizes.size
        number = self._number_pmf(clock)[k]
        if number == 0:
            return -math.inf
        ways = math.lgamma(k + 1) - log_repeats(sizes)
        return math.log(number) + ways - float(binomial(self.particles - 1, k - 1))
