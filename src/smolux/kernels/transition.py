"""Brownian particles in a gas, from free flight to the continuum: what its laws share."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from smolux.errors import InputError, Problem
from smolux.units import Length, MassDensity, Pressure, Temperature, Viscosity

from .base import BOLTZMANN, Kernel, check_positive

_GAS = 8.314462618  # J/(mol K)
_AIR = 0.0289647  # kg/mol


def viscosity_of_air(temperature: float) -> float:
    """Dynamic viscosity of air in Pa s, by Sutherland's formula."""
    return 1.8325e-5 * 416.16 / (temperature + 120.0) * (temperature / 296.16) ** 1.5


def mean_free_path_of_air(temperature: float, pressure: float, viscosity: float) -> float:
    """Mean free path of air in m, from its viscosity."""
    return 2.0 * viscosity / (pressure * math.sqrt(8.0 * _AIR / (math.pi * _GAS * temperature)))


def width(i: Any, dimension: Any, prefactor: Any) -> Any:
    """Diameter of a particle over that of the monomer."""
    return (i / prefactor) ** (1.0 / dimension)


def mobility(x: Any, knudsen: Any, slip_a: Any, slip_b: Any, slip_c: Any) -> Any:
    """Slip correction over the diameter ``x``, with the Knudsen number of ``x = 1``."""
    number = knudsen / x
    return (1.0 + number * (slip_a + slip_b * np.exp(-slip_c / number))) / x


@dataclass(frozen=True)
class Transition(Kernel):
    """A law of Brownian particles in a gas, of any Knudsen number.

    Its parameters are the physical quantities, in SI units; see `Fuchs`.
    """

    temperature: Temperature = 298.0
    pressure: Pressure = 101325.0
    density: MassDensity = 1000.0
    monomer_diameter: Length = 2e-9
    dimension: float = 3.0
    prefactor: float = 1.0
    viscosity: Viscosity | None = None
    mean_free_path: Length | None = None
    slip_a: float = 1.249
    slip_b: float = 0.42
    slip_c: float = 0.87

    def __post_init__(self) -> None:
        given = {f.name: getattr(self, f.name) for f in fields(self)}
        what = f"kernel {self.name!r}"
        check_positive(what, **{key: x for key, x in given.items() if x is not None})
        if not 1.0 <= self.dimension <= 3.0:
            where = f"{what}: dimension = {self.dimension!r}"
            raise InputError([Problem.at(f"{where}: must be from 1 to 3", "dimension")])
        if self.viscosity is None:
            object.__setattr__(self, "viscosity", viscosity_of_air(self.temperature))
        if self.mean_free_path is None:
            assert self.viscosity is not None
            path = mean_free_path_of_air(self.temperature, self.pressure, self.viscosity)
            object.__setattr__(self, "mean_free_path", path)

    @property
    def parameters(self) -> tuple[float, ...]:
        """See `Kernel.parameters`: what the quantities mean for monomers.

        Diameter, diffusivity without slip, mean square speed times ``8 / (3 pi)``, Knudsen number,
        the constants of slip, fractal dimension and prefactor.
        """
        assert self.viscosity is not None
        assert self.mean_free_path is not None
        d, energy = float(self.monomer_diameter), BOLTZMANN * self.temperature
        mass = self.density * math.pi / 6.0 * d**3
        return (
            d,
            energy / (3.0 * math.pi * self.viscosity * d),
            8.0 * energy / (math.pi * mass),
            2.0 * self.mean_free_path / d,
            float(self.slip_a),
            float(self.slip_b),
            float(self.slip_c),
            float(self.dimension),
            float(self.prefactor),
        )

    @property
    def gels(self) -> bool:
        """See `Kernel.gels`: never, as no rate exceeds that of free flight."""
        return False

    @property
    def monomer(self) -> dict[str, float]:
        return {"monomer_diameter": self.monomer_diameter, "density": self.density}
