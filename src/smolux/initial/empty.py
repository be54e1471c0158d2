"""No particles at the start."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .base import Float, Initial, Int


@dataclass(frozen=True)
class Empty(Initial):
    """No particles at all; see `empty`."""

    name: ClassVar[str] = "empty"

    @property
    def total(self) -> float:
        return 0.0

    @property
    def largest(self) -> int:
        return 1

    def cumulative(self, sizes: Float) -> Float:
        return np.ones(np.shape(sizes))

    def quantile(self, share: Float) -> Int:
        return np.ones(np.shape(share), np.int64)

    def weighted(self, weights: Callable[[Float], Float]) -> Initial:
        return self

    def densities(self, largest: int) -> Float:
        return np.zeros(largest)

    def sample(self, particles: int, u: float) -> tuple[Int, Int]:
        return np.ones(1, np.int64), np.zeros(1, np.int64)


def empty() -> Empty:
    """No particles at the start: for systems with a source.

    The volume of a simulation is then chosen so that the sources bring in as many `particles` in a
    unit of time, at their mean rates up to the last output time; it is never doubled.
    """
    return Empty()
