"""What appears in place of particles, on average, as data: each grid makes its terms of it.

The rate equations, on whatever grid of sizes, need no more of a process than how often it takes
place and which of these it leaves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from smolux.kernels.base import Kernel

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Nothing:
    """The particle leaves the system."""


@dataclass(frozen=True)
class Merged:
    """Two particles become one: ``(i) + (j) -> (i + j)``."""


@dataclass(frozen=True)
class Detached:
    """A piece comes off: ``(k) -> (k - size) + (size)``.

    Parameters
    ----------
    size : int
    """

    size: int = 1


@dataclass(frozen=True)
class Split:
    """A particle falls into two: ``(i + j) -> (i) + (j)`` at the rate ``law(i, j)``.

    Parameters
    ----------
    law : Kernel
        Of ordered pairs, so that a particle of size k does so ``sum_i law(i, k - i) / 2`` times a
        unit of time.
    """

    law: Kernel


@dataclass(frozen=True)
class Debris:
    """Fragments whose mean numbers depend on the mass alone that falls apart.

    Parameters
    ----------
    shares : tuple of float
        Of a large mass, what share of the fragments has the size 1, 2, ...
    numbers : callable, optional
        ``numbers(largest)``: mean numbers of the fragments of the masses ``1 .. largest``, of shape
        (largest, K). If left out, they are those of a large mass at every mass.
    """

    shares: tuple[float, ...]
    numbers: Callable[[int], Float] | None = None

    @property
    def by_mass(self) -> Float:
        """Fragments of each size that a unit of a large mass makes."""
        shares = np.array(self.shares)
        return shares / float(shares @ np.arange(1.0, len(shares) + 1.0))


Daughters = Nothing | Merged | Detached | Split | Debris
