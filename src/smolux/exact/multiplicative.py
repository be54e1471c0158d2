"""The multiplicative kernel, before and after gelation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from smolux.errors import did_you_mean

from .base import Float, Solution
from .special import log_borel

#: what the infinite cluster does with the finite ones
GEL = ("reacts", "inert")


def dual_time(t: float) -> tuple[float, float]:
    """Return the root ``y < 1`` of ``y exp(-y) = t exp(-t)`` for ``t > 1``, and ``1 - y``.

    The finite clusters at the time ``t`` after gelation are distributed as all clusters at ``y``.
    """
    # Newton steps from the side where they cannot overshoot
    if t < 1.5:  # near the gel point the small quantity is 1 - y
        d = t - 1
        e = d
        for _ in range(60):
            step = (math.log1p(-e) + e - math.log1p(d) + d) * (1 - e) / e
            e += step
            if abs(step) <= 1e-16 * e:
                break
        return 1 - e, e
    target = t - math.log(t)
    y = t * math.exp(-t)
    for _ in range(60):
        if y == 0:
            break
        step = (y - math.log(y) - target) * y / (1 - y)
        y += step
        if abs(step) <= 1e-16 * y:
            break
    return y, 1 - y


@dataclass(frozen=True)
class Multiplicative(Solution):
    """Multiplicative kernel ``K = scale i j``, monomers at the start; gels at ``t = 1``.

    ``n_k = k**(k - 2) t**(k - 1) exp(-k t) / k!``. After the gel time the finite clusters either go
    on reacting with the gel (Flory; the limit of the finite system, whose largest cluster is the
    gel), or they do not (Stockmayer; the limit of truncated rate equations).

    Parameters
    ----------
    gel : {"reacts", "inert"}
        Flory's or Stockmayer's model of the gel.

    References
    ----------
    J. B. McLeod, Q. J. Math. 13, 119 (1962), doi:10.1093/qmath/13.1.119; R. M. Ziff and G. Stell,
    J. Chem. Phys. 73, 3492 (1980), doi:10.1063/1.440502.
    """

    gel: Literal["reacts", "inert"] = "reacts"
    name: ClassVar[str] = "multiplicative kernel"
    formula: ClassVar[str] = "K = scale i j"
    reference: ClassVar[str] = "R. M. Ziff and G. Stell, J. Chem. Phys. 73, 3492 (1980)"

    def _problems(self) -> list[str]:
        if self.gel in GEL:
            return []
        return [f"gel = {self.gel!r}: no such model of the gel{did_you_mean(str(self.gel), GEL)}"]

    def _gel_time(self) -> float:
        return 1.0

    def _densities(self, t: float, k: Float) -> Float:
        if t == 0:
            return (k == 1).astype(float)
        if math.isinf(t):
            return np.zeros(k.shape)
        if t > 1 and self.gel == "inert":
            return self._densities(1.0, k) / t
        return np.exp(log_borel(k, t)) / k

    def _moments(self, t: float) -> tuple[float, float, float, float]:
        if t < 1:
            return 1 - t / 2, 1.0, 1 / (1 - t), 1 / (1 - t) ** 3
        if t == 1:
            return 0.5, 1.0, math.inf, math.inf
        if self.gel == "inert":
            return 0.5 / t, 1 / t, math.inf, math.inf
        if math.isinf(t):
            return 0.0, 0.0, 0.0, 0.0
        y, rest = dual_time(t)
        sol = y / t
        return sol * (1 - y / 2), sol, sol / rest, sol / rest**3
