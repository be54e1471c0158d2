"""The Brownian kernel of the transition regime, by matched fluxes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from smolux.functions.content import frozen

from .transition import Transition, mobility, width


def _shell(free: Any) -> Any:
    """Fuchs's distance over the diameter, of a mean free path of `free` diameters.

    ``((1 + u)^3 - (1 + u^2)^{3/2}) / (3 u) - 1``, written so that no digits are lost for small u.
    """
    straight, bent = 1.0 + free, np.sqrt(1.0 + free * free)
    both = straight + bent
    return (both - straight * bent / both) / 1.5 - 1.0


def _rate(
    i: Any, j: Any, diameter: Any, diffusivity: Any, speed: Any, knudsen: Any,
    slip_a: Any, slip_b: Any, slip_c: Any, dimension: Any, prefactor: Any,
) -> Any:  # fmt: skip
    x, y = width(i, dimension, prefactor), width(j, dimension, prefactor)
    p = diffusivity * mobility(x, knudsen, slip_a, slip_b, slip_c)
    q = diffusivity * mobility(y, knudsen, slip_a, slip_b, slip_c)
    one, two = speed / i, speed / j  # the squares of the mean speeds
    g = x * _shell(8.0 / math.pi * p / (np.sqrt(one) * (diameter * x)))
    h = y * _shell(8.0 / math.pi * q / (np.sqrt(two) * (diameter * y)))
    reach = diameter * (x + y)
    shell = reach + 2.0 * diameter * np.sqrt(g * g + h * h)
    diffusing = 2.0 * math.pi * (p + q) * shell
    flying = 0.25 * math.pi * reach * reach * np.sqrt(one + two)
    return 1.0 / (1.0 / diffusing + 1.0 / flying)


@dataclass(frozen=True)
class Fuchs(Transition):
    """Brownian particles in a gas, from free flight to the continuum, in m³/s.

    ``K = 2 pi (D_i + D_j) d / (d/(d + 2 g) + 8 (D_i + D_j)/(c d))`` with ``d = d_i + d_j``,
    ``g = sqrt(g_i^2 + g_j^2)`` and ``c = sqrt(c_i^2 + c_j^2)``. For each particle: the diameter
    ``d_k = monomer_diameter (k/prefactor)^{1/dimension}``, the mean speed
    ``c_k = sqrt(8 k_B T/(pi m_k))``, the diffusivity ``D_k = k_B T s_k/(3 pi viscosity d_k)`` with
    the slip ``s_k = 1 + Kn (slip_a + slip_b exp(-slip_c/Kn))``, ``Kn = 2 mean_free_path/d_k``, the
    path ``l_k = 8 D_k/(pi c_k)`` and the distance
    ``g_k = ((d_k + l_k)^3 - (d_k^2 + l_k^2)^{3/2})/(3 d_k l_k) - d_k``, which has no root of two.

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
    dimension : float
        Fractal dimension, from 1 to 3. The diameter that collides is taken for the one that
        diffuses.
    prefactor : float
        Fractal prefactor: a cluster of diameter d has ``prefactor (d/monomer_diameter)^dimension``
        monomers.
    viscosity : float, optional
        Of the gas, in Pa s; of air at this temperature (Sutherland) if left out.
    mean_free_path : float, optional
        Of the gas, in m; of air, from the viscosity, if left out.
    slip_a, slip_b, slip_c : float
        Constants of the slip correction.

    References
    ----------
    N. A. Fuchs, The Mechanics of Aerosols (Pergamon, 1964), section 49; J. H. Seinfeld and
    S. N. Pandis, Atmospheric Chemistry and Physics, 2nd ed. (Wiley, 2006), table 13.1.
    """

    name: ClassVar[str] = "fuchs"
    formula: ClassVar[str] = (
        "2*pi*(Di + Dj)*d / (d/(d + 2*g) + 8*(Di + Dj)/(c*d)), d = di + dj, "
        "g = sqrt(gi**2 + gj**2), c = sqrt(ci**2 + cj**2)"
    )
    reference: ClassVar[str] = "N. A. Fuchs, The Mechanics of Aerosols (Pergamon, 1964), section 49"
    rate: ClassVar[Callable[..., Any]] = staticmethod(frozen(_rate))  # with what it calls
