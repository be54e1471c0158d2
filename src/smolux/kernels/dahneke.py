"""The Brownian kernel of the transition regime, by Dahneke's interpolation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from smolux.functions.content import frozen

from .transition import Transition, mobility, width


def _rate(
    i: Any, j: Any, diameter: Any, diffusivity: Any, speed: Any, knudsen: Any,
    slip_a: Any, slip_b: Any, slip_c: Any, dimension: Any, prefactor: Any,
) -> Any:  # fmt: skip
    x, y = width(i, dimension, prefactor), width(j, dimension, prefactor)
    p = mobility(x, knudsen, slip_a, slip_b, slip_c)
    q = mobility(y, knudsen, slip_a, slip_b, slip_c)
    both = diffusivity * (p + q)
    reach = diameter * (x + y)
    # with the path over the radius of contact: K = 2 pi D d (1 + x)/(1 + 2 x (1 + x))
    free = 4.0 * both / (reach * np.sqrt(speed / i + speed / j))
    return 2.0 * math.pi * both * reach / (1.0 / (1.0 + free) + 2.0 * free)


@dataclass(frozen=True)
class Dahneke(Transition):
    """Brownian particles in a gas, from free flight to the continuum, in m³/s; as `Fuchs`.

    ``K = 2 pi (D_i + D_j) d (1 + x)/(1 + 2 x (1 + x))`` with ``x = 4 (D_i + D_j)/(c d)``,
    ``d = d_i + d_j`` and ``c = sqrt(c_i^2 + c_j^2)``. It exceeds neither the law of the continuum
    with slip nor that of free flight. Diameters, diffusivities and speeds are those of `Fuchs`,
    from which it differs by less than 4 %.

    Parameters
    ----------
    temperature : float
        Of the gas, in K.
    pressure : float
        In Pa.
    density : float
        Of the material of the particles, in kg/m³.
    monomer_diameter : float
        In m.
    dimension, prefactor : float
        See `Fuchs`.
    viscosity : float, optional
        Of the gas, in Pa s; of air if left out.
    mean_free_path : float, optional
        Of the gas, in m; of air if left out.
    slip_a, slip_b, slip_c : float
        Constants of the slip correction, see `Fuchs`.

    References
    ----------
    B. Dahneke, Simple kinetic theory of Brownian diffusion in vapors and aerosols, in: R. E. Meyer
    (ed.), Theory of Dispersed Multiphase Flow (Academic Press, 1983), 97-133; J. H. Seinfeld and
    S. N. Pandis, Atmospheric Chemistry and Physics, 2nd ed. (Wiley, 2006), table 13.1.
    """

    name: ClassVar[str] = "dahneke"
    formula: ClassVar[str] = (
        "2*pi*(Di + Dj)*d * (1 + x)/(1 + 2*x*(1 + x)), d = di + dj, "
        "x = 4*(Di + Dj)/(d*sqrt(ci**2 + cj**2))"
    )
    reference: ClassVar[str] = "B. Dahneke, in: Theory of Dispersed Multiphase Flow (1983), 97-133"
    rate: ClassVar[Callable[..., Any]] = staticmethod(frozen(_rate))  # with what it calls
