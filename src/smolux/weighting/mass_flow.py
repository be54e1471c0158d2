"""Mass flow: one simulated particle is one unit of mass."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from smolux.functions.intervals import Interval
from smolux.kernels.base import Kernel
from smolux.kernels.majorant import Majorant

from .base import Weighting
from .weight_function import power_interval, power_majorant


def _weight(size: Any) -> Any:
    return size


def _ratio(i: Any, j: Any) -> Any:
    return (i + j) / (i * j)


@dataclass(frozen=True)
class MassFlow(Weighting):
    """Every simulated particle stands for one unit of mass, the share ``1/l`` of a particle.

    When i and j aggregate, one of the two is taken out, i with probability ``i / (i + j)``, and
    ``i + j`` is put in. The number of simulated particles stays, mass is conserved exactly, and
    large particles, which hold most of the mass, are many. The weight ``w(l) = l``.

    References
    ----------
    H. Babovsky, Monte Carlo Methods Appl. 5, 1 (1999), doi:10.1515/mcma.1999.5.1.1; A. Eibeck and
    W. Wagner, Ann. Appl. Probab. 11, 1137 (2001), doi:10.1214/aoap/1015345398.
    """

    name: ClassVar[str] = "mass-flow"
    cheap: ClassVar[bool] = True

    @property
    def weight(self) -> Callable[..., Any]:
        return _weight

    @property
    def rate_ratio(self) -> Callable[..., Any]:
        return _ratio

    def interval(self, i: Interval, j: Interval) -> Interval:
        return power_interval(i, j, 1.0)

    def majorant(self, kernel: Kernel) -> Majorant | None:
        """See `Weighting.majorant`; as near to the simulated rate as that of the kernel is."""
        return power_majorant(kernel.majorant(), 1.0)
