"""Two particles become one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from .base import Float, PairProcess


def _merge(i: int, j: int, sizes: Any, counts: Any) -> int:
    sizes[0] = i + j
    counts[0] = 1
    return 1


@dataclass(frozen=True)
class Aggregation(PairProcess):
    """Colliding particles stick: ``(i) + (j) -> (i + j)`` at the rate of the kernel.

    The Smoluchowski equations: ``dn_k/dt = 1/2 sum_{i+j=k} K n_i n_j - n_k sum_j K n_j``
    (M. v. Smoluchowski, Phys. Z. 17, 557 (1916)).
    """

    name: ClassVar[str] = "aggregation"
    outcome: ClassVar[Callable[..., Any]] = staticmethod(_merge)

    def rhs(
        self, t: float, sizes: Float, n: Float, loss: Float, gain: Callable[[], Float]
    ) -> Float:
        """See `PairProcess.rhs`."""
        return gain() - loss
