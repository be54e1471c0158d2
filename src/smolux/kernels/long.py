"""Long's polynomial kernel of cloud droplets."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from smolux.units import Length

from .base import Float, Kernel, check_positive, corners

#: of the volumes' squares in 1/(m³ s), of the volumes in 1/s, and the radius between, in m
_SQUARES, _SUM, _EDGE = 9.44e15, 5.78e3, 50e-6


def _rate(i: Any, j: Any, squares: Any, volumes: Any, edge: Any) -> Any:
    small = np.maximum(i, j) <= edge
    return small * (squares * (i * i + j * j)) + (1.0 - small) * (volumes * (i + j))


@dataclass(frozen=True)
class Long(Kernel):
    """Cloud droplets that fall, by Long's polynomials, in m³/s.

    ``K = 9.44e15 (x^2 + y^2)`` of the volumes x and y in m³, if the larger radius is 50 µm at
    most, and ``K = 5.78e3 (x + y)`` above, where it jumps up by 17 %. This is the approximation of
    the kernel, not Long's efficiency with a law of fall speeds, which other programs call Long's.

    Parameters
    ----------
    monomer_diameter : float
        In m.

    References
    ----------
    A. B. Long, J. Atmos. Sci. 31, 1040 (1974),
    doi:10.1175/1520-0469(1974)031<1040:STTDCE>2.0.CO;2.
    """

    monomer_diameter: Length
    name: ClassVar[str] = "long"
    formula: ClassVar[str] = "9.44e15*(x**2 + y**2) up to a radius of 50 um, then 5.78e3*(x + y)"
    reference: ClassVar[str] = "A. B. Long, J. Atmos. Sci. 31, 1040 (1974)"
    example: ClassVar[dict[str, float]] = {"monomer_diameter": 4e-6}
    rate: ClassVar[Callable[..., Any]] = staticmethod(_rate)

    def __post_init__(self) -> None:
        check_positive(f"kernel {self.name!r}", monomer_diameter=self.monomer_diameter)

    @property
    def parameters(self) -> tuple[float, ...]:
        """See `Kernel.parameters`: both prefactors of sizes, and the size of 50 µm."""
        volume = math.pi / 6.0 * self.monomer_diameter**3
        edge = (2.0 * _EDGE / self.monomer_diameter) ** 3
        # a whole size that lies at the edge but for rounding belongs to the smaller ones
        return _SQUARES * volume**2, _SUM * volume, edge * (1.0 + 1e-12)

    @property
    def gels(self) -> bool:
        """See `Kernel.gels`: never, as the largest droplets sweep at a rate of their volumes."""
        return False

    @property
    def monomer(self) -> dict[str, float]:
        return {"monomer_diameter": self.monomer_diameter}

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        """See `Kernel.bounds`; both are attained.

        The law grows with either size, and it jumps up: ``9.44e15 (x^2 + y^2)`` is at most
        ``9.44e15 z (x + y) = 4.94e3 (x + y)``, with z the volume of 50 µm that neither exceeds.
        """
        return corners(self, (a, c), (b, d))
