"""Intervals from few samples that know skewness and kurtosis, on plain arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[np.float64]

#: few samples rarely hold the tail that the law has: by what share more than their skewness and
#: excess kurtosis is allowed for, and what kurtosis for the square of the skewness; it fades
#: with the samples, down to a half at this many
_MORE, _FROM_SKEWNESS, _FADES = 0.5, 6.0, 100.0
#: the skewness is at most this many coefficients of variation: moments of size distributions have
#: 2 to 15
_TAIL = 10.0
#: the excess kurtosis is at most this many squared coefficients of variation: moments have 100 to
#: 800
_FAR = 800.0
#: relative standard error of a positive mean beyond which its law cannot be judged
_VAGUE = 0.2
#: fewest samples of which a skewness can be taken, and of which a kurtosis
_SKEWED, _PEAKED = 3, 4
#: clusters in all replicas together up to which their number counts as one of Poisson's law
RARE = 30.0


@dataclass(frozen=True)
class Sample:
    """What intervals need to know of samples, elementwise.

    Attributes
    ----------
    count, mean, variance : ndarray
        The variance of a sample, unbiased; NaN for fewer than two.
    skewness, excess : ndarray
        Skewness and excess kurtosis with the corrections that are unbiased for a normal law; zero
        where there are too few samples, or no spread.
    """

    count: Float
    mean: Float
    variance: Float
    skewness: Float
    excess: Float

    @classmethod
    def of(cls, values: ArrayLike) -> Sample:
        """Take it from samples along the first axis; NaN is left out."""
        values = np.asarray(values, float)
        seen = np.isfinite(values)
        count = seen.sum(axis=0).astype(float)
        # around the first observation, so that equal values have a spread of exactly zero
        first = np.take_along_axis(values, np.argmax(seen, axis=0)[None], axis=0)
        shifted = np.where(seen, values - first, 0.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = shifted.sum(axis=0) / count
            away = np.where(seen, shifted - mean, 0.0)
            square = away * away
        sums = square.sum(axis=0), (square * away).sum(axis=0), (square * square).sum(axis=0)
        return cls.from_sums(count, mean + first[0], *sums)

    @classmethod
    def from_sums(
        cls, count: ArrayLike, mean: Float, second: Float, third: Float, fourth: Float
    ) -> Sample:
        """Take it from the sums of the powers 2 to 4 of the deviations from the mean."""
        n = np.asarray(count, float)
        with np.errstate(all="ignore"):
            variance = np.where(n > 1, second / (n - 1.0), np.nan)
            spread = second > 0.0
            g1 = np.sqrt(n) * third / second**1.5 * np.sqrt(n * (n - 1.0)) / (n - 2.0)
            g2 = n * fourth / second**2 - 3.0
            g2 = (n - 1.0) / ((n - 2.0) * (n - 3.0)) * ((n + 1.0) * g2 + 6.0)
        return cls(
            np.broadcast_to(n, np.shape(mean)),
            np.asarray(mean, float),
            np.asarray(variance, float),
            np.where(spread & (n >= _SKEWED), g1, 0.0),
            np.where(spread & (n >= _PEAKED), g2, 0.0),
        )

    @property
    def error(self) -> Float:
        """Standard error of the mean."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(np.sqrt(self.variance / self.count))

    @property
    def variation(self) -> Float:
        """Coefficient of variation."""
        with np.errstate(all="ignore"):
            return np.asarray(np.sqrt(self.variance) / np.abs(self.mean))

    @property
    def few(self) -> Float:
        """One for few samples, zero for many: how much of an allowance for unseen tails is due."""
        return np.asarray(_FADES / (_FADES + self.count))


def quantile(count: ArrayLike, level: float = 0.95) -> Float:
    """Half width of the two-sided Student interval in standard errors, for `count` samples.

    NaN for fewer than two.
    """
    from scipy import stats

    count = np.asarray(count, float)
    dof = np.where(count > 1, count - 1, np.nan)
    return np.asarray(stats.t.ppf(0.5 + level / 2, dof), float)


def _tail(sample: Sample) -> tuple[Float, Float]:
    """Return ``a = g / (3 sqrt n)`` of Hall's transformation and ``b = a / 2``, see `skewed`."""
    with np.errstate(all="ignore"):
        most = np.nan_to_num(_TAIL * sample.variation, nan=0.0, posinf=np.inf)
        a = np.clip((1.0 + _MORE * sample.few) * sample.skewness, -most, most)
        a = a / (3.0 * np.sqrt(sample.count))
    return np.nan_to_num(a), np.nan_to_num(a) / 2.0


def skewed(t: ArrayLike, sample: Sample) -> Float:
    """Turn ``t = (mean - value) / error`` into what Student's law holds for, if the law is skew.

    Hall's transformation is ``t + a t**2 + a**2 t**3 / 3 + b`` with ``a = g / (3 sqrt n)`` and
    ``b = g / (6 sqrt n)`` for the skewness g. That of n samples is taken up to 1.5 times, as few
    hold the tail, and at most ten coefficients of variation. Whichever is nearer to zero counts, t
    or this: where the skewness is chance, t is right.

    References
    ----------
    P. Hall, J. R. Stat. Soc. B 54, 221 (1992), doi:10.1111/j.2517-6161.1992.tb01876.x, equation
    for ``g_1``; N. J. Johnson, J. Am. Stat. Assoc. 73, 536 (1978),
    doi:10.1080/01621459.1978.10480051.
    """
    t = np.asarray(t, float)
    a, b = _tail(sample)
    with np.errstate(all="ignore"):
        bent = t + a * t**2 + a**2 * t**3 / 3.0 + b
    return np.asarray(np.copysign(np.fmin(np.abs(t), np.abs(bent)), t), float)


def mean_interval(sample: Sample, level: float = 0.95) -> tuple[Float, Float]:
    """Return the interval of a mean: all values that `skewed` does not put beyond Student's t.

    Notes
    -----
    The coverage is measured in ``verification/coverage``: 93 to 97 % from 8 samples on, unless
    `vague`.
    """
    error, q = sample.error, quantile(sample.count, level)
    a, b = _tail(sample)

    def inverse(y: Float) -> Float:
        with np.errstate(all="ignore"):
            bent = (np.cbrt(1.0 + 3.0 * a * (y - b)) - 1.0) / a
        return np.asarray(np.where(np.abs(a) < 1e-6, y, bent), float)

    with np.errstate(invalid="ignore"):
        lower = sample.mean - np.fmax(q, inverse(q)) * error
        upper = sample.mean - np.fmin(-q, inverse(-q)) * error
    return lower, upper


def vague(sample: Sample) -> NDArray[np.bool_]:
    """Say where no law can be judged, and so no interval promised.

    With two or three samples, and where the standard error of the mean is above a fifth of it:
    a positive quantity that scatters so much is skewed beyond what its samples show.
    """
    with np.errstate(invalid="ignore"):
        scatter = sample.error > 0.0
        few = sample.count < _PEAKED
        return np.asarray(scatter & (few | (sample.error > _VAGUE * np.abs(sample.mean))))


def count_interval(total: ArrayLike, level: float = 0.95) -> tuple[Float, Float]:
    """Return the interval of the expectation of a Poisson count: Jeffreys', shortest on average.

    References
    ----------
    L. D. Brown, T. T. Cai, A. DasGupta, Statistica Sinica 13, 19 (2003), section 3: the quantiles
    of the gamma law of shape ``total + 1/2``, from zero if nothing was counted.
    """
    from scipy import stats

    total = np.asarray(total, float)
    outside = (1.0 - level) / 2.0
    lower = np.where(total > 0.0, stats.gamma.ppf(outside, total + 0.5), 0.0)
    return lower, np.asarray(stats.gamma.isf(outside, total + 0.5), float)


def freedom(sample: Sample) -> Float:
    """Degrees of freedom of the chi-square law that a variance follows, from its kurtosis.

    ``2 n / (g + 2 n / (n - 1))`` gives the law the variance of the sample variance for an excess
    kurtosis g. Few samples hold too little of a tail, so g is the larger of up to 1.5 times that of
    the samples and up to 6 times the square of their skewness, less what that is by chance; at
    least zero and at most 800 squared coefficients of variation.

    References
    ----------
    L. H. Shoemaker, Am. Stat. 57, 103 (2003), doi:10.1198/0003130031441; D. G. Bonett, Comput.
    Stat. Data Anal. 50, 775 (2006), doi:10.1016/j.csda.2004.10.003.
    """
    n = sample.count
    with np.errstate(all="ignore"):
        chance = 6.0 * n * (n - 1.0) / ((n - 2.0) * (n + 1.0) * (n + 3.0))
        skew = np.where(n >= _SKEWED, sample.skewness**2 - chance, 0.0)
        g = np.maximum((1.0 + _MORE * sample.few) * sample.excess, 0.0)
        g = np.maximum(g, _FROM_SKEWNESS * sample.few * skew)
        g = np.fmin(g, _FAR * sample.variation**2)
        return np.asarray(2.0 * n / (g + 2.0 * n / (n - 1.0)), float)


def variance_interval(sample: Sample, level: float = 0.95) -> tuple[Float, Float]:
    """Return the interval of the variance of one sample; see `freedom`."""
    from scipy import stats

    nu, outside = freedom(sample), (1.0 - level) / 2.0
    with np.errstate(all="ignore"):
        lower = nu * sample.variance / stats.chi2.isf(outside, nu)
        upper = nu * sample.variance / stats.chi2.ppf(outside, nu)
    return np.asarray(lower, float), np.asarray(upper, float)


def variance_vague(sample: Sample) -> NDArray[np.bool_]:
    """Say where the kurtosis is too large for so few samples to promise an interval."""
    with np.errstate(invalid="ignore"):
        few = sample.count <= _PEAKED
        return np.asarray((sample.variance > 0.0) & (few | (freedom(sample) < _least(sample))))


def _least(sample: Sample) -> Float:
    return np.minimum(0.5 * (sample.count - 1.0), 10.0)


def enlarged(sample: Sample, wanted: ArrayLike, sure: float = 0.8) -> Float:
    """Estimate how many samples a mean needs for a half width `wanted`.

    The variance is taken at the end of its one-sided interval, so that they are enough with the
    probability `sure`; skewness and Student's law as they will be with so many.
    """
    from scipy import stats

    nu, wanted = freedom(sample), np.asarray(wanted, float)
    with np.errstate(all="ignore"):
        variance = sample.variance * np.fmax(nu / stats.chi2.ppf(1.0 - sure, nu), 1.0)
        count = np.asarray(4.0 * variance / np.square(wanted))
        for _ in range(8):  # each halves what is missing, and more
            then = replace(sample, count=np.fmax(count, _PEAKED), variance=variance)
            count = then.count * (half_width(then) / wanted) ** 2
    return np.asarray(count, float)


def half_width(sample: Sample) -> Float:
    """Return the length of the longer side of the 95 % interval of a mean."""
    lower, upper = mean_interval(sample)
    return np.fmax(upper - sample.mean, sample.mean - lower)
