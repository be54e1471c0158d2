"""The multiplicative kernel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .base import Float, Kernel, check_parameters, corners
from .majorant import Majorant


def _rate(i: Any, j: Any, scale: Any) -> Any:
    return scale * (i * j)


@dataclass(frozen=True)
class Multiplicative(Kernel):
    """Product of the sizes: ``K(i, j) = scale i j``; gels at ``1 / scale`` from unit monomers.

    Parameters
    ----------
    scale : float
        Prefactor, volume per time.

    References
    ----------
    J. B. McLeod, Q. J. Math. 13, 119 (1962), doi:10.1093/qmath/13.1.119.
    """

    scale: float = 1.0
    name: ClassVar[str] = "multiplicative"
    formula: ClassVar[str] = "scale * (i * j)"
    reference: ClassVar[str] = (
        "J. B. McLeod, Q. J. Math. 13, 119 (1962), doi:10.1093/qmath/13.1.119"
    )
    cheap: ClassVar[bool] = True
    exact: ClassVar[str | None] = "multiplicative"
    rate: ClassVar[Callable[..., Any]] = staticmethod(_rate)

    def __post_init__(self) -> None:
        check_parameters(self)

    @property
    def degree(self) -> float:
        return 2.0

    @property
    def gels(self) -> bool:
        return True

    def gel_time(self) -> float:
        return 1.0 / self.scale

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        """See `Kernel.bounds`; the law grows with either size."""
        return corners(self, (a, c), (b, d))

    def low_rank_factors(self, sizes: Float) -> tuple[Float, Float]:
        """See `Kernel.low_rank_factors`; rank 1."""
        sizes = np.asarray(sizes, float)[None]
        return self.scale * sizes, sizes

    def majorant(self) -> Majorant:
        """See `Kernel.majorant`; the law itself."""
        return Majorant(((self.scale / 2, 1.0, 1.0),), least=1.0)
