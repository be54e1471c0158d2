"""What a computation leaves behind at its output times: plain arrays, whatever the method."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass
class Records:
    """Observations of R replicas at T times; times not reached are NaN.

    Attributes
    ----------
    times : ndarray of shape (T,)
    number_density, largest, particles, collisions, volume : ndarray of shape (R, T)
        Clusters per unit volume, the largest size present, simulated particles, collisions so far,
        volume simulated.
    moment : ndarray of shape (R, T, O)
        ``M_p = sum_k k**p n_k`` for each of `orders`.
    n : ndarray of shape (R, T, L)
        Number densities of the sizes ``1 .. L``.
    n_bin : ndarray of shape (R, T, B)
        Number densities summed over the sizes ``bin_edges[b] <= k < bin_edges[b + 1]``, all above
        L.
    events : ndarray of shape (R, T, P)
        Collisions so far that ended in each of `processes`.
    attempts : ndarray of shape (R, P), optional
        Candidates for these up to the end, whether anything came of them or not.
    extinction_time : ndarray of shape (R,)
        When all particles had become one cluster; NaN if they had not.
    balance : tuple of ndarray of shape (R, T), optional
        Of systems that are open: mass in the volume simulated, mass that came in and mass that
        left, both as if the volume had always been that of now.
    distribution : list of list of (sizes, counts), optional
        The whole population of each replica at each time.
    """

    times: Float
    orders: Float
    processes: tuple[str, ...]
    bin_edges: Float
    number_density: Float
    largest: Float
    particles: Float
    collisions: Float
    volume: Float
    moment: Float
    n: Float
    n_bin: Float
    events: Float
    extinction_time: Float
    attempts: Float | None = None
    balance: tuple[Float, Float, Float] | None = None
    distribution: list[list[tuple[Int, Int]]] | None = None
    #: further attributes of the result: method, seed, wall time, ...
    attributes: dict[str, Any] = field(default_factory=dict)
    #: warnings and fallbacks, in the order they came
    warnings: list[str] = field(default_factory=list)
