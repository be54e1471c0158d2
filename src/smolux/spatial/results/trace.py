"""What a method leaves behind: the log of what happened, and the state at the end."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Discs = NDArray[np.int32]

#: moments of the size distribution that series hold
ORDERS = (0.0, 1.0, 2.0, 3.0)


#: observations that are one number at each time
_OF_TIME = ("clusters", "largest", "mean_mass", "largest_mass", "kinetic_energy")


@dataclass
class Log:
    """Everything that happened, in the order of time.

    Attributes
    ----------
    time : ndarray of shape (E,)
    first : ndarray of int32, shape (E,)
        A disc of the cluster to which it happened.
    second : ndarray of int32, shape (E,)
        The disc it met, of another cluster: the two clusters are one from then on. Below zero:
        ``-1 - k`` says that the cluster was reflected along axis k, ``-1 - d - k`` that it fills
        the box along axis k and came to rest along it.
    more : ndarray of int64, shape (E,)
        How often it was reflected along that axis after this, at even intervals, in reflections
        that are counted here and have no entry of their own: an even number, mostly 0.
    until : ndarray of shape (E,)
        Time of the last of these.
    """

    time: Float
    first: Discs
    second: Discs
    more: Int
    until: Float

    @classmethod
    def of(cls, time: Float, first: Discs, second: Discs) -> Log:
        """Make a log in which each reflection has an entry."""
        return cls(time, first, second, np.zeros(len(time), np.int64), np.zeros(len(time)))

    @property
    def merges(self) -> NDArray[np.bool_]:
        """Which events are merges."""
        return self.second >= 0


@dataclass
class Series:
    """Observations at T times; those not reached are NaN.

    Attributes
    ----------
    time : ndarray of shape (T,)
    clusters, largest, mean_mass, largest_mass, kinetic_energy : ndarray of shape (T,)
        Number of clusters, discs in the largest one, masses, ``sum m v^2 / 2`` of the clusters.
    momentum : ndarray of shape (T, d)
    moment : ndarray of shape (T, O)
        ``sum_k k^p n_k`` over clusters of k discs, for each of `ORDERS`.
    n_bin : ndarray of shape (T, B)
        Clusters by number of discs, in the bins of `size_edges`.
    """

    time: Float
    clusters: Float
    largest: Float
    mean_mass: Float
    largest_mass: Float
    kinetic_energy: Float
    momentum: Float
    moment: Float
    n_bin: Float


@dataclass
class Trace:
    """What a run left behind.

    Attributes
    ----------
    time : float
        That was reached.
    position : ndarray of shape (N, d)
        At that time. Along periodic axes clusters are whole, and may reach out of the box.
    velocity : ndarray of shape (N, d)
    cluster : ndarray of int32, shape (N,)
        The least disc of the cluster of each disc.
    log : Log
    series : Series, optional
        Observations at the output times, by methods whose log does not determine the motion.
    stopped : str
        Why the run ended before its goal; empty if it did not.
    warnings : list of str
    attributes : dict
        Counters, settings of the method: they become attributes of the result.
    """

    time: float
    position: Float
    velocity: Float
    cluster: Discs
    log: Log
    series: Series | None = None
    stopped: str = ""
    warnings: list[str] = field(default_factory=list)
    attributes: dict[str, Any] = field(default_factory=dict)


def size_edges(discs: int) -> Int:
    """Edges of the bins of cluster sizes: one by one at first, then four to an octave."""
    steps = np.arange(int(4 * np.log2(max(discs, 1))) + 6)
    edges = np.unique(np.floor(2.0 ** (steps / 4)).astype(np.int64))
    return edges[: int(np.searchsorted(edges, discs, side="right")) + 1]


def empty_series(times: Float, discs: int, dimension: int) -> Series:
    """Return a series that is NaN at all times."""
    t, bins = len(times), len(size_edges(discs)) - 1
    return Series(
        time=np.asarray(times, float),
        **{name: np.full(t, np.nan) for name in _OF_TIME},
        momentum=np.full((t, dimension), np.nan),
        moment=np.full((t, len(ORDERS)), np.nan),
        n_bin=np.full((t, bins), np.nan),
    )


def observe(series: Series, k: int, sizes: Int, masses: Float, velocities: Float) -> None:
    """Write the observations of one time from the clusters present.

    Parameters
    ----------
    series : Series
    k : int
        Which time.
    sizes : ndarray of int, shape (C,)
        Discs of each cluster.
    masses : ndarray of shape (C,)
    velocities : ndarray of shape (C, d)
    """
    series.clusters[k] = len(sizes)
    series.largest[k] = sizes.max()
    series.mean_mass[k] = masses.mean()
    series.largest_mass[k] = masses.max()
    series.kinetic_energy[k] = 0.5 * np.sum(masses[:, None] * velocities**2)
    series.momentum[k] = masses @ velocities
    series.moment[k] = [np.sum(sizes.astype(float) ** p) for p in ORDERS]
    edges = size_edges(int(sizes.sum()))
    series.n_bin[k] = np.histogram(sizes, edges)[0]
