"""Intervals contain what they should, and bounds over boxes are proved and tight."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from smolux.functions.bounds import subdivided
from smolux.functions.intervals import UFUNCS, Interval, UndecidedError

quick = settings(max_examples=60, deadline=None, derandomize=True)

number = st.one_of(
    st.floats(-50, 50),
    st.floats(allow_nan=False, allow_infinity=False),
    st.sampled_from([0.0, -1.0, 1.0, 2.0, math.pi, 1e-320, 5e-324, 1e308]),
)
share = st.floats(0, 1)


def inside(low: float, high: float, where: float) -> float:
    """A number between; by shares of both, so that nothing overflows."""
    return min(max(low * (1 - where) + high * where, low), high)


UNARY = [f for f in UFUNCS if f.nin == 1]
BINARY = [f for f in UFUNCS if f.nin == 2]


@pytest.mark.parametrize("function", UNARY, ids=lambda f: f.__name__)
@quick
@given(x=number, y=number, where=share)
def test_functions_of_one(function: Any, x: float, y: float, where: float) -> None:
    low, high = min(x, y), max(x, y)
    with np.errstate(all="ignore"):
        value = float(function(np.float64(inside(low, high, where))))
    bounds = function(Interval(low, high))
    assert bounds.lo <= bounds.hi
    assert math.isnan(value) or bounds.lo <= value <= bounds.hi


@pytest.mark.parametrize("function", BINARY, ids=lambda f: f.__name__)
@quick
@given(ends=st.tuples(number, number, number, number), u=share, v=share, whole=st.booleans())
def test_functions_of_two(
    function: Any, ends: tuple[float, ...], u: float, v: float, whole: bool
) -> None:
    a, b = sorted(ends[:2])
    c, d = sorted(ends[2:])
    x, y = inside(a, b, u), inside(c, d, v)
    exponent = function in (np.power, np.float_power)
    if exponent and whole:
        assume(abs(c) < 100)
        c = d = y = float(round(c))
        second: Any = y
    else:
        second = Interval(c, d)
    # A power of a negative base to a whole exponent within an interval is not followed.
    assume(not (exponent and not whole and x < 0))
    with np.errstate(all="ignore"):
        value = float(function(np.float64(x), np.float64(y)))
    bounds = function(Interval(a, b), second)
    assert bounds.lo <= bounds.hi
    assert math.isnan(value) or bounds.lo <= value <= bounds.hi


@quick
@given(a=number, b=number, u=share, c=st.floats(0.1, 10), n=st.integers(-7, 7))
def test_expressions(a: float, b: float, u: float, c: float, n: int) -> None:
    low, high = min(a, b), max(a, b)
    assume(max(abs(low), abs(high)) < 1e30)
    x = inside(low, high, u)

    def f(x: Any) -> Any:
        return c * x**n - 3 / (1 + abs(x)) + c**-x * 0.0 + np.sqrt(x * x + 1) - (-x) / c + 2

    with np.errstate(all="ignore"):
        value = float(f(np.float64(x)))
    bounds = f(Interval(low, high))
    assert math.isnan(value) or bounds.lo <= value <= bounds.hi


def test_arithmetic_is_sharp() -> None:
    x, y = Interval([1.0, -2.0], [2.0, 3.0]), Interval(2.0, 4.0)
    for found, lo, hi in (
        (x + y, [3, 0], [6, 7]),
        (x - y, [-3, -6], [0, 1]),
        (x * y, [2, -8], [8, 12]),
        (x / y, [0.25, -1], [1, 1.5]),
        (x**2, [1, 0], [4, 9]),
        (x**3, [1, -8], [8, 27]),
        (1 - x, [-1, -2], [0, 3]),
        (1 / y, 0.25, 0.5),
        (2.0**y, 4, 16),
        (abs(x), [1, 0], [2, 3]),
        (np.sin(y), math.sin(4), math.sin(2)),
        (np.cos(Interval(1.0, 4.0)), -1, math.cos(1)),
        (np.float64(3) * y, 6, 12),
        (np.array([1.0, 2.0]) * y, [2, 4], [4, 8]),
    ):
        np.testing.assert_allclose(found.lo, lo, rtol=1e-14, atol=1e-300)
        np.testing.assert_allclose(found.hi, hi, rtol=1e-14, atol=1e-300)


@quick
@given(x=st.floats(-1e9, 1e9), y=st.floats(-1e9, 1e9))
def test_rounded_outwards(x: float, y: float) -> None:
    u, v = Fraction(x), Fraction(y)
    results = [(Interval(x) + y, u + v), (x - Interval(y), u - v), (Interval(x) * y, u * v)]
    results += [(Interval(x) ** 3, u**3)]
    results += [(x / Interval(y), u / v)] if abs(y) > 1e-290 else []
    for bounds, exact in results:
        assert Fraction(float(bounds.lo)) <= exact <= Fraction(float(bounds.hi))


def test_exact_or_roomy() -> None:
    tenth = Interval(1.0) / 10.0
    assert tenth.lo < tenth.hi  # 1/10 is no double
    assert (Interval(2.0) - 2.0).hi == 0
    assert (Interval(0.0, 1.0) * 1e-320 * 1e-10).lo == 0
    # NumPy may be wrong by a few units in the last place.
    for function in (np.exp, np.log, np.cbrt, np.sqrt, np.tanh, np.log1p):
        bounds = function(Interval(0.7))
        assert bounds.lo < function(0.7) - 1e-15 * abs(function(0.7))
        assert bounds.hi > function(0.7) + 1e-15 * abs(function(0.7))


def test_division_by_zero_and_domains() -> None:
    around, from_zero = Interval(-1.0, 2.0), Interval(0.0, 2.0)
    assert ((1 / around).lo, (1 / around).hi) == (-np.inf, np.inf)
    assert ((1 / from_zero).lo, (1 / from_zero).hi) == (pytest.approx(0.5), np.inf)
    assert ((1 / Interval(0.0)).lo, (1 / Interval(0.0)).hi) == (-np.inf, np.inf)
    assert np.sqrt(around).lo == 0
    assert np.sqrt(around).hi == pytest.approx(math.sqrt(2))
    assert np.log(around).lo == -np.inf
    undefined = np.sqrt(Interval(-2.0, -1.0))
    assert (undefined.lo, undefined.hi) == (-np.inf, np.inf)
    assert np.exp(Interval(0.0, 1e4)).hi == np.inf


@pytest.mark.parametrize(
    "compare",
    [
        lambda x: x > 1, lambda x: x <= 1, lambda x: x == 1, lambda x: x != x, lambda x: not x,
        lambda x: max(x, 2.0), lambda x: x >= 1, lambda x: [1.0, 2.0].index(x),
    ],
)  # fmt: skip
def test_comparisons_are_undecided(compare: Callable[[Any], Any]) -> None:
    with pytest.raises(UndecidedError):
        compare(Interval(0.0, 2.0))


@pytest.mark.parametrize(
    "call",
    [
        lambda x: np.floor(x), lambda x: np.where(x, 1, 2), lambda x: math.sqrt(x),
        lambda x: x // 2, lambda x: x % 2, lambda x: np.add.reduce(x), lambda x: x + "a",
        lambda x: {x: 1}, lambda x: np.minimum(x, "a"), lambda x: int(x),
    ],
)  # fmt: skip
def test_what_is_not_followed_raises(call: Callable[[Any], Any]) -> None:
    with pytest.raises(TypeError):
        call(Interval(0.5, 2.0))


FUNCTIONS: dict[str, Callable[[Any, Any], Any]] = {
    "corner": lambda x, y: (x / y) ** 0.95 + (y / x) ** 0.95,
    "ballistic": lambda x, y: (np.cbrt(x) + np.cbrt(y)) ** 2 * np.sqrt(1 / x + 1 / y),
    "inside": lambda x, y: x * y / (1 + (x - 7) ** 2 + (y - 3) ** 2),
    "ridge": lambda x, y: np.exp(-((np.log(x) - np.log(y)) ** 2)),
    "zero": lambda x, y: abs(x - y),
    "constant": lambda x, y: 3.0,
    "cancelled": lambda x, y: ((x + 9) ** 3 - x**3) / (27 * (x + 3)) - x / 2 + np.sqrt(y),
}


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("box", [(1, 100, 1, 100), (5, 9, 2, 40), (1, 1, 1, 1e6), (6, 6, 3, 3)])
def test_bounds_over_boxes(name: str, box: tuple[float, ...]) -> None:
    a, b, c, d = box
    f = FUNCTIONS[name]
    x, y = np.geomspace(a, b, 600).clip(a, b), np.geomspace(c, d, 600).clip(c, d)
    values = f(x[:, None], y) + np.zeros((600, 600))
    lower, upper = subdivided(f, a, b, c, d, least=0.0)
    assert lower <= values.min()
    assert values.max() <= upper
    assert upper <= 1.025 * values.max()
    assert lower >= 0.975 * values.min() - 2e-3 * values.max()


def test_many_boxes_at_once() -> None:
    edges = 2.0 ** np.arange(12)
    f = FUNCTIONS["inside"]
    lower, upper = subdivided(f, edges[:, None], 2 * edges[:, None], edges, 2 * edges)
    assert lower.shape == upper.shape == (12, 12)
    one = subdivided(f, 4.0, 8.0, 2.0, 4.0)
    assert float(one[1]) == pytest.approx(upper[2, 1], rel=0.02)
    middle = f(1.5 * edges[:, None], 1.5 * edges)
    assert (lower <= middle).all()
    assert (middle <= upper).all()
    assert subdivided(f, np.empty(0), 1, 1, 1)[0].shape == (0,)


def test_equal_lengths_and_limits() -> None:
    lower, upper = subdivided(lambda t, _: np.sin(t), -2.0, 2.0, 0.0, 0.0, geometric=False)
    assert -1.02 <= lower <= -1
    assert 1 <= upper <= 1.02
    assert subdivided(lambda x, y: 1 / (x - y), 1, 4, 1, 4)[1] == np.inf
    rough = subdivided(FUNCTIONS["corner"], 1, 1e6, 1, 1e6, 1, work=0)[1]
    fine = subdivided(FUNCTIONS["corner"], 1, 1e6, 1, 1e6)[1]
    assert fine <= 0.6 * rough


@pytest.mark.parametrize(
    ("base", "exponent"),
    [((-3.0, 2.0), (2.0, 2.0)), ((-3.0, -2.0), (1.0, 3.0)), ((-3.0, -1.0), (-2.0, 0.5))],
)
def test_a_negative_base_has_its_powers_of_whole_exponents(
    base: tuple[float, float], exponent: tuple[float, float]
) -> None:
    found = Interval(*base) ** Interval(*exponent)
    x = np.linspace(*base, 51)
    for n in range(int(np.ceil(exponent[0])), int(np.floor(exponent[1])) + 1):
        powers = x[x != 0.0] ** float(n)
        assert (found.lo <= powers).all()
        assert (powers <= found.hi).all()
    assert np.isfinite(found.hi)
