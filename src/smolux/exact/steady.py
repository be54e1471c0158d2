"""The multiplicative kernel with shattering: the steady state."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .base import Float, Solution
from .special import log_central


@dataclass(frozen=True)
class MultiplicativeShattering(Solution):
    """Multiplicative kernel with shattering at a constant rate ``lam``: known at infinite time.

    ``k n_k = (1 + lam) C(2k, k) / ((2k - 1) 4**k) ((1 + 2 lam) / (1 + lam)**2)**k``; there is no
    gelation for any ``lam`` above 0. At finite times after the start everything is NaN.

    Parameters
    ----------
    lam : float
        Shattering rate over aggregation rate, above 0.

    References
    ----------
    Derived in the manual, page "Exact solutions".
    """

    lam: float = 0.1
    name: ClassVar[str] = "multiplicative kernel with shattering, steady state"
    formula: ClassVar[str] = "K = scale i j, shattering lam K"
    reference: ClassVar[str] = "derived in the manual of smolux, page 'Exact solutions'"

    def _problems(self) -> list[str]:
        if np.isfinite(self.lam) and self.lam > 0:
            return []
        return [f"lam = {self.lam!r}: must be a positive finite number"]

    def _densities(self, t: float, k: Float) -> Float:
        if t == 0:
            return (k == 1).astype(float)
        if not math.isinf(t):
            return np.full(k.shape, np.nan)
        decay = math.log1p(-((self.lam / (1 + self.lam)) ** 2))
        return (1 + self.lam) * np.exp(log_central(k) + k * decay) / ((2 * k - 1) * k)

    def _moments(self, t: float) -> tuple[float, float, float, float]:
        if t == 0:
            return 1.0, 1.0, 1.0, 1.0
        if not math.isinf(t):
            return math.nan, 1.0, math.nan, math.nan
        lam = self.lam
        ratio = (1 + 2 * lam) / lam  # y / (1 - y) * lam / (1 + lam), for y**k in n_k
        total = 2 - 2 * (1 + lam) * math.log1p(1 / (1 + 2 * lam))
        return total, 1.0, ratio / 2, ratio / 2 + (1 + 2 * lam) * ratio / (4 * lam * lam)

    def _collisions(self, t: float) -> float:
        return 0.0 if t == 0 else math.nan
