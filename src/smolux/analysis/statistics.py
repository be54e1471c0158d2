"""Means, intervals and deviations over independent replicas."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special, stats

from smolux.confidence import Sample, mean_interval, quantile, skewed, vague

__all__ = [
    "ROUNDING",
    "Sample",
    "deviation",
    "mean_interval",
    "normal_equivalent",
    "over_replicas",
    "quantile",
    "skewed",
    "vague",
    "welch",
]

Float = NDArray[np.float64]

#: relative differences below which two numbers count as the same: sums of doubles in another order
ROUNDING = 1e-12


def over_replicas(values: ArrayLike) -> tuple[Float, Float, Float]:
    """Count, mean and standard error of the mean over the first axis; NaN is left out.

    Parameters
    ----------
    values : array_like of shape (R, ...)
        Of independent replicas; NaN where a replica was not observed.

    Returns
    -------
    count, mean, error : ndarray of shape (...)
        The mean is NaN where nothing was observed, the standard error where fewer than two were.
    """
    sample = Sample.of(values)
    return sample.count, sample.mean, sample.error


def normal_equivalent(t: ArrayLike, dof: ArrayLike) -> Float:
    """Turn a Student-t statistic into the standard normal deviate of the same tail probability.

    With eight replicas ``t = 3`` has the probability of 2.3 standard deviations, not 3.

    Parameters
    ----------
    t, dof : array_like
        Statistic and degrees of freedom, broadcast against each other; infinite degrees of freedom
        leave the statistic as it is, none give NaN.

    Returns
    -------
    ndarray
    """
    t, dof = np.broadcast_arrays(np.asarray(t, float), np.asarray(dof, float))
    with np.errstate(all="ignore"):
        tail = stats.t.sf(np.abs(t), np.where(dof > 0, dof, np.nan))
        # where the probability underflows, the last one that can be told from zero
        z = -special.ndtri(np.maximum(tail, 1e-300))
    return np.asarray(np.where(np.isposinf(dof), t, np.copysign(z, t)), float)


def deviation(
    difference: ArrayLike,
    error: ArrayLike,
    dof: ArrayLike,
    magnitude: ArrayLike,
    certain: ArrayLike = np.inf,
    sample: Sample | None = None,
) -> Float:
    """Deviation in standard deviations of the normal law; NaN where the error is not known.

    Parameters
    ----------
    difference, error, dof : array_like
        Of two values, its standard error and the degrees of freedom of that.
    magnitude : array_like
        Of the values: a difference that is only rounding is none.
    certain : array_like
        Replicas without any spread say nothing about the error, so the answer is NaN; but a
        relative difference above `certain` no chance explains, and the answer is infinite.
    sample : Sample, optional
        The replicas, if their mean is compared with a number: then their skewness counts, see
        `smolux.confidence.skewed`.

    Returns
    -------
    ndarray
    """
    difference, error, dof, magnitude, certain = np.broadcast_arrays(
        *(np.asarray(x, float) for x in (difference, error, dof, magnitude, certain))
    )
    with np.errstate(all="ignore"):
        t = difference / error
        z = normal_equivalent(t if sample is None else skewed(t, sample), dof)
    size, scale = np.abs(difference), np.abs(magnitude)
    with np.errstate(invalid="ignore"):
        beyond = np.where(size > certain * scale, np.copysign(np.inf, difference), np.nan)
    z = np.where(error <= ROUNDING * scale, beyond, z)
    return np.where(np.isfinite(error) & (size <= ROUNDING * scale), 0.0, z)


def welch(error_a: ArrayLike, count_a: ArrayLike, error_b: ArrayLike, count_b: ArrayLike) -> Float:
    """Degrees of freedom of the difference of two means with unequal variances.

    An exact value has the error zero and any count.

    References
    ----------
    B. L. Welch, Biometrika 34, 28 (1947), doi:10.1093/biomet/34.1-2.28.
    """
    a, b = np.asarray(error_a, float) ** 2, np.asarray(error_b, float) ** 2
    with np.errstate(all="ignore"):
        part_a = np.where(a > 0, a**2 / (np.asarray(count_a, float) - 1), 0.0)
        part_b = np.where(b > 0, b**2 / (np.asarray(count_b, float) - 1), 0.0)
        return np.asarray((a + b) ** 2 / (part_a + part_b), float)
