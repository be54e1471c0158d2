"""Two particles fall apart into monomers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from ..timefunction import TimeFunction
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
    label : str, optional
        What it is called in results, if not by its name.

    References
    ----------
    N. V. Brilliantov et al., PNAS 112, 9536 (2015), doi:10.1073/pnas.1503957112.
    """

    rate: Any
    name: ClassVar[str] = "shattering"
    outcome: ClassVar[Callable[..., Any]] = staticmethod(_shatter)

    def __post_init__(self) -> None:
        TimeFunction.of(self.rate, "the shattering rate")

    @property
    def factor(self) -> TimeFunction:
        """λ as a function of time."""
        return TimeFunction.of(self.rate, "the shattering rate")

    @property
    def daughters(self) -> Debris:
        """See `PairProcess.daughters`."""
        return Debris((1.0,))
