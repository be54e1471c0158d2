"""The constant kernel."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .base import Float, Solution


@dataclass(frozen=True)
class Constant(Solution):
    """Constant kernel, monomers at the start: sizes are geometrically distributed.

    ``n_k = (2 / (t + 2))**2 (t / (t + 2))**(k - 1)``, ``M0 = 2 / (t + 2)``, ``M2 = 1 + t``.

    References
    ----------
    M. v. Smoluchowski, Z. Phys. Chem. 92, 129 (1917), doi:10.1515/zpch-1918-9209.
    """

    name: ClassVar[str] = "constant kernel"
    formula: ClassVar[str] = "K = scale"
    reference: ClassVar[str] = "M. v. Smoluchowski, Z. Phys. Chem. 92, 129 (1917)"

    def _densities(self, t: float, k: Float) -> Float:
        if t == 0:
            return (k == 1).astype(float)
        if math.isinf(t):
            return np.zeros(k.shape)
        return (2 / (t + 2)) ** 2 * np.exp(-(k - 1) * math.log1p(2 / max(t, 1e-300)))

    def _moments(self, t: float) -> tuple[float, float, float, float]:
        return 2 / (t + 2), 1.0, 1 + t, 1 + 3 * t + 1.5 * t * t
