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
    orders : ndarray of shape (O,)
        Of the moments.
    processes : tuple of str
    bin_edges : ndarray of shape (B + 1,)
        A bin holds the sizes ``bin_edges[b] <= k < bin_edges[b + 1]``, all above the L that are
        counted one by one.
    values : dict of str to ndarray
        Observables by their names, of the shapes that `smolux.observables` says; those that are
        not known are left out.
    distribution : list of list of (sizes, counts), optional
        The whole population of each replica at each time.
    joint : list of list of ndarray, optional
        How many monomers of each kind the particles of these populations have.
    components : tuple of str
        The kinds of monomers, if particles carry a composition.
    """

    times: Float
    orders: Float
    processes: tuple[str, ...]
    bin_edges: Float
    values: dict[str, Float]
    distribution: list[list[tuple[Int, Int]]] | None = None
    joint: list[list[Int]] | None = None
    components: tuple[str, ...] = ()
    #: further attributes of the result: method, seed, wall time, ...
    attributes: dict[str, Any] = field(default_factory=dict)
    #: warnings and fallbacks, in the order they came
    warnings: list[str] = field(default_factory=list)
