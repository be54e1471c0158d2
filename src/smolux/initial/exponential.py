"""Exponential law of sizes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from smolux.errors import Problem

from .base import Float, Initial, Int, as_number, check_positive, is_above, refuse


@dataclass(frozen=True)
class Exponential(Initial):
    """Geometric law ``n_k ~ exp(-k / c)`` on the whole sizes; see `exponential`."""

    mean: float
    density: float = 1.0
    name: ClassVar[str] = "exponential"

    def __post_init__(self) -> None:
        problems: list[str] = []
        check_positive(problems, density=self.density)
        if not (is_above(0.0, self.mean) and self.mean >= 1):
            problems.append(
                Problem("mean", "the mean size must be a number of at least 1", self.mean)
            )
        refuse(problems, self, 0.0 if problems else 37.0 * self.mean)

    @property
    def total(self) -> float:
        return self.density

    @property
    def _log_ratio(self) -> float:
        return float(np.log1p(-1.0 / self.mean)) if self.mean > 1 else -np.inf

    def cumulative(self, sizes: Float) -> Float:
        sizes = np.floor(np.asarray(sizes, float))
        if self.mean == 1:
            return (sizes >= 1).astype(float)
        return -np.expm1(np.maximum(sizes, 0) * self._log_ratio)

    def densities(self, largest: int) -> Float:
        """See `Initial.densities`; exact far into the tail."""
        if self.mean == 1:
            return self.density * (np.arange(1, largest + 1) == 1)
        return self.density / self.mean * np.exp(np.arange(largest) * self._log_ratio)

    def quantile(self, share: Float) -> Int:
        if self.mean == 1:
            return np.ones(np.shape(share), np.int64)
        return np.floor(np.log1p(-np.asarray(share)) / self._log_ratio).astype(np.int64) + 1


def exponential(mean: float, density: float = 1.0) -> Exponential:
    """Sizes exponentially (on whole numbers: geometrically) distributed.

    Parameters
    ----------
    mean : float
        Mean size, at least 1.
    density : float
        Particles per unit volume.
    """
    return Exponential(as_number(mean), as_number(density))
