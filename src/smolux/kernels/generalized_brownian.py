"""The generalised Brownian kernel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .base import Float, Kernel, check_parameters, ratios, widen
from .majorant import Majorant


def _rate(i: Any, j: Any, a: Any, scale: Any) -> Any:
    power = (i / j) ** a
    return scale * (power + 1.0 / power)


@dataclass(frozen=True)
class GeneralizedBrownian(Kernel):
    """Brownian with any exponent: ``K(i, j) = scale ((i/j)^a + (j/i)^a)``.

    Parameters
    ----------
    a : float
        Exponent, -4 to 4; its sign does not matter. Aggregation alone gels at once for ``|a| > 1``.
    scale : float
        Prefactor, volume per time.

    References
    ----------
    S. A. Matveev et al., Phys. Rev. Lett. 119, 260601 (2017), doi:10.1103/PhysRevLett.119.260601.
    """

    a: float
    scale: float = 1.0
    name: ClassVar[str] = "generalized-brownian"
    formula: ClassVar[str] = "scale * ((i/j)**a + (j/i)**a)"
    reference: ClassVar[str] = "S. A. Matveev et al., Phys. Rev. Lett. 119, 260601 (2017)"
    example: ClassVar[dict[str, float]] = {"a": 0.95}
    rate: ClassVar[Callable[..., Any]] = staticmethod(_rate)

    def __post_init__(self) -> None:
        check_parameters(self, a=(-4.0, 4.0))

    @property
    def degree(self) -> float:
        return 0.0

    @property
    def gels(self) -> bool:
        """See `Kernel.gels`; at once for ``|a| > 1``."""
        return abs(self.a) > 1

    def gel_time(self) -> float | None:
        return 0.0 if self.gels else None

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        """See `Kernel.bounds`; both are attained, the law grows with the ratio of the sizes."""
        near, far = ratios(a, b, c, d)
        return widen(self(near, 1.0), self(far, 1.0))

    def low_rank_factors(self, sizes: Float) -> tuple[Float, Float]:
        """See `Kernel.low_rank_factors`; rank 2."""
        power = np.asarray(sizes, float) ** self.a
        return self.scale * np.array([power, 1 / power]), np.array([1 / power, power])

    def majorant(self) -> Majorant:
        """See `Kernel.majorant`; the law itself, ``A(i, j) = scale (i/j)^a``."""
        return Majorant(((self.scale, self.a, -self.a),), least=1.0)
