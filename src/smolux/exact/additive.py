"""The additive kernel."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .base import Float, Solution
from .special import log_borel


def _exp(x: float) -> float:
    """Exponential that answers infinity where it overflows."""
    return math.exp(x) if x < 709 else math.inf


@dataclass(frozen=True)
class Additive(Solution):
    """Additive kernel ``K = scale (i + j)``, monomers at the start.

    ``n_k = exp(-t) (k x)**(k - 1) exp(-k x) / k!`` with ``x = 1 - exp(-t)``; ``M0 = exp(-t)``,
    ``M2 = exp(2 t)``, ``M3 = exp(3 t) (3 exp(t) - 2)``.

    References
    ----------
    A. M. Golovin, Dokl. Akad. Nauk SSSR 148, 1290 (1963); D. J. Aldous, Bernoulli 5, 3 (1999),
    doi:10.2307/3318611, table 2.
    """

    name: ClassVar[str] = "additive kernel"
    formula: ClassVar[str] = "K = scale (i + j)"
    reference: ClassVar[str] = "A. M. Golovin, Dokl. Akad. Nauk SSSR 148, 1290 (1963)"

    def _densities(self, t: float, k: Float) -> Float:
        if t == 0:
            return (k == 1).astype(float)
        if math.isinf(t):
            return np.zeros(k.shape)
        return np.exp(log_borel(k, -math.expm1(-t), math.exp(-t)) - t)

    def _moments(self, t: float) -> tuple[float, float, float, float]:
        return math.exp(-t), 1.0, _exp(2 * t), _exp(3 * t) * (3 * _exp(t) - 2)
