"""Laws of the registry: bounds, symmetry, degree, factors, formula, gelation, SI constructors."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate

from smolux import exact, kernels
from smolux.errors import InputError
from smolux.kernels import KERNELS, Kernel

#: some units in the last place: NumPy, Python and processors differ by so much
ROUNDING = 1e-14

quick = settings(max_examples=20, deadline=None, derandomize=True)

#: every law, several with more than one set of parameters; a scale of one hides what lacks it
LAWS: list[Kernel] = [
    law(**law.example, scale=2.5) for law in KERNELS if "scale" in law.__dataclass_fields__
] + [
    kernels.Bilinear(0.0, 0.0, scale=3.0),
    kernels.Bilinear(2.0, 0.0, scale=0.1),
    kernels.Product(-0.7, scale=0.3),
    kernels.Product(1.5, scale=3.0),
    kernels.Brownian(1.8, scale=3.0),
    kernels.GeneralizedBrownian(-0.3, scale=0.3),
    kernels.GeneralizedBrownian(2.0, scale=3.0),
    kernels.Sedimentation(1e-17),
    kernels.Clusters(2.1, 0.25, 30.0, scale=3.0),
    kernels.Clusters(2.1, 0.6, 1e6, scale=3.0),
]
every_law = pytest.mark.parametrize("law", LAWS, ids=repr)

edge = st.floats(0.0, 43.0).map(lambda x: float(np.clip(np.exp(x), 1.0, 2.0**62)))


@st.composite
def boxes(draw: Any) -> tuple[float, float, float, float]:
    a, b = sorted((draw(edge), draw(edge)))
    c, d = sorted((draw(edge), draw(edge)))
    return a, b, c, d


def points(low: float, high: float, number: int = 41) -> np.ndarray:
    """The ends, and points between in equal ratios; the whole sizes where there are few."""
    inner = np.clip(np.exp(np.linspace(np.log(low), np.log(high), number)), low, high)
    return np.unique(np.concatenate([[low, high], inner]))


@every_law
@quick
@given(box=boxes())
def test_bounds_contain_the_law_and_are_tight(law: Kernel, box: tuple[float, ...]) -> None:
    a, b, c, d = box
    values = law(points(a, b)[:, None], points(c, d))
    lower, upper = law.bounds(a, b, c, d)
    assert lower <= values.min()
    assert values.max() <= upper
    # The maximum of every law lies in a corner, but for sedimentation, and on the grid nearly.
    assert upper <= values.max() * 1.06
    if a > 8 * d or c > 8 * b:  # the ranges are well apart
        assert lower >= values.min() * (1 - 1e-9)


def test_lower_bounds_are_attained() -> None:
    # Near the diagonal, where the least values lie inside; found on a fine grid.
    for law in LAWS:
        for a, b, c, d in ((1, 10, 1, 10), (3, 30, 8, 90), (20, 25, 10, 16), (5, 5, 2, 50)):
            fine = law(np.arange(a, b + 0.1, 0.125)[:, None], np.arange(c, d + 0.1, 0.125))
            lower, upper = law.bounds(a, b, c, d)
            assert lower == pytest.approx(fine.min(), rel=2e-3, abs=1e-12 * law.parameters[-1])
            assert upper == pytest.approx(fine.max(), rel=2e-3)


@every_law
def test_bounds_broadcast(law: Kernel) -> None:
    edges = 2.0 ** np.arange(6)
    lower, upper = law.bounds(edges[:, None], 2 * edges[:, None], edges, 2 * edges)
    assert lower.shape == upper.shape == (6, 6)
    one = law.bounds(edges[2], 2 * edges[2], edges[4], 2 * edges[4])
    # NumPy's loops over arrays may round otherwise than those over single numbers
    np.testing.assert_allclose((lower[2, 4], upper[2, 4]), one, rtol=ROUNDING)
    assert law.rigorous is True


@every_law
@quick
@given(i=edge, j=edge)
def test_symmetric_positive_finite(law: Kernel, i: float, j: float) -> None:
    assert np.isfinite(law(i, j))
    assert law(i, j) >= 0
    assert law(i, j) == pytest.approx(float(law(j, i)), rel=1e-12)


@every_law
@quick
@given(i=st.integers(1, 10**6), j=st.integers(1, 10**6), c=st.floats(1.0, 1e6))
def test_homogeneous(law: Kernel, i: int, j: int, c: float) -> None:
    if law.degree is None:
        assert isinstance(law, kernels.Bilinear)
        return
    # Rounding of c i moves the difference of nearly equal sizes.
    slack = 1e-9 * float(kernels.Shear(law.parameters[-1])(c * i, c * j) * (c * (i + j)) ** (1 / 3))
    slack = slack if isinstance(law, kernels.Sedimentation) else 0.0
    expected = c**law.degree * float(law(i, j))
    assert float(law(c * i, c * j)) == pytest.approx(expected, rel=1e-11, abs=slack)


@every_law
def test_formula_is_the_rate(law: Kernel) -> None:
    parameters = {k: v for k, v in law.to_dict().items() if k != "name"}
    used = kernels.formula(law.formula, **parameters)
    i = np.array([1.0, 2, 3, 7, 50, 1e4, 1e9])
    # The formula of sedimentation loses digits for nearly equal sizes; here they are not.
    np.testing.assert_allclose(used(i[:, None], i), law(i[:, None], i), rtol=1e-13)


@every_law
def test_rate_takes_numbers_and_arrays(law: Kernel) -> None:
    i = np.array([1.0, 2.0, 5.0])
    one = [float(law.rate(x, 3.0, *law.parameters)) for x in i]
    np.testing.assert_allclose(law(i, 3), one, rtol=ROUNDING)
    assert law(i, 3).shape == (3,)
    assert law(2, 3).shape == ()
    assert len(law.parameters) == len(law.to_dict()) - 1


@every_law
def test_factors(law: Kernel) -> None:
    sizes = np.arange(1.0, 400)
    found = law.low_rank_factors(sizes)
    ranks = {
        "constant": 1, "additive": 2, "multiplicative": 1, "bilinear": 2, "product": 1,
        "brownian": 3, "generalized-brownian": 2, "shear": 4, "clusters": 3,
    }  # fmt: skip
    if law.name not in ranks:
        assert found is None
        return
    assert found is not None
    u, v = found
    assert u.shape == v.shape == (ranks[law.name], len(sizes))
    np.testing.assert_allclose(u.T @ v, law(sizes[:, None], sizes), rtol=1e-12)


@every_law
def test_plain_data_and_pickle(law: Kernel) -> None:
    assert kernels.from_dict(law.to_dict()) == law
    assert pickle.loads(pickle.dumps(law)) == law
    assert hash(law) == hash(kernels.from_dict(law.to_dict()))
    assert law.describe()["formula"] == law.formula
    assert law.problems(1.0) == []
    assert law.problems(2.0**62) == []


def test_registry() -> None:
    names = [law.name for law in KERNELS]
    assert names == [
        "constant", "additive", "multiplicative", "bilinear", "product", "ballistic", "brownian",
        "generalized-brownian", "shear", "sedimentation", "fuchs", "dahneke", "long", "clusters",
    ]  # fmt: skip
    assert {law.name for law in KERNELS if law.exact} == set(names[:4])
    assert {law.name for law in KERNELS if law.cheap} == set(names[:4])
    assert all(law.reference for law in KERNELS)


def test_values_by_hand() -> None:
    assert kernels.Additive(2.0)(3, 4) == 14
    assert kernels.Multiplicative(0.5)(3, 4) == 6
    assert kernels.Bilinear(0.5, 0.25)(2, 3) == 1 + 2.5 + 1.5
    assert kernels.Product(0.5)(4, 9) == 6
    assert float(kernels.Ballistic()(8, 8)) == pytest.approx(16 * 0.5)
    assert float(kernels.Brownian()(1, 8)) == pytest.approx(3 * 1.5)
    assert float(kernels.Brownian(2.0)(1, 9)) == pytest.approx(4 * 4 / 3)
    assert float(kernels.GeneralizedBrownian(0.5)(1, 4)) == pytest.approx(2.5)
    assert float(kernels.Shear()(1, 8)) == pytest.approx(27)
    assert float(kernels.Sedimentation()(1, 8)) == pytest.approx(27)
    # Nearly equal sizes: the derivative of x**(2/3) tells; no digit is lost.
    i = 2.0**40
    near = float(kernels.Sedimentation()(i, i + 1))
    expected = 4 * i ** (2 / 3) * (2 / 3) * i ** (-1 / 3)
    assert near == pytest.approx(expected, rel=1e-11)


def test_gelation() -> None:
    for law in LAWS:
        assert law.gels is not None
        assert law.gels or law.gel_time() is None
    assert not any(
        kernel.gels
        for kernel in (kernels.Additive(), kernels.Shear(), kernels.Ballistic(), kernels.Brownian())
    )
    assert kernels.Multiplicative(4.0).gel_time() == 0.25
    assert kernels.Product(1.0, 4.0).gel_time() == 0.25
    assert (kernels.Product(0.5).gels, kernels.Product(0.6).gels) == (False, True)
    assert kernels.Product(0.6).gel_time() is None
    assert kernels.Product(1.2).gel_time() == 0.0
    assert kernels.Sedimentation().gel_time() == 0.0
    assert kernels.GeneralizedBrownian(0.95).gels is False
    assert kernels.GeneralizedBrownian(-1.2).gel_time() == 0.0


@pytest.mark.parametrize(
    ("A", "B"),
    [
        (0.5, 0.25),
        (0.3, 0.2),
        (1, 0.5),
        (0, 0.3),
        (3, 1e-6),
        (0.5, 0.25 + 1e-13),
        (0, 1),
        (5, 24.9),
    ],
)
def test_gel_time_of_the_bilinear_kernel(A: float, B: float) -> None:
    def integrand(x: float) -> float:  # in x = log(m)
        return 1 / (math.exp(-x) + 2 * A + B * math.exp(x))

    expected = integrate.quad(integrand, 0, 60, limit=500, epsrel=1e-12)[0]
    assert kernels.Bilinear(A, B, 2.0).gel_time() == pytest.approx(expected / 2, rel=1e-9)


def test_gel_time_of_the_bilinear_kernel_in_closed_form() -> None:
    assert kernels.Bilinear(0.5, 0.25).gel_time() == pytest.approx(4 / 3, rel=1e-14)
    assert kernels.Bilinear(1.0, 0.0).gel_time() is None


def test_functional_monomers() -> None:
    """Stockmayer 1943: ``t = 1/(f (f-2))``; and the number there, ``(f-2)/(2 (f-1))``."""
    for f in (3.0, 4.0, 7.0):
        law = kernels.Bilinear.functional(0.5, f)
        assert float(law(3, 5)) == pytest.approx(0.5 * ((f - 2) * 3 + 2) * ((f - 2) * 5 + 2))
        assert law.gel_time() == pytest.approx(2 / (f * (f - 2)), rel=1e-12)
        t = law.gel_time() * np.array([0.5, 1.0 - 1e-12])
        number = (f / (1 + f * t / 2) - (f - 2)) / 2
        assert number[1] == pytest.approx((f - 2) / (2 * (f - 1)))
        found = exact.Bilinear(A=law.A, B=law.B, scale=law.scale).moment(t, 0)
        np.testing.assert_allclose(found, number, rtol=1e-9)
    assert kernels.Bilinear.functional(1.0, 2.0) == kernels.Bilinear(0.0, 0.0, 4.0)
    with pytest.raises(InputError, match=r"functionality = 1\.5: must be from 2"):
        kernels.Bilinear.functional(1.0, 1.5)


K_B = 1.380649e-23


def close(value: float, rel: float = 1e-12) -> Any:
    """Rates in SI units are far below the absolute tolerance of pytest."""
    return pytest.approx(float(value), rel=rel, abs=0.0)


def test_brownian_in_si_units() -> None:
    # 293.15 K in air, 1.82e-5 Pa s: K(1, 1) = 8 k T / (3 mu) = 5.93e-16 m³/s
    law = kernels.Brownian.continuum(293.15, 1.82e-5)
    assert float(law(1, 1)) == close(8 * K_B * 293.15 / (3 * 1.82e-5), rel=1e-14)
    assert float(law(1, 1)) == close(5.930e-16, rel=1e-3)
    # From radii and Stokes-Einstein diffusivities, of any monomer
    radius = 3e-7 * np.cbrt([2.0, 5.0])
    diffusivity = K_B * 293.15 / (6 * math.pi * 1.82e-5 * radius)
    assert float(law(2, 5)) == close(4 * math.pi * diffusivity.sum() * radius.sum())
    assert kernels.Brownian.continuum(293.15, 1.82e-5, 1.8).dimension == 1.8


def test_clusters() -> None:
    limited = kernels.Clusters.in_fluid(293.15, 1.82e-5)
    assert float(limited(3, 50)) == close(
        float(kernels.Brownian.continuum(293.15, 1.82e-5, 1.8)(3, 50)), rel=1e-14
    )
    slow = kernels.Clusters.in_fluid(293.15, 1.82e-5, stability=1e5, exponent=0.5, dimension=2.1)
    assert float(slow(1, 1)) == close(float(limited(1, 1)) / 1e5, rel=1e-14)
    assert float(slow(4, 9)) == close(float(slow(1, 2.25)) * 4, rel=1e-13)
    assert (slow.degree, slow.gels) == (1.0, False)
    assert kernels.Clusters(1.8, 0.5).gel_time() == 0.0
    assert (kernels.Clusters(4.0, 0.6).gels, kernels.Clusters(4.0, 0.6).gel_time()) == (True, None)


def test_ballistic_in_si_units() -> None:
    # Cross section times mean relative speed, from masses and radii
    temperature, density, volume = 300.0, 2200.0, 4e-27
    law = kernels.Ballistic.free_molecular(temperature, density, volume)
    i = np.array([2.0, 5.0])
    radius, mass = np.cbrt(3 * i * volume / (4 * math.pi)), density * i * volume
    speed = math.sqrt(8 * K_B * temperature / math.pi * (1 / mass).sum())
    assert float(law(2, 5)) == close(math.pi * radius.sum() ** 2 * speed, rel=1e-13)


def test_shear_in_si_units() -> None:
    # Gradient 10 1/s, spheres of 1 µm radius: (4/3) G (2 r)**3 = 1.0667e-16 m³/s
    law = kernels.Shear.laminar(10.0, 4 / 3 * math.pi * 1e-18)
    assert float(law(1, 1)) == close(4 / 3 * 10 * 8e-18, rel=1e-13)


def test_turbulent_shear_in_si_units() -> None:
    # Jacobson 2005, figure 15.7: 298 K, 1e5 Pa, 5e-4 m²/s³, radii of 10 µm and 20.08 nm, 5.228 µm
    viscosity, density = 1.8415e-5, 1e5 * 0.0289647 / (8.314462618 * 298)
    law = kernels.Shear.turbulent(5e-4, viscosity, density, 4 / 3 * math.pi * 1e-24)
    for radius, expected, read in ((20.08e-9, 7.34e-9, 6.70e-9), (5.228e-6, 2.575e-8, 2.51e-8)):
        found = float(law((10e-6 / 1e-8) ** 3, (radius / 1e-8) ** 3)) * 1e6  # cm³/s
        assert found == close(expected, rel=5e-3)
        assert found == close(read, rel=0.1)
    assert law.scale / 1e-24 == close(1.2944 * math.sqrt(5e-4 * density / viscosity), rel=1e-4)


def test_sedimentation_in_si_units() -> None:
    # Quartz in water, 5 µm: u = 2/9 1650 9.80665 25e-12 / 1e-3 = 8.99e-5 m/s
    law = kernels.Sedimentation.stokes(1650.0, 1e-3, 5e-6)
    speed = 2 / 9 * 1650 * 9.80665 * 25e-12 / 1e-3
    assert speed == close(8.99e-5, rel=1e-3)
    expected = math.pi * (15e-6) ** 2 * speed * 3  # radius of eight monomers 10 µm, 4 u
    assert float(law(1, 8)) == close(expected, rel=1e-13)
    assert kernels.Sedimentation.stokes(-1650.0, 1e-3, 5e-6) == law


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: kernels.Constant(-1.0), ["'constant': scale = -1.0: must be zero or more"]),
        (lambda: kernels.Additive(0), ["scale = 0: must be positive"]),
        (
            lambda: kernels.Bilinear(-1, math.nan),
            ["A = -1: must be from 0", "B = nan: must be"],
        ),
        (lambda: kernels.Product("x", scale=True), ["mu = 'x': must be a number", "scale = True"]),
        (lambda: kernels.Product(9.0), ["mu = 9.0: must be from -4 to 4"]),
        (lambda: kernels.Brownian(0.5), ["dimension = 0.5: must be at least 1"]),
        (lambda: kernels.Brownian.continuum(-1, "x"), ["temperature = -1", "viscosity = 'x'"]),
        (lambda: kernels.Ballistic.free_molecular(1, math.inf, 0), ["density = inf", "volume = 0"]),
        (lambda: kernels.Shear.laminar(True, -1), ["gradient = True", "volume = -1"]),
        (lambda: kernels.Sedimentation.stokes("a", 1, 1), ["density_difference = 'a'"]),
    ],
)
def test_wrong_parameters(make: Any, words: list[str]) -> None:
    with pytest.raises(InputError) as error:
        make()
    assert len(error.value.problems) == len(words)
    for word, problem in zip(words, error.value.problems, strict=True):
        assert word in problem


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"name": "balistic"}, ["did you mean 'ballistic'?"]),
        ({"name": "bilinear", "A": 1, "skale": 2}, ["did you mean 'scale'?", "'B' is missing"]),
        ({"name": "brownian.continum"}, ["did you mean 'brownian.continuum'?"]),
        ({"name": "brownian.continuum", "temperature": 3}, ["'viscosity' is missing"]),
        ({"name": "brownian.bounds"}, ["unknown"]),
        ({"name": "formula"}, ["needs formula"]),
        ({}, ["needs a name"]),
        ({"name": 3}, ["needs a name"]),
    ],
)
def test_wrong_tables(table: dict[str, Any], words: list[str]) -> None:
    with pytest.raises(InputError) as error:
        kernels.from_dict(table)
    assert len(error.value.problems) == len(words)
    for word, problem in zip(words, error.value.problems, strict=True):
        assert word in problem


def test_physical_constructor_by_name() -> None:
    table = {"name": "brownian.continuum", "temperature": 300.0, "viscosity": 1e-3}
    assert kernels.from_dict(table) == kernels.Brownian.continuum(300.0, 1e-3)
    assert kernels.by_name("shear") is kernels.Shear
