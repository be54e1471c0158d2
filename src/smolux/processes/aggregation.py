"""Two particles become one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from .base import PairProcess
from .daughters import Merged


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

    @property
    def daughters(self) -> Merged:
        """See `PairProcess.daughters`."""
        return Merged()
