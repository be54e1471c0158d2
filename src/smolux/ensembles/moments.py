"""Mean and central moments of samples that are seen once, part by part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from smolux.confidence import Sample, freedom, mean_interval, variance_interval

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Moments:
    """Number of samples, their mean, and the sums of the powers 2 to 4 of their deviations from it.

    Moments of two parts add up to those of the whole, so that no sample needs to be kept.

    Attributes
    ----------
    count : int
    mean, second, third, fourth : ndarray
        Of any one shape.

    References
    ----------
    P. Pébay, Sandia Report SAND2008-6212 (2008), doi:10.2172/1028931, equations 2.1 to 2.3.
    """

    count: int
    mean: Float
    second: Float
    third: Float
    fourth: Float

    @classmethod
    def of(cls, values: Float) -> Moments:
        """Take the moments of samples along the first axis."""
        # around the first one, so that equal samples have a variance of exactly zero
        shifted = values - values[0]
        mean = shifted.mean(axis=0)
        away = shifted - mean
        square = away * away
        return cls(
            len(values),
            values[0] + mean,
            square.sum(axis=0),
            (square * away).sum(axis=0),
            (square * square).sum(axis=0),
        )

    def __add__(self, other: Moments) -> Moments:
        """Take both parts together."""
        a, b = float(self.count), float(other.count)
        n = a + b
        step = (other.mean - self.mean) / n
        s2, t2 = self.second, other.second
        s3, t3 = self.third, other.third
        return Moments(
            self.count + other.count,
            self.mean + b * step,
            s2 + t2 + step**2 * (a * b * n),
            s3 + t3 + step**3 * (a * b * (a - b) * n) + 3.0 * step * (a * t2 - b * s2),
            self.fourth
            + other.fourth
            + step**4 * (a * b * (a * a - a * b + b * b) * n)
            + 6.0 * step**2 * (a * a * t2 + b * b * s2)
            + 4.0 * step * (a * t3 - b * s3),
        )

    @property
    def variance(self) -> Float:
        """Variance of a sample, unbiased; NaN for a single one."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(self.second / np.float64(self.count - 1))

    @property
    def error(self) -> Float:
        """Standard error of the mean."""
        return np.asarray(np.sqrt(self.variance / self.count))

    @property
    def relative_error(self) -> Float:
        """Standard error of the variance, relative to it.

        That of the chi-square law that the variance follows, see `smolux.confidence.freedom`. NaN
        where all samples are equal.
        """
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(self.second > 0.0, np.sqrt(2.0 / freedom(self.sample)), np.nan)

    @property
    def sample(self) -> Sample:
        """What intervals need to know."""
        return Sample.from_sums(self.count, self.mean, self.second, self.third, self.fourth)

    def interval(self) -> tuple[Float, Float]:
        """Return the 95 % interval of the mean, see `smolux.confidence.mean_interval`."""
        lower, upper = mean_interval(self.sample)
        # a tail that is not known does not widen what has no spread at all
        certain = self.second == 0.0
        return np.where(certain, self.mean, lower), np.where(certain, self.mean, upper)

    def variance_interval(self) -> tuple[Float, Float]:
        """Return the 95 % interval of the variance, see `smolux.confidence.freedom`."""
        return variance_interval(self.sample)
