"""The constant kernel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .base import Float, Kernel, check_parameters
from .majorant import Majorant


def _rate(i: Any, j: Any, scale: Any) -> Any:
    return scale


@dataclass(frozen=True)
class Constant(Kernel):
    """Every pair meets at the same rate: ``K(i, j) = scale``.

    Parameters
    ----------
    scale : float
        The rate, volume per time. Zero for models in which nothing collides, but single particles
        change, leave or come in.

    References
    ----------
    M. v. Smoluchowski, Z. Phys. Chem. 92, 129 (1917), doi:10.1515/zpch-1918-9209.
    """

    scale: float = 1.0
    name: ClassVar[str] = "constant"
    formula: ClassVar[str] = "scale"
    reference: ClassVar[str] = "M. v. Smoluchowski, Z. Phys. Chem. 92, 129 (1917)"
    cheap: ClassVar[bool] = True
    exact: ClassVar[str | None] = "constant"
    rate: ClassVar[Callable[..., Any]] = staticmethod(_rate)

    def __post_init__(self) -> None:
        check_parameters(self, zero=True)

    @property
    def degree(self) -> float:
        return 0.0

    @property
    def gels(self) -> bool:
        return False

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        """See `Kernel.bounds`; the law itself."""
        value = np.full(np.broadcast(a, b, c, d).shape, float(self.scale))
        return value, value.copy()

    def low_rank_factors(self, sizes: Float) -> tuple[Float, Float]:
        """See `Kernel.low_rank_factors`; rank 1."""
        one = np.ones((1, len(sizes)))
        return self.scale * one, one

    def majorant(self) -> Majorant:
        """See `Kernel.majorant`; the law itself."""
        return Majorant(((self.scale / 2, 0.0, 0.0),), least=1.0)
