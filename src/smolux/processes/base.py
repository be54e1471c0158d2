"""What every process has: how often an encounter ends in it, and what then appears."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..timefunction import TimeFunction

Float = NDArray[np.float64]


@dataclass(frozen=True)
class PairProcess:
    """What an encounter of two particles leads to, at ``factor(t)`` times the rate of the kernel.

    Both particles vanish; `outcome` names what appears in their place.

    Attributes
    ----------
    name : str
        The name in case files and results.
    """

    name: ClassVar[str]
    #: the most (size, count) entries one outcome writes
    entries: ClassVar[int] = 1

    #: ``outcome(i, j, sizes, counts) -> int``: plain Python that Numba can compile. Writes what
    #: appears into the two int64 arrays and returns the number of entries written.
    outcome: ClassVar[Callable[..., Any]]

    @property
    def factor(self) -> TimeFunction:
        """The rate as a multiple of the kernel, a function of time."""
        return TimeFunction.of(1.0)

    def rhs(
        self, t: float, sizes: Float, n: Float, loss: Float, gain: Callable[[], Float]
    ) -> Float:
        """Contribution to ``dn/dt`` in the rate equations.

        Parameters
        ----------
        t : float
            Time.
        sizes, n : ndarray of shape (M,)
            Sizes ``1 .. M`` and their densities.
        loss : ndarray of shape (M,)
            ``n_k sum_j K(k, j) n_j``.
        gain : callable
            Returns ``sum_{i+j=k} K(i, j) n_i n_j / 2`` for ``k = 1 .. M``; computed only if called.
        """
        raise NotImplementedError
