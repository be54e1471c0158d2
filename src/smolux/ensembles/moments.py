"""Mean and central moments of samples that are seen once, part by part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from smolux.analysis.statistics import quantile

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

        From ``Var(s^2) = (mu_4 - (n - 3) / (n - 1) sigma^4) / n``, whatever the law of the samples.
        NaN where all samples are equal.
        """
        n = np.float64(self.count)
        with np.errstate(invalid="ignore", divide="ignore"):
            excess = self.fourth / n / self.variance**2 - (n - 3.0) / (n - 1.0)
            return np.asarray(np.sqrt(np.maximum(excess, 0.0) / n))

    def interval(self) -> tuple[Float, Float]:
        """Return the 95 % interval of the mean (Student)."""
        half = quantile(self.count) * self.error
        return self.mean - half, self.mean + half

    def variance_interval(self) -> tuple[Float, Float]:
        """Return the 95 % interval of the variance; symmetric in its logarithm, above zero."""
        ratio = np.exp(quantile(self.count) * self.relative_error)
        return self.variance / ratio, self.variance * ratio
