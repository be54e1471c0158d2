"""The Brownian kernel of the continuum regime."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from smolux.units import Temperature, Viscosity

from .base import BOLTZMANN, Float, Kernel, check_parameters, check_positive, ratios, widen
from .majorant import Majorant


def _rate(i: Any, j: Any, dimension: Any, scale: Any) -> Any:
    # (i^p + j^p)(i^-p + j^-p), multiplied out: one power
    power = (i / j) ** (1.0 / dimension)
    return scale * (2.0 + power + 1.0 / power)


@dataclass(frozen=True)
class Brownian(Kernel):
    """Diffusion: ``K(i, j) = scale (i^{1/D} + j^{1/D}) (i^{-1/D} + j^{-1/D})``.

    Parameters
    ----------
    dimension : float
        Fractal dimension D of the clusters, at least 1: 3 for spheres that coalesce, about 1.8 for
        diffusion-limited cluster aggregates. The radius that collides is taken for the one that
        diffuses.
    scale : float
        Prefactor, volume per time.

    References
    ----------
    M. v. Smoluchowski, Z. Phys. Chem. 92, 129 (1917), doi:10.1515/zpch-1918-9209.
    """

    dimension: float = 3.0
    scale: float = 1.0
    name: ClassVar[str] = "brownian"
    formula: ClassVar[str] = (
        "scale * (i**(1/dimension) + j**(1/dimension)) * (i**(-1/dimension) + j**(-1/dimension))"
    )
    reference: ClassVar[str] = "M. v. Smoluchowski, Z. Phys. Chem. 92, 129 (1917)"
    constructors: ClassVar[tuple[str, ...]] = ("continuum",)
    rate: ClassVar[Callable[..., Any]] = staticmethod(_rate)

    def __post_init__(self) -> None:
        check_parameters(self, dimension=(1.0, np.inf))

    @classmethod
    def continuum(
        cls, temperature: Temperature, viscosity: Viscosity, dimension: float = 3.0
    ) -> Brownian:
        """Rate in a fluid, ``scale = 2 k T / (3 viscosity)``, in m³/s.

        Parameters
        ----------
        temperature : float
            In K.
        viscosity : float
            Dynamic viscosity of the fluid, in Pa s.
        dimension : float
            Fractal dimension.

        Notes
        -----
        ``K = 4 pi (D_i + D_j) (r_i + r_j)`` with the diffusivity of Stokes and Einstein,
        ``D = k T / (6 pi viscosity r)``: particles much larger than the mean free path of the
        fluid. The size of the monomer drops out.
        """
        check_positive("Brownian.continuum", temperature=temperature, viscosity=viscosity)
        return cls(dimension, 2.0 * BOLTZMANN * temperature / (3.0 * viscosity))

    @property
    def degree(self) -> float:
        return 0.0

    @property
    def gels(self) -> bool:
        return False

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        """See `Kernel.bounds`; both are attained, the law grows with the ratio of the sizes."""
        near, far = ratios(a, b, c, d)
        return widen(self(near, 1.0), self(far, 1.0))

    def low_rank_factors(self, sizes: Float) -> tuple[Float, Float]:
        """See `Kernel.low_rank_factors`; rank 3."""
        power = np.asarray(sizes, float) ** (1.0 / self.dimension)
        one = np.ones(len(power))
        return self.scale * np.array([2 * one, power, 1 / power]), np.array([one, 1 / power, power])

    def majorant(self) -> Majorant:
        """See `Kernel.majorant`; the law itself, ``A(i, j) = scale (1 + (i/j)^{1/D})``."""
        power = 1.0 / self.dimension
        return Majorant(((self.scale, 0.0, 0.0), (self.scale, power, -power)), least=1.0)
