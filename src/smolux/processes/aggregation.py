"""Two particles become one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from smolux.errors import about
from smolux.functions.time import TimeFunction

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
    ``dn_k/dt = f(t) (1/2 sum_{i+j=k} K s n_i n_j - n_k sum_j K s n_j)`` with the share s(i, j).

    Parameters
    ----------
    varying : float, callable or str
        A function f of time by which the rate is multiplied, such as the share of encounters in
        which the particles stick, or the shear rate of a flow that slows down. Where nothing else
        happens, this is the same as another time, ``ds = f dt``.
    label : str, optional
        What it is called in results, if not by its name.

    share : float, callable or str
        The share of the encounters in which the particles stick, between 0 and 1: a number, a
        function of both sizes, or a formula in i and j such as ``"exp(-(i + j)/100)"``.

    References
    ----------
    M. v. Smoluchowski, Phys. Z. 17, 557 (1916).
    """

    varying: Any = 1.0
    name: ClassVar[str] = "aggregation"
    outcome: ClassVar[Callable[..., Any]] = staticmethod(_merge)
    #: what the fields are functions of, beside plain numbers
    variables: ClassVar[Mapping[str, str]] = {"varying": "t", "share": "i and j"}

    def __post_init__(self) -> None:
        _ = self.factor, self.shared

    @property
    def factor(self) -> TimeFunction:
        with about("varying"):
            return TimeFunction.of(self.varying, "the factor of aggregation")

    @property
    def daughters(self) -> Merged:
        return Merged()
