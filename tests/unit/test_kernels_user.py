"""A user's own kernels: Python functions and formulas."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from math import sqrt
from typing import Any

import numba
import numpy as np
import pytest

import smolux as sx
from smolux import kernels
from smolux.errors import InputError
from smolux.kernels import formula, from_function


def radius(i: float) -> float:
    return math.pow(i, 1 / 3)


def ballistic(i: float, j: float, c: float = 1.0) -> float:
    return c * (radius(i) + radius(j)) ** 2 * sqrt(1 / i + 1 / j)


def capped(i: float, j: float, cut: float = 10.0) -> float:
    if i + j > cut:
        return cut
    return i + j


def larger(i: float, j: float) -> float:
    return max(i, j) * min(i, j) ** 0.5


def silent(i: float, j: float) -> float:
    # Misread on arrays without an error: the largest of all.
    return np.max(i) + np.max(j)


def sum_bounds(a: float, b: float, c: float, d: float, scale: float) -> tuple[float, float]:
    if a < 0:
        raise AssertionError("branches are fine here")
    return scale * (a + c), scale * (b + d)


def scaled_sum(i: float, j: float, scale: float = 2.0) -> float:
    return scale * (i + j) if i > 0 else 0.0


ALL = [ballistic, capped, larger, silent, scaled_sum, lambda i, j: 1.0, lambda i, j: np.hypot(i, j)]
every_function = pytest.mark.parametrize("function", ALL, ids=lambda f: f.__name__)


@every_function
def test_arrays_agree_with_single_calls(function: Callable[..., float]) -> None:
    kernel = from_function(function)
    i = np.arange(1.0, 41.0)
    expected = [[function(x, y) for y in i] for x in i]
    np.testing.assert_allclose(kernel(i[:, None], i), expected, rtol=1e-14)
    assert float(kernel(3, 4)) == pytest.approx(function(3.0, 4.0))
    assert kernel(i[:3], 2).shape == (3,)
    assert kernel.problems(1.0) == []
    compiled = (
        numba.njit(kernel.rate) if function is not ballistic and function is not silent else None
    )
    if compiled:
        assert compiled(3.0, 4.0, *kernel.parameters) == pytest.approx(function(3.0, 4.0))


@every_function
def test_bounds_contain_the_values(function: Callable[..., float]) -> None:
    kernel = from_function(function)
    edges = np.array([1.0, 2, 4, 9, 30, 1000])
    a, b = edges[:-1], edges[1:]
    lower, upper = kernel.bounds(a[:, None], b[:, None], a, b)
    assert lower.shape == upper.shape == (5, 5)
    assert (lower >= 0).all()
    for k, m in np.ndindex(5, 5):
        i = np.unique(np.rint(np.linspace(a[k], b[k], 60)))
        j = np.unique(np.rint(np.linspace(a[m], b[m], 60)))
        values = kernel(i[:, None], j)
        assert lower[k, m] <= values.min()
        assert values.max() <= upper[k, m] <= 1.25 * values.max()


@pytest.mark.parametrize(
    ("function", "rigorous"),
    [
        (ballistic, True), (capped, False), (larger, True), (silent, False), (scaled_sum, False),
        (lambda i, j: 1.0, True), (lambda i, j: i // 2 + j // 2, False),
        (lambda i, j: math.exp(0.01 * (i + j)), False), (lambda i, j: np.hypot(i, j), False),
        (lambda i, j: 1 / (i + j), True), (lambda i, j: math.log(i * j, 2), True),
    ],
)  # fmt: skip
def test_rigorous_is_honest(function: Callable[..., float], rigorous: bool) -> None:
    assert from_function(function).rigorous is rigorous


def test_rigorous_bounds_hold_everywhere() -> None:
    rng = np.random.default_rng(5)
    binary = from_function(lambda i, j: math.log(i + j, 2))
    for kernel in (
        from_function(ballistic, c=0.3), from_function(larger), formula("i*j/(i + j)"), binary,
    ):  # fmt: skip
        assert kernel.rigorous
        for _ in range(20):
            a, c = np.exp(rng.uniform(0, 20, 2))
            b, d = np.array([a, c]) * np.exp(rng.uniform(0, 3, 2))
            i, j = rng.uniform(a, b, 200), rng.uniform(c, d, 200)
            lower, upper = kernel.bounds(a, b, c, d)
            assert (lower <= kernel(i, j)).all()
            assert (kernel(i, j) <= upper).all()
            assert upper <= 1.03 * kernel([a, a, b, b], [c, d, c, d]).max()


def test_parameters() -> None:
    kernel = from_function(ballistic, c=2.0)
    assert kernel.parameters == (2.0,)
    assert float(kernel(1, 1)) == pytest.approx(8 * math.sqrt(2))
    assert kernel == from_function(ballistic, c=2)
    assert kernel != from_function(ballistic)
    assert hash(kernel) == hash(from_function(ballistic, c=2.0))
    assert pickle.loads(pickle.dumps(kernel)) == kernel
    assert repr(kernel) == "from_function(ballistic, c=2.0)"
    assert kernel.function is ballistic is kernel.rate
    assert from_function(numba.njit(capped)) == from_function(capped)


def test_declared() -> None:
    kernel = from_function(scaled_sum, bounds=sum_bounds, degree=1.0, gels=False, scale=3.0)
    assert (kernel.degree, kernel.gels, kernel.rigorous) == (1.0, False, False)
    lower, upper = kernel.bounds([1, 2], [3, 4], 5, 6)
    assert lower.tolist() == [18.0, 21.0]
    assert upper.tolist() == [27.0, 30.0]
    assert kernel.problems(1.0) == []
    wrong = from_function(scaled_sum, bounds=lambda a, b, c, d, s: (0.0, 5.0), degree=2.0)
    degree, bounds = wrong.problems(1.0)
    assert "degree = 2 is wrong" in degree
    assert "multiplies the rate by 2, not 4" in degree
    assert "the bounds [0, 5] of the sizes 1 to 1048576 do not hold: K(1, 2) = 6" in bounds
    broken = from_function(scaled_sum, bounds=lambda a, b: 1.0)
    assert "bounds raise TypeError" in broken.problems(1.0)[0]


def test_described() -> None:
    told = from_function(ballistic).describe()
    assert told["function"] == "ballistic"
    assert told["c"] == 1.0
    assert told["source"].startswith("def ballistic(i: float")
    with pytest.raises(InputError, match="no case file holds"):
        from_function(ballistic).to_dict()


def asymmetric(i: float, j: float) -> float:
    return i + 2 * j


def branch(i: float, j: float) -> float:
    return 1.0 if i > j else 2.0


def negative(i: float, j: float) -> float:
    return 10.0 - i * j


def no_number(i: float, j: float) -> float:
    return math.nan if 7 in (i, j) else 1.0


def overflow(i: float, j: float) -> float:
    return np.exp(i) * np.exp(j)


def raising(i: float, j: float) -> float:
    return math.exp(i) * math.exp(j)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (asymmetric, ["K(1, 2) = 5", "not symmetric, as K(2, 1) = 4"]),
        (branch, ["K(1, 2) = 2", "not symmetric, as K(2, 1) = 1"]),
        (lambda i, j: i + (1 + 1e-6) * j, ["not symmetric"]),
        (negative, ["K(3, 4) = -2", "negative; a rate is zero or more"]),
        (no_number, ["K(1, 7) = nan", "not a number"]),
        (overflow, ["K(255, 512) = inf", "limit what grows"]),
        (raising, ["K(255, 512) = inf", "limit what grows"]),
        (lambda i, j: 1 / (i - j) ** 2, ["K(1, 1) = inf", "division by zero"]),
        (lambda i, j: "x", ["K(1, 1) raises ValueError", "correct the function"]),
        (lambda i, j: 1.0 if i * j == 0.5 else 0.0, ["zero for every pair", "Constant(0)"]),
        (lambda i, j: (i - j) ** 0.5, ["K(1, 2) = nan"]),
    ],
)
def test_problems_name_the_sizes(function: Callable[..., float], words: list[str]) -> None:
    problems = from_function(function).problems(1.0)
    assert len(problems) == 1
    for word in words:
        assert word in problems[0]
    with pytest.raises(InputError) as error:
        sx.Model(kernel=from_function(function))
    assert error.value.problems == problems


def test_sizes_beyond_the_common_are_checked_if_they_are_there() -> None:
    kernel = from_function(lambda i, j: np.exp(1e-8 * (i + j)))
    assert kernel.problems(1.0) == []
    assert "infinite" in kernel.problems(2.0**40)[0]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: from_function(3), ["kernel = 3: must be a Python function such as def f(i, j, a"]),
        (lambda: from_function(max), ["must be a Python function"]),
        (lambda: from_function(lambda i: i), ["must take i and j"]),
        (lambda: from_function(lambda i, j, a: i), ["argument 'a' needs a default"]),
        (lambda: from_function(lambda *x: 1), ["give each argument by name"]),
        (lambda: from_function(lambda i, j, a="x", b=math.nan: 1), ["'a' = 'x'", "'b' = nan"]),
        (lambda: from_function(ballistic, C=1.0), ["'C' of ballistic; choose from 'c'"]),
        (lambda: from_function(scaled_sum, scael=1.0), ["did you mean 'scale'?"]),
        (lambda: from_function(larger, a=1.0), ["unknown parameter 'a' of larger; it takes none"]),
        (
            lambda: from_function(larger, bounds=-3, gels=2, degree="x"),
            ["degree", "bounds = -3", "gels"],
        ),
        (lambda: formula("(i/j)**b", a=1.0), ["unknown name 'b'"]),
        (lambda: formula("i*j", a=1.0), ["parameter 'a' does not occur"]),
        (
            lambda: formula("i*j", i=1.0, sqrt=2.0),
            ["'i': has a meaning", "'sqrt': has", "'sqrt' does"],
        ),
        (lambda: formula("i*j*a", a="x", gels=3), ["parameter 'a' = 'x'", "gels = 3"]),
        (lambda: formula(3), ["must be text"]),
    ],
)
def test_mistakes(make: Callable[[], Any], words: list[str]) -> None:
    with pytest.raises(InputError) as error:
        make()
    assert len(error.value.problems) == len(words), error.value.problems
    for word, problem in zip(words, error.value.problems, strict=True):
        assert word in problem


def test_formula_kernel() -> None:
    kernel = formula("(i/j)**a + (j/i)**a", a=0.95, degree=0, gels=False)
    law = kernels.GeneralizedBrownian(0.95)
    i = np.arange(1.0, 50)
    np.testing.assert_allclose(kernel(i[:, None], i), law(i[:, None], i), rtol=1e-14)
    assert kernel.rigorous
    upper = kernel.bounds(1, 1000, 1, 1000)[1]
    assert law.bounds(1, 1000, 1, 1000)[1] <= upper <= 1.03 * law.bounds(1, 1000, 1, 1000)[1]
    assert kernel.rate is formula("(i/j)**a + (j/i)**a", a=0.5).rate  # parameters are data
    assert kernels.from_dict(kernel.to_dict()) == kernel
    assert pickle.loads(pickle.dumps(kernel)) == kernel
    assert repr(kernel) == "formula('(i/j)**a + (j/i)**a', a=0.95)"
    assert kernel.problems(1.0) == []
    assert "degree = 1 is wrong" in formula("i + j + 1", degree=1).problems(1.0)[0]
    assert sx.Model(kernel=kernel).kernel is kernel


def test_formula_without_a_bound_over_all_sizes() -> None:
    kernel = formula("1/(i*i + j*j - i*j)")
    assert not kernel.rigorous
    upper = kernel.bounds(1, 100, 1, 100)[1]
    assert 1 <= upper <= 1.2
    assert kernel.problems(1.0) == []
    # no interval across the pole has a bound, so it is found by trial
    assert 2 <= formula("1/abs(i - j + 0.5)").bounds(1, 9, 1, 9)[1] <= 2.3
