"""The shear kernel."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from smolux.units import Dissipation, MassDensity, Rate, Viscosity, Volume

from .base import Float, Kernel, check_parameters, check_positive, corners
from .majorant import Majorant


def _rate(i: Any, j: Any, scale: Any) -> Any:
    width = np.cbrt(i) + np.cbrt(j)
    return scale * (width * width * width)


@dataclass(frozen=True)
class Shear(Kernel):
    """Spheres carried by a shear flow: ``K(i, j) = scale (i^{1/3} + j^{1/3})^3``.

    Parameters
    ----------
    scale : float
        Prefactor, volume per time.

    References
    ----------
    M. v. Smoluchowski, Z. Phys. Chem. 92, 129 (1917), doi:10.1515/zpch-1918-9209.
    """

    scale: float = 1.0
    name: ClassVar[str] = "shear"
    formula: ClassVar[str] = "scale * (cbrt(i) + cbrt(j))**3"
    reference: ClassVar[str] = "M. v. Smoluchowski, Z. Phys. Chem. 92, 129 (1917)"
    constructors: ClassVar[tuple[str, ...]] = ("laminar", "turbulent")
    rate: ClassVar[Callable[..., Any]] = staticmethod(_rate)

    def __post_init__(self) -> None:
        check_parameters(self)

    @classmethod
    def laminar(cls, gradient: Rate, volume: Volume) -> Shear:
        """Rate in a laminar shear flow, ``K = (4/3) G (r_i + r_j)^3``, in m³/s.

        Parameters
        ----------
        gradient : float
            Velocity gradient G, in 1/s.
        volume : float
            Volume of the monomer, a sphere, in m³.

        Notes
        -----
        ``r = (3 i volume / (4 pi))^{1/3}``, so ``scale = G volume / pi``. Streamlines are taken for
        straight.
        """
        check_positive("Shear.laminar", gradient=gradient, volume=volume)
        return cls(gradient * volume / math.pi)

    @classmethod
    def turbulent(
        cls, dissipation: Dissipation, viscosity: Viscosity, density: MassDensity, volume: Volume
    ) -> Shear:
        """Rate in turbulence, ``K = sqrt(8 pi e/(15 nu)) (r_i + r_j)^3``, in m³/s.

        Parameters
        ----------
        dissipation : float
            Of kinetic energy, e, in m²/s³.
        viscosity : float
            Dynamic viscosity of the fluid, in Pa s.
        density : float
            Of the fluid, in kg/m³, so that ``nu = viscosity/density``.
        volume : float
            Volume of the monomer, a sphere, in m³.

        Notes
        -----
        Of particles that follow the fluid and are smaller than its smallest eddies: P. G. Saffman
        and J. S. Turner, J. Fluid Mech. 1, 16 (1956), doi:10.1017/S0022112056000020. It was found
        for radii that differ by a factor of two at most.
        Every pair on a collision course is taken to meet (collision efficiency 1).
        """
        check_positive(
            "Shear.turbulent",
            dissipation=dissipation,
            viscosity=viscosity,
            density=density,
            volume=volume,
        )
        gradient = math.sqrt(8.0 * math.pi * dissipation * density / (15.0 * viscosity))
        return cls(gradient * 3.0 * volume / (4.0 * math.pi))

    @property
    def degree(self) -> float:
        return 1.0

    @property
    def gels(self) -> bool:
        """See `Kernel.gels`: never, as ``K <= 4 scale (i + j)``."""
        return False

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        """See `Kernel.bounds`; the law grows with either size."""
        return corners(self, (a, c), (b, d))

    def low_rank_factors(self, sizes: Float) -> tuple[Float, Float]:
        """See `Kernel.low_rank_factors`; rank 4, by the binomial theorem."""
        sizes = np.asarray(sizes, float)
        x, one = np.cbrt(sizes), np.ones(len(sizes))
        left = np.array([sizes, 3 * x * x, 3 * x, one])
        return self.scale * left, np.array([one, x, x * x, sizes])

    def majorant(self) -> Majorant:
        """See `Kernel.majorant`; the law itself, ``A(i, j) = scale (i + 3 i^{2/3} j^{1/3})``."""
        third = 1.0 / 3.0
        terms = ((self.scale, 1.0, 0.0), (3.0 * self.scale, 2.0 * third, third))
        return Majorant(terms, least=1.0)
