"""The differential sedimentation kernel."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from smolux.units import Acceleration, Length, MassDensity, Viscosity

from .base import Float, Kernel, check_parameters, check_positive, widen
from .majorant import Majorant


def _rate(i: Any, j: Any, scale: Any) -> Any:
    x, y = np.cbrt(i), np.cbrt(j)
    width = x + y
    # |x^2 - y^2| = |i - j| (x + y) / (x^2 + x y + y^2): no digits are lost for nearly equal sizes.
    square = width * width
    return scale * (square * width * np.abs(i - j) / (square - x * y))


@dataclass(frozen=True)
class Sedimentation(Kernel):
    """Large spheres overtake small: ``K = scale (i^{1/3} + j^{1/3})^2 |i^{2/3} - j^{2/3}|``.

    Equal particles never meet, so nothing happens to monomers alone. In an infinite system the
    kernel gels at once, as ``K ~ j^{4/3}`` for ``j >> i`` grows faster than j; in a finite one
    after a time that falls slowly as the system grows.

    Parameters
    ----------
    scale : float
        Prefactor, volume per time.

    References
    ----------
    R. C. Ball et al., Phys. Rev. E 84, 011111 (2011), doi:10.1103/PhysRevE.84.011111.
    """

    scale: float = 1.0
    name: ClassVar[str] = "sedimentation"
    formula: ClassVar[str] = "scale * (cbrt(i) + cbrt(j))**2 * abs(cbrt(i)**2 - cbrt(j)**2)"
    reference: ClassVar[str] = "R. C. Ball et al., Phys. Rev. E 84, 011111 (2011)"
    constructors: ClassVar[tuple[str, ...]] = ("stokes",)
    rate: ClassVar[Callable[..., Any]] = staticmethod(_rate)

    def __post_init__(self) -> None:
        check_parameters(self)

    @classmethod
    def stokes(
        cls,
        density_difference: MassDensity,
        viscosity: Viscosity,
        radius: Length,
        gravity: Acceleration = 9.80665,
    ) -> Sedimentation:
        """Rate of spheres that settle at their Stokes velocity, in m³/s.

        Parameters
        ----------
        density_difference : float
            Between particle and fluid, in kg/m³; only its amount matters.
        viscosity : float
            Dynamic viscosity of the fluid, in Pa s.
        radius : float
            Of the monomer, in m.
        gravity : float
            In m/s².

        Notes
        -----
        ``K = pi (r_i + r_j)^2 |u_i - u_j|`` with the Stokes velocity
        ``u = (2/9) density_difference gravity r^2 / viscosity``, so that
        ``scale = (2 pi / 9) density_difference gravity radius^4 / viscosity``. Every pair on a
        collision course is taken to meet (collision efficiency 1).
        """
        number = isinstance(density_difference, (int, float, np.number))
        contrast = abs(density_difference) if number else density_difference
        check_positive(
            "Sedimentation.stokes",
            density_difference=contrast,
            viscosity=viscosity,
            radius=radius,
            gravity=gravity,
        )
        speed = 2.0 / 9.0 * contrast * gravity * radius**2 / viscosity
        return cls(math.pi * radius**2 * speed)

    @property
    def degree(self) -> float:
        return 4.0 / 3.0

    @property
    def gels(self) -> bool:
        """See `Kernel.gels`; at once."""
        return True

    def gel_time(self) -> float:
        return 0.0

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        """See `Kernel.bounds`; both are attained.

        With ``x > y`` the cube roots of the sizes the law is ``(x + y)^3 (x - y)``. It grows with
        x, and with y up to ``y = x / 2``, then falls to zero. So the maximum has one of the sizes
        at its largest and the other as near as possible to an eighth of it; the minimum is zero
        where the ranges overlap, else the larger size is at its least and the smaller at one of
        its ends.
        """
        a, b, c, d = (np.asarray(x, float) for x in (a, b, c, d))
        upper = np.maximum(self(b, np.clip(b / 8.0, c, d)), self(np.clip(d / 8.0, a, b), d))
        first = np.minimum(self(a, c), self(a, d))  # if a > d
        second = np.minimum(self(a, c), self(b, c))  # if c > b
        lower = np.where(a > d, first, np.where(c > b, second, 0.0))
        return widen(lower, upper)

    def majorant(self) -> Majorant:
        """See `Kernel.majorant`; ``A(i, j) = scale (i^{4/3} + 2 i j^{1/3})``.

        With ``x > y`` the cube roots of the sizes the law is
        ``(x + y)^3 (x - y) = x^4 + 2 x^3 y - 2 x y^3 - y^4``.
        """
        third = 1.0 / 3.0
        return Majorant(((self.scale, 4.0 * third, 0.0), (2.0 * self.scale, 1.0, third)))
