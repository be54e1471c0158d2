"""The bilinear kernel."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from smolux.checks import is_number
from smolux.errors import InputError, Problem
from smolux.units import CollisionRate

from .base import Float, Kernel, check_parameters, check_positive, corners
from .majorant import Majorant


def _rate(i: Any, j: Any, A: Any, B: Any, scale: Any) -> Any:
    return scale * (1.0 + A * (i + j) + B * (i * j))


@dataclass(frozen=True)
class Bilinear(Kernel):
    """Condensation polymers: ``K(i, j) = scale (1 + A (i + j) + B i j)``; gels for ``B > 0``.

    Parameters
    ----------
    A, B : float
        Coefficients, zero or more.
    scale : float
        Prefactor, volume per time.

    References
    ----------
    J. L. Spouge, J. Phys. A 16, 767 (1983), doi:10.1088/0305-4470/16/4/014.
    """

    A: float
    B: float
    scale: float = 1.0
    name: ClassVar[str] = "bilinear"
    formula: ClassVar[str] = "scale * (1 + A*(i + j) + B*(i*j))"
    reference: ClassVar[str] = "J. L. Spouge, J. Phys. A 16, 767 (1983)"
    constructors: ClassVar[tuple[str, ...]] = ("functional",)
    cheap: ClassVar[bool] = True
    exact: ClassVar[str | None] = "bilinear"
    example: ClassVar[dict[str, float]] = {"A": 0.3, "B": 0.2}
    rate: ClassVar[Callable[..., Any]] = staticmethod(_rate)

    def __post_init__(self) -> None:
        # Below 1e100 nothing overflows for sizes up to 2**62.
        check_parameters(self, A=(0.0, 1e100), B=(0.0, 1e100))

    @classmethod
    def functional(cls, groups: CollisionRate, functionality: float = 3.0) -> Bilinear:
        """Monomers of f equal groups that react alike, ``K = groups ((f-2) i + 2)((f-2) j + 2)``.

        Parameters
        ----------
        groups : float
            Rate at which two groups react, in m³/s.
        functionality : float
            Number of groups f of a monomer, at least 2.

        Notes
        -----
        The polymers are trees without rings, RA_f; from monomers of density n they gel at
        ``1/(groups n f (f - 2))``. After that the law, solved or simulated, holds no bonds within
        the gel: its sol is smaller than that of Flory, who counts them. W. H. Stockmayer, J. Chem.
        Phys. 11, 45 (1943), doi:10.1063/1.1723803.
        """
        check_positive("Bilinear.functional", groups=groups)
        if not (is_number(functionality) and 2.0 <= functionality <= 1e6):
            where = f"Bilinear.functional: functionality = {functionality!r}"
            raise InputError([Problem.at(f"{where}: must be from 2 to 1e6", "functionality")])
        more = 0.5 * (functionality - 2.0)
        return cls(more, more * more, 4.0 * groups)

    @property
    def degree(self) -> float | None:
        """See `Kernel.degree`; homogeneous only if both coefficients are zero."""
        return 0.0 if self.A == self.B == 0 else None

    @property
    def gels(self) -> bool:
        return self.B > 0

    def gel_time(self) -> float | None:
        """See `Kernel.gel_time`; the second moment obeys ``M2' = 1 + 2 A M2 + B M2^2``."""
        if not self.gels:
            return None
        # The integral of 1 / (1 + 2 A m + B m**2) from 1 to infinity, by the sign of A**2 - B.
        gap, total = self.A * self.A - self.B, self.A + self.B
        root = math.sqrt(abs(gap))
        if root < 1e-8 * total:
            integral = 1.0 / total
        elif gap < 0:
            integral = math.atan(root / total) / root
        elif root < 0.5 * total:
            integral = math.atanh(root / total) / root
        else:  # the same, without the cancellation for small B
            rest = math.sqrt(self.B * (1.0 + 2.0 * self.A + self.B))
            integral = math.log((total + root) / rest) / root
        return integral / self.scale

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        """See `Kernel.bounds`; the law grows with either size."""
        return corners(self, (a, c), (b, d))

    def low_rank_factors(self, sizes: Float) -> tuple[Float, Float]:
        """See `Kernel.low_rank_factors`; rank 2."""
        one = np.ones(len(sizes))
        left = np.array([one + self.A * sizes, self.A + self.B * sizes])
        return self.scale * left, np.array([one, sizes])

    def majorant(self) -> Majorant:
        """See `Kernel.majorant`; the law itself."""
        terms = ((0.5, 0.0, 0.0), (self.A, 1.0, 0.0), (0.5 * self.B, 1.0, 1.0))
        return Majorant(tuple((self.scale * w, p, q) for w, p, q in terms if w > 0), least=1.0)
