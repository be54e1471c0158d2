"""Densities that rest on few clusters: their number follows Poisson's law, not the normal one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy import special, stats

from smolux.confidence import RARE, count_interval

from .reference import is_deterministic

Float = NDArray[np.float64]

#: clusters from which on an interval is promised
_TOLD = 2.5
#: probability of a larger scatter below which clusters are taken to come in clumps
_CLUMPED = 0.01


@dataclass(frozen=True)
class Rare:
    """Counts over all replicas together, elementwise over time and size or bin.

    Attributes
    ----------
    few : ndarray of bool
        Where at least one and at most 30 clusters were counted.
    total, exposure : ndarray
        What was counted, in clumps; the volume in which, so that their ratio is the density.
    """

    few: NDArray[np.bool_]
    total: Float
    exposure: Float

    @classmethod
    def of(cls, ds: xr.Dataset, values: Float) -> Rare | None:
        """Count the clusters of densities over (replica, time, ...); None if they have weights."""
        if is_deterministic(ds) or ds.attrs.get("weighting", "number") != "number":
            return None
        volume = ds["volume"].transpose("replica", "time").values
        return cls.counted(values, volume.reshape(*volume.shape, *[1] * (values.ndim - 2)))

    @classmethod
    def counted(cls, values: Float, volume: Float) -> Rare:
        """Count the clusters of densities in replicas, along the first axis, of these volumes."""
        seen = np.isfinite(values)
        counts = np.where(seen, values * volume, 0.0)
        total = counts.sum(axis=0)
        exposure = np.where(seen, volume, 0.0).sum(axis=0)
        clump = _clump(counts, seen, total)
        few = (total > 0.5) & (total <= RARE * clump)
        with np.errstate(invalid="ignore", divide="ignore"):
            return cls(few, total / clump, exposure / clump)

    @property
    def doubtful(self) -> NDArray[np.bool_]:
        """Where a size was seen once or twice only: other times it would not have been seen."""
        return self.few & (self.total < _TOLD)

    def interval(self) -> tuple[Float, Float]:
        """Return the 95 % interval of the density."""
        lower, upper = count_interval(self.total)
        with np.errstate(invalid="ignore", divide="ignore"):
            return lower / self.exposure, upper / self.exposure

    def error(self) -> Float:
        """Return the standard error of the density."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(np.sqrt(self.total) / self.exposure, float)

    def sigmas(self, exact: ArrayLike) -> Float:
        """Return the normal deviate for which `exact` is at the edge of an interval as above."""
        with np.errstate(invalid="ignore"):
            above = special.gammaincc(self.total + 0.5, np.asarray(exact) * self.exposure)
        return np.asarray(special.ndtri(np.clip(above, 1e-300, 1.0 - 1e-16)), float)


def _clump(counts: Float, seen: NDArray[np.bool_], total: Float) -> Float:
    """Clusters that come together, such as copies of one after a doubling: the dispersion.

    One, unless the scatter between the replicas is too large for Poisson's law.
    """
    replicas = np.maximum(seen.sum(axis=0), 1)
    mean = total / replicas
    square = np.where(seen, (counts - mean) ** 2, 0.0).sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        clumped = stats.chi2.sf(square / mean, replicas - 1) < _CLUMPED
        return np.asarray(np.where(clumped, square / mean / (replicas - 1), 1.0), float)
