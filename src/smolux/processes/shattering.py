"""Two particles fall apart into monomers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from smolux.errors import about
from smolux.functions.time import TimeFunction

from .base import PairProcess
from .daughters import Debris


def _shatter(i: int, j: int, sizes: Any, counts: Any) -> int:
    sizes[0] = 1
    counts[0] = i + j
    return 1


@dataclass(frozen=True)
class Shattering(PairProcess):
    """Colliding particles shatter into monomers: ``(i) + (j) -> (i + j) (1)``.

    The rate is ``rate`` times that of the kernel, so a share ``rate / (1 + rate)`` of the
    encounters shatters when the rest aggregates.

    Parameters
    ----------
    rate : float, callable or str
        The parameter λ, dimensionless: a number, a function of time ``f(t)``, or a formula in ``t``
        such as ``"0.01 * (1 - t/400)"``. Never negative.
    share : float, callable or str
        The share of these encounters in which that happens, between 0 and 1: a number, a function
        of both sizes, or a formula in i and j.
    label : str, optional
        What it is called in results, if not by its name.

    References
    ----------
    N. V. Brilliantov et al., PNAS 112, 9536 (2015), doi:10.1073/pnas.1503957112.
    """

    rate: Any
    name: ClassVar[str] = "shattering"
    variables: ClassVar[Mapping[str, str]] = {"rate": "t", "share": "i and j"}
    outcome: ClassVar[Callable[..., Any]] = staticmethod(_shatter)

    def __post_init__(self) -> None:
        _ = self.factor, self.shared

    @property
    def factor(self) -> TimeFunction:
        """λ as a function of time."""
        with about("rate"):
            return TimeFunction.of(self.rate, "the shattering rate")

    @property
    def daughters(self) -> Debris:
        return Debris((1.0,))
