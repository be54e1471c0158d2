"""What the closed finite laws have in common, and how to get one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.errors import InputError
from smolux.exact.base import check_sizes

if TYPE_CHECKING:
    pass

Float = NDArray[np.float64]


def binomial(n: ArrayLike, k: ArrayLike) -> Float:
    """Logarithm of the binomial coefficient; minus infinity where it is zero."""
    import scipy.special

    n, k = np.broadcast_arrays(np.asarray(n, float), np.asarray(k, float))
    inside = (k >= 0) & (k <= n)
    a, b = np.where(inside, n, 0.0), np.where(inside, k, 0.0)
    gammaln = scipy.special.gammaln
    return np.where(inside, gammaln(a + 1) - gammaln(b + 1) - gammaln(a - b + 1), -np.inf)


@dataclass(frozen=True)
class FiniteLaw:
    """The law of N monomers that merge pair by pair in a volume V.

    Parameters
    ----------
    particles : int
        Number N of monomers at the start.
    volume : float, optional
        V; as large as N if left out (unit density).
    scale : float
        Prefactor of the kernel.

    Attributes
    ----------
    name : str
        The kernel.
    reference : str
        Where the law comes from.
    """

    particles: int
    volume: float | None = None
    scale: float = 1.0
    name: ClassVar[str]
    reference: ClassVar[str]

    def __post_init__(self) -> None:
        problems = []
        if not (isinstance(self.particles, (int, np.integer)) and self.particles >= 1):
            problems.append(f"particles = {self.particles!r}: must be a whole number, at least 1")
        for key, value in (("volume", self.volume), ("scale", self.scale)):
            if value is not None and not (np.isfinite(value) and value > 0):
                problems.append(f"{key} = {value!r}: must be a positive finite number")
        if problems:
            raise InputError(problems)

    def _clock(self, t: float) -> float:
        """Time in units of the rate of one pair: ``scale t / V``."""
        if not t >= 0:
            raise InputError(f"t = {t!r}: must be zero or more")
        return self.scale * t / (self.particles if self.volume is None else self.volume)

    def number_mean(self, t: float) -> float:
        """Mean number of clusters."""
        return self.number_moments(t)[0]

    def number_variance(self, t: float) -> float:
        """Variance of the number of clusters, and so of the number of collisions."""
        return self.number_moments(t)[1]

    def number_moments(self, t: float) -> tuple[float, float]:
        """Mean and variance of the number of clusters."""
        raise NotImplementedError

    def number_pmf(self, t: float) -> Float:
        """Probabilities of 0, 1, ..., N clusters.

        Parameters
        ----------
        t : float

        Returns
        -------
        ndarray of shape (N + 1,)
        """
        raise NotImplementedError

    def counts(self, t: float, sizes: ArrayLike) -> Float:
        """Mean numbers of clusters of given sizes.

        Parameters
        ----------
        t : float
        sizes : array_like of int
            Any shape.
        """
        k = check_sizes(sizes)
        out = np.zeros(k.shape)
        inside = k <= self.particles
        out[inside] = self._counts(self._clock(t), k[inside])
        return out

    def _counts(self, clock: float, k: Float) -> Float:
        raise NotImplementedError

    def second_moment(self, t: float) -> float:
        """Mean of ``sum s**2 / N`` over the clusters: the mean size of the cluster of a monomer."""
        s = np.arange(1, self.particles + 1)
        return float(self.counts(t, s) @ (s.astype(float) ** 2)) / self.particles

    def partition_probability(self, t: float, partition: Sequence[int]) -> float:
        """Probability that the sizes are exactly those of `partition`.

        Parameters
        ----------
        t : float
        partition : sequence of int
            Sizes of all clusters, in any order, with the sum N.
        """
        sizes = np.asarray(partition, float)
        if np.any(sizes < 1) or sizes.sum() != self.particles:
            raise InputError(
                f"partition = {partition!r}: must be whole numbers with the sum {self.particles}"
            )
        log = self._log_probability(self._clock(t), sizes)
        return math.exp(log) if log > -math.inf else 0.0

    def _log_probability(self, clock: float, sizes: Float) -> float:
        raise NotImplementedError

    def partition_pmf(self, t: float) -> tuple[list[tuple[int, ...]], Float]:
        """All partitions of N and their probabilities, for small N.

        Returns
        -------
        partitions : list of tuple of int
            In the order of `smolux.exact.finite.partitions`.
        probabilities : ndarray
        """
        from .chain import partitions

        states = partitions(self.particles)
        return states, np.array([self.partition_probability(t, s) for s in states])


def log_repeats(sizes: Float) -> float:
    """Logarithm of the product of ``n_s!`` over the numbers ``n_s`` of equal sizes."""
    return sum(math.lgamma(c + 1) for c in np.unique(sizes, return_counts=True)[1])
