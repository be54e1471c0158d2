"""Two particles become one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..timefunction import TimeFunction
from .base import PairProcess
from .daughters import Merged


def _merge(i: int, j: int, sizes: Any, counts: Any) -> int:
    sizes[0] = i + j
    counts[0] = 1
    return 1


@dataclass(frozen=True)
class Aggregation(PairProcess):
    """Colliding particles stick: ``(i) + (j) -> (i + j)`` at the rate of the kernel.

    The Smoluchowski equations:
    ``dn_k/dt = f(t) (1/2 sum_{i+j=k} K n_i n_j - n_k sum_j K n_j)``.

    Parameters
    ----------
    varying : float, callable or str
        A function f of time by which the rate is multiplied, such as the share of encounters in
        which the particles stick, or the shear rate of a flow that slows down. Where nothing else
        happens, this is the same as another time, ``ds = f dt``.
    label : str, optional
        What it is called in results, if not by its name.

    References
    ----------
    M. v. Smoluchowski, Phys. Z. 17, 557 (1916).
    """

    varying: Any = 1.0
    name: ClassVar[str] = "aggregation"
    outcome: ClassVar[Callable[..., Any]] = staticmethod(_merge)
    #: what the fields are functions of, beside plain numbers
    variables: ClassVar[Mapping[str, str]] = {"varying": "t"}

    def __post_init__(self) -> None:
        _ = self.factor

    @property
    def factor(self) -> TimeFunction:
        """See `Process.factor`."""
        return TimeFunction.of(self.varying, "the factor of aggregation")

    @property
    def daughters(self) -> Merged:
        """See `PairProcess.daughters`."""
        return Merged()
