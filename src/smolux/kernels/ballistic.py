"""The ballistic kernel of the free-molecular regime."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from smolux.units import MassDensity, Temperature, Volume

from .base import BOLTZMANN, Float, Kernel, check_parameters, check_positive, widen
from .majorant import Majorant


def _rate(i: Any, j: Any, scale: Any) -> Any:
    width = np.cbrt(i) + np.cbrt(j)
    return scale * (width * width * np.sqrt(1.0 / i + 1.0 / j))


#: the ratio of sizes at which the law is least for one of them given: ``x**3`` with x the positive
#: root of 4 x**4 + x - 3
_RATIO = 0.8556728696364336**3


@dataclass(frozen=True)
class Ballistic(Kernel):
    """Spheres in free flight: ``K(i, j) = scale (i^{1/3} + j^{1/3})^2 sqrt(1/i + 1/j)``.

    Parameters
    ----------
    scale : float
        Prefactor, volume per time.

    References
    ----------
    S. K. Friedlander, Smoke, Dust, and Haze, 2nd ed. (Oxford, 2000), chapter 7.
    """

    scale: float = 1.0
    name: ClassVar[str] = "ballistic"
    formula: ClassVar[str] = "scale * (cbrt(i) + cbrt(j))**2 * sqrt(1/i + 1/j)"
    reference: ClassVar[str] = "S. K. Friedlander, Smoke, Dust, and Haze, 2nd ed. (2000), chapter 7"
    constructors: ClassVar[tuple[str, ...]] = ("free_molecular",)
    rate: ClassVar[Callable[..., Any]] = staticmethod(_rate)

    def __post_init__(self) -> None:
        check_parameters(self)

    @classmethod
    def free_molecular(
        cls, temperature: Temperature, density: MassDensity, volume: Volume
    ) -> Ballistic:
        """Rate in a dilute gas, in m³/s.

        Parameters
        ----------
        temperature : float
            In K.
        density : float
            Of the material of the particles, in kg/m³.
        volume : float
            Of the monomer, a sphere, in m³.

        Notes
        -----
        ``K = pi (r_i + r_j)^2 sqrt(8 k T / pi (1/m_i + 1/m_j))``, the cross section times the mean
        relative speed: particles much smaller than the mean free path of the gas. With
        ``m = density i volume`` and ``r = (3 i volume / (4 pi))^{1/3}`` it is
        ``scale = (3 volume / (4 pi))^{1/6} sqrt(6 k T / density)``.
        """
        check_positive(
            "Ballistic.free_molecular", temperature=temperature, density=density, volume=volume
        )
        size = (3.0 * volume / (4.0 * math.pi)) ** (1.0 / 6.0)
        return cls(size * math.sqrt(6.0 * BOLTZMANN * temperature / density))

    @property
    def degree(self) -> float:
        return 1.0 / 6.0

    @property
    def gels(self) -> bool:
        return False

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        """See `Kernel.bounds`; both are attained.

        With ``x = (i/j)^{1/3}`` the law is ``j^{1/6} (1 + x)^2 sqrt(1 + x^{-3})``, whose
        logarithmic derivative in x has the sign of ``4 x^4 + x - 3``: along either size it falls,
        then grows. So the maximum over a box lies in a corner. The minimum over i lies at
        ``i = r j`` with r < 1, or at the end of the range next to it; as a function of j that
        minimum falls up to ``j = r a`` and grows beyond.
        """
        a, b, c, d = (np.asarray(x, float) for x in (a, b, c, d))
        upper = np.maximum(np.maximum(self(a, c), self(a, d)), np.maximum(self(b, c), self(b, d)))
        j = np.clip(_RATIO * a, c, d)
        return widen(self(np.clip(_RATIO * j, a, b), j), upper)

    def majorant(self) -> Majorant:
        """See `Kernel.majorant`; Osinsky (2023), eq. (25).

        ``A(i, j) = scale (i^{1/3} + j^{1/3})^2 i^{-1/2}``, as the root of a sum is at most the sum
        of the roots, and at least that over the root of two.
        """
        third = 1.0 / 3.0
        terms = ((1.0, 1.0 / 6.0, 0.0), (2.0, -1.0 / 6.0, third), (1.0, -0.5, 2.0 * third))
        return Majorant(tuple((self.scale * w, p, q) for w, p, q in terms), least=math.sqrt(0.5))
