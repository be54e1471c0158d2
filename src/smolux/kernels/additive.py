"""The additive kernel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .base import Float, Kernel, check_parameters, corners
from .majorant import Majorant


def _rate(i: Any, j: Any, scale: Any) -> Any:
    return scale * (i + j)


@dataclass(frozen=True)
class Additive(Kernel):
    """Sum of the sizes: ``K(i, j) = scale (i + j)``.

    Parameters
    ----------
    scale : float
        Prefactor, volume per time.

    References
    ----------
    A. M. Golovin, Dokl. Akad. Nauk SSSR 148, 1290 (1963).
    """

    scale: float = 1.0
    name: ClassVar[str] = "additive"
    formula: ClassVar[str] = "scale * (i + j)"
    reference: ClassVar[str] = "A. M. Golovin, Dokl. Akad. Nauk SSSR 148, 1290 (1963)"
    cheap: ClassVar[bool] = True
    exact: ClassVar[str | None] = "additive"
    rate: ClassVar[Callable[..., Any]] = staticmethod(_rate)

    def __post_init__(self) -> None:
        check_parameters(self)

    @property
    def degree(self) -> float:
        return 1.0

    @property
    def gels(self) -> bool:
        return False

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        """See `Kernel.bounds`; the law grows with either size."""
        return corners(self, (a, c), (b, d))

    def low_rank_factors(self, sizes: Float) -> tuple[Float, Float]:
        """See `Kernel.low_rank_factors`; rank 2."""
        one = np.ones(len(sizes))
        return self.scale * np.array([sizes, one]), np.array([one, sizes])

    def majorant(self) -> Majorant:
        """See `Kernel.majorant`; the law itself, ``A(i, j) = scale i``."""
        return Majorant(((self.scale, 1.0, 0.0),), least=1.0)
