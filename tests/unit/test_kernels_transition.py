"""Brownian particles in a gas of any Knudsen number: tables, limits, bounds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import smolux as sx
from smolux.case import parse
from smolux.errors import InputError
from smolux.kernels import Ballistic, Brownian, Dahneke, Fuchs, Kernel, from_dict

BOTH = (Fuchs, Dahneke)
each = pytest.mark.parametrize("law", BOTH)

#: rates in cm³/s of diameters in um, at 298 K and 101325 Pa, 1000 kg/m³, to the digits given
DIAMETERS = (0.002, 0.01, 0.1, 1, 10, 20)
TABLE = (
    (8.89e-10, 5.65e-9, 3.38e-7, 7.63e-6, 8.27e-5, 1.66e-4),
    (1.93e-9, 2.44e-8, 3.30e-7, 3.40e-6, 6.81e-6),
    (1.48e-9, 4.94e-9, 4.46e-8, 8.87e-8),
    (6.79e-10, 2.08e-9, 3.81e-9),
    (6.02e-10, 6.77e-10),
    (5.98e-10,),
)
#: J. H. Seinfeld and S. N. Pandis, Atmospheric Chemistry and Physics, table 13.3
PUBLISHED = {
    (0.002, 0.002): 8.9e-10, (0.002, 1): 7.8e-6, (0.002, 10): 8.5e-5, (0.002, 20): 17e-5,
    (1, 1): 6.9e-10, (1, 20): 3.9e-9, (20, 20): 6.0e-10,
}  # fmt: skip


def rate(law: Kernel, d: float, e: float) -> float:
    """Rate in cm³/s of two diameters in um, of monomers of 2 nm."""
    return float(law(*((x * 1e3 / 2.0) ** 3 for x in (d, e)))) * 1e6


def test_fuchs_of_the_table() -> None:
    for k, row in enumerate(TABLE):
        for d, expected in zip(DIAMETERS[k:], row, strict=True):
            assert rate(Fuchs(), DIAMETERS[k], d) == pytest.approx(expected, rel=5e-3, abs=0)


@each
def test_published_values(law: Any) -> None:
    tolerance = 0.03 if law is Fuchs else 0.045
    for pair, expected in PUBLISHED.items():
        assert rate(law(), *pair) == pytest.approx(expected, rel=tolerance, abs=0)


def test_dahneke_is_within_four_percent_of_fuchs() -> None:
    k = 2.0 ** np.arange(0.0, 43.0, 0.5)
    ratio = Dahneke()(k[:, None], k) / Fuchs()(k[:, None], k)
    assert np.abs(ratio - 1).max() < 0.04


@each
def test_limits(law: Any) -> None:
    """Of particles much larger and much smaller than the mean free path."""
    large = law(monomer_diameter=1e-3, viscosity=2e-5)
    continuum = Brownian.continuum(298.0, 2e-5)
    for i, j in ((1, 1), (1, 27), (5, 300)):
        assert float(large(i, j)) == pytest.approx(float(continuum(i, j)), rel=1e-3, abs=0)
    thin = law(pressure=1e-3, density=1800.0)
    free = Ballistic.free_molecular(298.0, 1800.0, np.pi / 6 * (2e-9) ** 3)
    for i, j in ((1, 1), (1, 27), (5, 300)):
        assert float(thin(i, j)) == pytest.approx(float(free(i, j)), rel=1e-6, abs=0)


@each
def test_between_the_harmonic_mean_and_free_flight(law: Any) -> None:
    kernel = law(density=8000.0)
    k = 2.0 ** np.arange(0.0, 45.0)
    x = np.cbrt(k)
    d, diffusivity, speed, number, *_ = kernel.parameters
    knudsen = number / x
    slip = 1 + knudsen * (1.249 + 0.42 * np.exp(-0.87 / knudsen))
    D = diffusivity * slip / x
    reach, both = d * (x[:, None] + x), D[:, None] + D
    slow = 2 * np.pi * both * reach
    free = np.pi / 4 * reach**2 * np.sqrt(speed / k[:, None] + speed / k)
    found = kernel(k[:, None], k)
    assert (found >= slow * free / (slow + free) * (1 - 1e-12)).all()
    assert (found <= free * (1 + 1e-12)).all()
    if law is Dahneke:
        assert (found <= slow * (1 + 1e-12)).all()
    else:
        path = 8 / np.pi * D / np.sqrt(speed / k)
        wider = 1 + 2 * np.sqrt(path[:, None] ** 2 + path**2) / reach
        assert (found <= slow * wider * (1 + 1e-12)).all()
        assert (found / slow).max() > 1.003  # more than the continuum


@each
def test_symmetric_positive_finite_for_all_sizes(law: Any) -> None:
    k = 2.0 ** np.arange(0.0, 62.1)
    for given in (
        {}, {"dimension": 1.0}, {"dimension": 1.8, "prefactor": 1.3}, {"pressure": 1e-3},
        {"pressure": 1e9, "monomer_diameter": 1e-3},
    ):  # fmt: skip
        found = law(**given)(k[:, None], k)
        assert np.isfinite(found).all()
        assert (found > 0).all()
        np.testing.assert_allclose(found, found.T, rtol=1e-13)


@each
def test_bounds_are_proved_and_close(law: Any) -> None:
    kernel = law()
    assert kernel.rigorous
    edges = 2.0 ** np.array([0.0, 1, 10, 20, 30, 61])
    lower, upper = kernel.bounds(edges[:, None], 2 * edges[:, None], edges, 2 * edges)
    inner = edges[:, None] * 2.0 ** np.linspace(0, 1, 17)
    found = kernel(inner[:, None, :, None], inner[None, :, None, :])
    assert (lower <= found.min(axis=(2, 3))).all()
    assert (found.max(axis=(2, 3)) <= upper).all()
    assert (upper <= 1.1 * found.max(axis=(2, 3))).all()


@each
def test_one_rate_on_numbers_and_arrays(law: Any) -> None:
    kernel = law(dimension=2.0, prefactor=1.2)
    k = np.array([1.0, 7.0, 1e6])
    one = [float(kernel.rate(x, 3.0, *kernel.parameters)) for x in k]
    np.testing.assert_allclose(kernel(k, 3.0), one, rtol=1e-13)


def test_fractal_clusters_of_one_size_are_spheres() -> None:
    # 64 monomers in a cluster of 8 diameters: as if the monomer were a lighter, wider sphere
    loose = Fuchs(dimension=2.0)
    sphere = Fuchs(monomer_diameter=2e-9 * 8, density=1000.0 * 64 / 8**3)
    assert float(loose(64, 64)) == pytest.approx(float(sphere(1, 1)), rel=1e-12, abs=0)


@each
def test_plain_data(law: Any) -> None:
    kernel = law(temperature=310.0, pressure=9e4, dimension=1.8)
    assert from_dict(kernel.to_dict()) == kernel
    assert kernel.problems() == []
    assert kernel.describe()["mean_free_path"] == pytest.approx(7.9e-8, rel=0.02)
    assert float((2 * kernel)(3, 5)) == pytest.approx(2 * float(kernel(3, 5)), abs=0)


def test_in_a_case_file_with_units() -> None:
    text = (
        '[kernel]\nname = "fuchs"\ntemperature = "25 degC"\nmonomer_diameter = "1 nm"\n'
        'density = "1.8 g/cm^3"\n[initial]\ndensity = "1e6 cm^-3"\n[run]\ntimes = ["1 s"]\n'
    )
    case = parse(text)
    assert case.model.kernel == Fuchs(298.15, density=1800.0, monomer_diameter=1e-9)
    assert parse(case.to_toml()) == case


def test_kernels_of_different_monomers_do_not_add() -> None:
    both = Fuchs() + 0.5 * Dahneke() + sx.kernels.Shear(1e-20)
    assert both.monomer == {"monomer_diameter": 2e-9, "density": 1000.0}
    with pytest.raises(InputError, match=r"monomer_diameter = 2e-09 of 'fuchs' and 3e-09"):
        Fuchs() + Dahneke(monomer_diameter=3e-9)
    with pytest.raises(InputError, match=r"density = 1000 of 'fuchs' and 900 of 'fuchs'"):
        both + Fuchs(density=900.0) * "1 + t"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"temperature": -1.0}, "temperature = -1.0: must be a positive finite number"),
        ({"density": "x"}, "density = 'x'"),
        ({"dimension": 3.5}, "dimension = 3.5: must be from 1 to 3"),
        ({"viscosity": 0.0}, "viscosity = 0.0"),
    ],
)
@each
def test_wrong_quantities(law: Any, given: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        law(**given)
