"""The generalised product kernel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .base import Float, Kernel, check_parameters, corners
from .majorant import Majorant


def _rate(i: Any, j: Any, mu: Any, scale: Any) -> Any:
    return scale * (i * j) ** mu


@dataclass(frozen=True)
class Product(Kernel):
    """A power of the product: ``K(i, j) = scale (i j)^mu``.

    Aggregation alone gels for ``mu > 1/2``, and at once for ``mu > 1`` in an infinite system; a
    finite one gels at a time that falls to zero slowly as it grows.

    Parameters
    ----------
    mu : float
        Exponent, -4 to 4.
    scale : float
        Prefactor, volume per time.

    References
    ----------
    P. G. J. van Dongen and M. H. Ernst, Phys. Rev. Lett. 54, 1396 (1985),
    doi:10.1103/PhysRevLett.54.1396;
    J. Carr and F. P. da Costa, Z. Angew. Math. Phys. 43, 974 (1992), doi:10.1007/BF00916423.
    """

    mu: float
    scale: float = 1.0
    name: ClassVar[str] = "product"
    formula: ClassVar[str] = "scale * (i*j)**mu"
    reference: ClassVar[str] = (
        "P. G. J. van Dongen and M. H. Ernst, Phys. Rev. Lett. 54, 1396 (1985)"
    )
    example: ClassVar[dict[str, float]] = {"mu": 0.4}
    rate: ClassVar[Callable[..., Any]] = staticmethod(_rate)

    def __post_init__(self) -> None:
        check_parameters(self, mu=(-4.0, 4.0))

    @property
    def degree(self) -> float:
        return 2.0 * self.mu

    @property
    def gels(self) -> bool:
        return self.mu > 0.5

    def gel_time(self) -> float | None:
        """See `Kernel.gel_time`; known for ``mu >= 1``."""
        if self.mu > 1:
            return 0.0
        return 1.0 / self.scale if self.mu == 1 else None

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        """See `Kernel.bounds`; the law is monotone."""
        return corners(self, (a, c), (b, d)) if self.mu >= 0 else corners(self, (b, d), (a, c))

    def low_rank_factors(self, sizes: Float) -> tuple[Float, Float]:
        """See `Kernel.low_rank_factors`; rank 1."""
        power = (np.asarray(sizes, float) ** self.mu)[None]
        return self.scale * power, power

    def majorant(self) -> Majorant:
        """See `Kernel.majorant`; the law itself."""
        return Majorant(((self.scale / 2, self.mu, self.mu),), least=1.0)
