"""Sums of kernels: several mechanisms of encounter at once."""

from __future__ import annotations

import numpy as np
import pytest

import smolux as sx
from shared import extinction
from smolux import exact, kernels
from smolux.case import parse
from smolux.errors import InputError
from smolux.functions.intervals import Interval
from smolux.kernels import Sum, formula, from_dict, from_function
from smolux.model_dict import model_from_dict, model_to_dict


def steep(i: float, j: float, c: float = 0.5) -> float:
    return c * (i - j) ** 2 if i > j else c * (j - i) ** 2


BROWNIAN, SHEAR = kernels.Brownian(scale=2.5), kernels.Shear(scale=0.3)
SUMS = [
    BROWNIAN + SHEAR,
    kernels.Constant(3.0) + 0.5 * formula("c * i * j", c=2.0) + kernels.Additive(0.7),
    from_function(steep) + 2 * from_function(steep, c=0.25) + kernels.Product(mu=0.4),
    0.25 * formula("i + j"),
]
every_sum = pytest.mark.parametrize("kernel", SUMS, ids=repr)


def boxes(n: int) -> np.ndarray:
    rng = np.random.default_rng(5)
    low = np.floor(10.0 ** rng.uniform(0, 5, (n, 2)))
    high = np.floor(low * 10.0 ** rng.uniform(0, 1, (n, 2)))
    return np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]])


def term_by_term(kernel: Sum, i: float, j: float) -> float:
    return sum(c * float(k(i, j)) for c, k in zip(kernel.coefficients, kernel.terms, strict=True))


def test_rates_add() -> None:
    x, y = np.cbrt(3.0), np.cbrt(7.0)
    both = 2.5 * (x + y) * (1 / x + 1 / y) + 0.3 * (x + y) ** 3
    assert float((BROWNIAN + SHEAR)(3, 7)) == pytest.approx(both, rel=1e-14)
    assert float(SUMS[1](3, 7)) == pytest.approx(3.0 + 0.5 * 2 * 21 + 0.7 * 10, rel=1e-14)
    assert float(SUMS[2](3, 7)) == pytest.approx(0.5 * 16 + 2 * 0.25 * 16 + 21**0.4, rel=1e-14)


@every_sum
def test_the_compiled_law_is_that_of_arrays(kernel: Sum) -> None:
    for i, j in ((1.0, 1.0), (3.0, 7.0), (1e5, 2.0)):
        assert kernel.rate(i, j, *kernel.parameters) == pytest.approx(float(kernel(i, j)))
        assert float(kernel(i, j)) == pytest.approx(term_by_term(kernel, i, j))


@every_sum
def test_bounds_hold_and_are_those_of_the_terms(kernel: Sum) -> None:
    a, b, c, d = boxes(200)
    lower, upper = kernel.bounds(a, b, c, d)
    rng = np.random.default_rng(6)
    for _ in range(20):
        i, j = rng.uniform(a, b), rng.uniform(c, d)
        assert (lower <= kernel(i, j)).all()
        assert (kernel(i, j) <= upper).all()
    parts = [(number, each.bounds(a, b, c, d)) for number, each in kernel.parts]
    np.testing.assert_allclose(upper, sum(number * high for number, (_, high) in parts), rtol=1e-9)
    assert kernel.rigorous == all(each.rigorous for each in kernel.terms)


def test_intervals_factors_and_majorants_are_those_of_the_terms() -> None:
    found = SUMS[1].interval(Interval(2.0, 5.0), Interval(3.0, 4.0))
    assert found.lo <= float(SUMS[1](2, 3)) <= float(SUMS[1](5, 4)) <= found.hi
    sizes = np.arange(1.0, 30.0)
    two = 3 * kernels.Bilinear(0.5, 0.25, scale=2.0) + kernels.Constant(0.7)
    left, right = two.low_rank_factors(sizes)
    np.testing.assert_allclose(left.T @ right, two(sizes[:, None], sizes))
    assert SUMS[1].low_rank_factors(sizes) is None  # a formula has none
    majorant = (BROWNIAN + SHEAR).majorant()
    ratio = (BROWNIAN + SHEAR)(sizes[:, None], sizes) / majorant(sizes[:, None], sizes)
    assert majorant.least * (1 - 1e-12) <= ratio.min()
    assert ratio.max() <= 1 + 1e-12
    assert SUMS[1].majorant() is None


def test_what_is_known_of_a_sum() -> None:
    assert (kernels.Constant() + BROWNIAN).degree == 0.0
    assert (BROWNIAN + SHEAR).degree is None
    assert (kernels.Constant() + kernels.Additive()).gels is False
    assert (kernels.Constant() + kernels.Multiplicative()).gels is True
    assert (kernels.Constant() + formula("i + j")).gels is None
    model = sx.Model(kernels.Constant(3.0) + kernels.Additive(0.6))
    known = exact.solution(model)
    bilinear = exact.solution(sx.Model(kernels.Bilinear(0.2, 0.0, scale=3.0)))
    assert known.moment(1.0, 2) == pytest.approx(bilinear.moment(1.0, 2), rel=1e-12)
    assert exact.solution(sx.Model(BROWNIAN + kernels.Constant())) is None


def test_arithmetic() -> None:
    one, two, three = kernels.Constant(), kernels.Additive(), formula("i * j")
    assert sum([one, two, three]) == Sum((one, two, three))
    assert (one + two) + three == one + (two + three)
    assert 2 * (one + 3 * three) == Sum((one, three), (2.0, 6.0))
    assert 3 * kernels.Additive(0.5) == kernels.Additive(1.5)
    assert (one + two).rate is (one + two).rate
    assert {one + two: 1}[kernels.Constant() + kernels.Additive()] == 1
    assert repr(one + 2 * three) == "Constant(scale=1.0) + 2.0 * formula('i * j')"
    with pytest.raises(TypeError):
        one + 2.5
    with pytest.raises(TypeError):
        one * two


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: -1 * formula("i + j"), "coefficient -1: must be a positive finite number"),
        (lambda: 0 * formula("i + j"), "coefficient 0: must be"),
        (lambda: -2 * kernels.Constant(), "scale = -2.0: must be"),
        (lambda: Sum(()), "has no terms"),
        (lambda: Sum((3, kernels.Constant())), "term 0 = 3: must be a kernel"),
        (lambda: Sum((kernels.Constant(),), (1.0, 2.0)), "1 terms and 2 coefficients"),
        (lambda: from_dict({"name": "sum"}), "terms = None: must be a list of tables"),
        (lambda: from_dict({"name": "sum", "terms": [{"name": "sheer"}]}), "did you mean 'shear'"),
        (lambda: from_dict({"name": "sum", "terms": [{"name": "shear"}], "scale": 2}), "'scale'"),
        (lambda: formula("i * j * name", name=2.0), "'name': has a meaning already"),
        (lambda: formula("i * j * coefficient", coefficient=2.0), "has a meaning already"),
    ],
)
def test_mistakes(make, words: str) -> None:
    with pytest.raises(InputError, match=words):
        make()


@pytest.mark.parametrize("kernel", [SUMS[0], SUMS[1], SUMS[3]], ids=repr)
def test_plain_data_and_back(kernel: Sum) -> None:
    model = sx.Model(kernel)
    assert model_from_dict(model_to_dict(model)) == model
    assert from_dict(kernel.to_dict()) == kernel


CASE = """
[[kernel.terms]]
name = "brownian"
temperature = "298 K"
viscosity = "0.89 mPa s"

[[kernel.terms]]
name = "shear"
gradient = "10 1/s"
volume = "520 nm^3"
coefficient = 0.5

[initial]
density = "1e17 1/m^3"

[run]
times = ["1 s"]
"""


def test_a_case_file() -> None:
    case = parse(CASE)
    brownian = kernels.Brownian.continuum(temperature=298.0, viscosity=0.89e-3)
    shear = kernels.Shear.laminar(gradient=10.0, volume=520e-27)
    assert case.model.kernel == brownian + Sum((shear,), (0.5,))
    again = parse(case.to_toml())
    assert again.model == case.model
    assert "viscosity = 0.89 mPa s; scale by Shear.laminar from gradient" in case.to_toml()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"shear"', '"sheer"', 'line 8: kernel.terms[1].name = "sheer": is unknown; did you'),
        ("0.5", "-0.5", "coefficient -0.5: must be a positive"),
        ("0.5", '"half"', 'kernel.terms[1].coefficient = "half"'),
        ('viscosity = "0.89 mPa s"', "", "kernel.terms[0].viscosity is missing"),
        ('gradient = "10 1/s"\nvolume = "520 nm^3"', "", "kernel.terms[1].scale is missing"),
    ],
)
def test_mistakes_in_a_case_file(old: str, new: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        parse(CASE.replace(old, new))
    assert words in str(caught.value)


def test_a_sum_within_a_sum_needs_its_scales_too() -> None:
    inner = '[[kernel.terms.terms]]\nname = "shear"\n'
    with pytest.raises(InputError, match=r"kernel\.terms\[0\]\.terms\[0\]\.scale is missing"):
        parse("[[kernel.terms]]\n" + inner + CASE[CASE.index("[initial]") :])


@pytest.mark.parametrize("method", ["direct", "low-rank"])
def test_the_rate_equations_of_a_sum(method: str) -> None:
    """A sum of a constant and an additive law has a closed form, and so has one with itself."""
    times = [0.3, 1.0]
    model = sx.Model(kernels.Constant(3.0) + kernels.Additive(0.6))
    known = exact.solution(model)
    ds = sx.solve(model, times, method=method, tolerance=1e-8)
    for order in (0, 2):
        found = ds["moment"].sel(order=order).values[0]
        np.testing.assert_allclose(found, known.moment(times, order), rtol=1e-7)
    twice = sx.solve(sx.Model(BROWNIAN + BROWNIAN), times, method=method, tolerance=1e-8)
    once = sx.solve(sx.Model(2 * BROWNIAN), times, method=method, tolerance=1e-8)
    np.testing.assert_allclose(twice["moment"], once["moment"], rtol=1e-7)


METHODS = [
    pytest.param(m.name, marks=() if m.name == "acceptance-rejection" else pytest.mark.slow)
    for m in sx.methods.METHODS
]


@extinction
@pytest.mark.parametrize("method", METHODS)
def test_the_collisions_of_a_small_system(method: str) -> None:
    """Mean number of collisions of eight monomers, against the master equation."""
    kernel = kernels.Constant(0.5) + 2 * from_function(lambda i, j: 0.25 * (i + j))
    mean, variance = exact.finite.collision_moments(kernel, 8, 1.0)
    ds = sx.simulate(
        sx.Model(kernel), [1.0], method=method, particles=8, replicas=8000, seed=3, sizes=8,
        population="fixed-volume", bins_per_octave=1,
    )  # fmt: skip
    collisions = ds["collisions"].values[:, 0]
    assert abs(collisions.mean() - mean) < 4.5 * np.sqrt(variance / 8000)
    assert abs(((collisions - mean) ** 2).mean() / variance - 1) < 0.1
