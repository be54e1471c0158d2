"""A particle loses a monomer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from smolux.checks import is_number
from smolux.errors import InputError

from .base import Float, RatedBySize, UnaryProcess
from .daughters import Detached


def _evaporate(k: int, part: int, sizes: Any, counts: Any) -> int:
    if k == 2:
        sizes[0], counts[0] = 1, 2
        return 1
    sizes[0], counts[0] = k - 1, 1
    sizes[1], counts[1] = 1, 1
    return 2


@dataclass(frozen=True)
class Evaporation(RatedBySize, UnaryProcess):
    """Particles lose monomers: ``(k) -> (k - 1) + (1)`` at the rate ``E_k``, for k from 2 on.

    ``dn_k/dt = E_{k+1} n_{k+1} - E_k n_k`` for k > 1, and
    ``dn_1/dt = E_2 n_2 + sum_{k>1} E_k n_k``.

    Parameters
    ----------
    rate : float, str, callable or sequence of float
        ``E_k``: a number, a formula in k such as ``"k**(2/3)"``, a function of the size, or the
        values for k = 1, 2, ... (of which the first is not used, and the last holds beyond).
    varying : float, callable or str
        A function of time by which the rate is multiplied.
    label : str, optional
        What it is called in results, if not by its name.

    References
    ----------
    A. Kolodko and K. Sabelfeld, WIAS Preprint 842 (2003), eq. (15); R. Becker and W. Döring, Ann.
    Phys. 416, 719 (1935), doi:10.1002/andp.19354160806.
    """

    rate: Any
    varying: Any = 1.0
    name: ClassVar[str] = "evaporation"
    least: ClassVar[int] = 2
    outcome: ClassVar[Callable[..., Any]] = staticmethod(_evaporate)
    #: what the fields are functions of, beside plain numbers
    variables: ClassVar[Mapping[str, str]] = {"rate": "k", "varying": "t"}

    def __post_init__(self) -> None:
        _ = self.factor, self.of_size

    @property
    def entries(self) -> int:
        return 2

    def rates(self, sizes: Float) -> Float:
        return np.where(sizes > 1.0, self.of_size(sizes), 0.0)

    @property
    def daughters(self) -> Detached:
        return Detached(1)

    @classmethod
    def free_molecular(
        cls, ratio: float, steepness: float, *, printed: bool = False
    ) -> Evaporation:
        """Make the rates of small drops in the free-molecular regime, dimensionless.

        For a kernel scaled so that ``K(1, 1) = 1``, monomers of unit density at the start and time
        in units of their mean collision time:
        ``E_k = ratio (K(1, k) / K(1, 2)) exp(steepness (k**(2/3) - (k-1)**(2/3) - 2**(2/3) + 1))``.

        Parameters
        ----------
        ratio : float
            β, the rate ``E_2`` times the collision time.
        steepness : float
            A, the surface energy of a monomer over the thermal energy.
        printed : bool
            Leave out the ratio of the kernels, as eq. (18) of the paper does; see the errata.

        References
        ----------
        A. Kolodko and K. Sabelfeld, WIAS Preprint 842 (2003), eqs. (15) to (18).
        """
        problems = [
            f"{name} = {value!r}: must be a finite number, zero or more"
            for name, value in (("ratio", ratio), ("steepness", steepness))
            if not (is_number(value) and 0.0 <= value < np.inf)
        ]
        if problems:
            raise InputError(problems)
        energy = f"exp({steepness!r} * (k**(2/3) - (k - 1)**(2/3) - 2**(2/3) + 1))"
        kernel = "(1 + cbrt(k))**2 * sqrt(1 + 1/k) / ((1 + cbrt(2))**2 * sqrt(1.5))"
        return cls(f"{ratio!r} * {energy}" if printed else f"{ratio!r} * {kernel} * {energy}")
