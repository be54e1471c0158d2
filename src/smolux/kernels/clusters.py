"""The kernel of fractal clusters that stick at few of their encounters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from smolux.units import Temperature, Viscosity

from .base import BOLTZMANN, Float, Kernel, check_parameters, check_positive, widen
from .majorant import Majorant


def _rate(i: Any, j: Any, dimension: Any, exponent: Any, stability: Any, scale: Any) -> Any:
    power = (i / j) ** (1.0 / dimension)
    return scale * (2.0 + power + 1.0 / power) * (i * j) ** exponent / stability


@dataclass(frozen=True)
class Clusters(Kernel):
    """Colloids that stick at one of W encounters: `Brownian` times ``(i j)^exponent / W``.

    With W = 1 and the exponent 0 it is diffusion-limited (D about 1.8). With large W it is
    reaction-limited (D about 2.1): larger clusters have more places to stick at. The exponent is
    about 1/2 then, and the mean size grows exponentially.

    Parameters
    ----------
    dimension : float
        Fractal dimension D of the clusters, at least 1.
    exponent : float
        From 0 to 2. Aggregation alone gels above 1/2, and at once above ``1 - 1/D``.
    stability : float
        Stability ratio W of monomers, from 1e-6 to 1e100; below 1 if they attract each other from
        afar.
    scale : float
        Prefactor, volume per time.

    References
    ----------
    R. C. Ball, D. A. Weitz, T. A. Witten and F. Leyvraz, Phys. Rev. Lett. 58, 274 (1987),
    doi:10.1103/PhysRevLett.58.274.
    """

    dimension: float = 1.8
    exponent: float = 0.0
    stability: float = 1.0
    scale: float = 1.0
    name: ClassVar[str] = "clusters"
    formula: ClassVar[str] = (
        "scale * (i**(1/dimension) + j**(1/dimension)) * (i**(-1/dimension) + j**(-1/dimension))"
        " * (i*j)**exponent / stability"
    )
    reference: ClassVar[str] = "R. C. Ball et al., Phys. Rev. Lett. 58, 274 (1987)"
    constructors: ClassVar[tuple[str, ...]] = ("in_fluid",)
    rate: ClassVar[Callable[..., Any]] = staticmethod(_rate)

    def __post_init__(self) -> None:
        check_parameters(
            self, dimension=(1.0, np.inf), exponent=(0.0, 2.0), stability=(1e-6, 1e100)
        )

    @classmethod
    def in_fluid(
        cls,
        temperature: Temperature,
        viscosity: Viscosity,
        stability: float = 1.0,
        exponent: float = 0.0,
        dimension: float = 1.8,
    ) -> Clusters:
        """Rate in a fluid, ``scale = 2 k T / (3 viscosity)``, in m³/s.

        Parameters
        ----------
        temperature : float
            In K.
        viscosity : float
            Dynamic viscosity of the fluid, in Pa s.
        stability, exponent, dimension : float
            As of the law.
        """
        check_positive("Clusters.in_fluid", temperature=temperature, viscosity=viscosity)
        scale = 2.0 * BOLTZMANN * temperature / (3.0 * viscosity)
        return cls(dimension, exponent, stability, scale)

    @property
    def degree(self) -> float:
        return 2.0 * self.exponent

    @property
    def gels(self) -> bool:
        """See `Kernel.gels`; at once if the rate of a small cluster grows faster than the other."""
        return self.exponent > 0.5 or self.gel_time() == 0.0

    def gel_time(self) -> float | None:
        return 0.0 if self.exponent + 1.0 / self.dimension > 1.0 else None

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        """See `Kernel.bounds`; both are attained.

        The logarithm of the law, ``exponent (x + y) + 2 log cosh((x - y)/(2 D))`` of the logarithms
        of the sizes, is convex: its maximum lies in a corner. Along either size it grows with the
        slope ``exponent + tanh((x - y)/(2 D))/D``, so the minimum lies at a given ratio of the
        sizes, or at the end of the range next to it; as a function of the other size that minimum
        falls, then grows, as that of `Ballistic`.
        """
        a, b, c, d = (np.asarray(x, float) for x in (a, b, c, d))
        upper = np.maximum(np.maximum(self(a, c), self(a, d)), np.maximum(self(b, c), self(b, d)))
        steepness = self.exponent * self.dimension
        ratio = 0.0
        if steepness < 1.0:
            ratio = ((1.0 - steepness) / (1.0 + steepness)) ** self.dimension
        j = np.clip(ratio * a, c, d)
        return widen(self(np.clip(ratio * j, a, b), j), upper)

    def low_rank_factors(self, sizes: Float) -> tuple[Float, Float]:
        """See `Kernel.low_rank_factors`; rank 3."""
        sizes = np.asarray(sizes, float)
        power, one = sizes ** (1.0 / self.dimension), np.ones(len(sizes))
        more = sizes**self.exponent
        left = self.scale / self.stability * more * np.array([2 * one, power, 1 / power])
        return left, more * np.array([one, 1 / power, power])

    def majorant(self) -> Majorant:
        """See `Kernel.majorant`; the law itself, half of it before the sizes change places."""
        scale, power, e = self.scale / self.stability, 1.0 / self.dimension, self.exponent
        return Majorant(((scale, e, e), (scale, e + power, e - power)), least=1.0)
