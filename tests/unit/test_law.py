"""What is common to laws however they are given, and what a user may state of one."""

from __future__ import annotations

import json
import pickle
import types
from typing import Any

import numpy as np
import pytest

import smolux as sx
from smolux.errors import InputError
from smolux.functions.intervals import Interval
from smolux.functions.law import Law
from smolux.functions.size import SizeFunction
from smolux.functions.time import TimeFunction
from smolux.functions.user_function import numbers_of
from smolux.kernels import formula, from_function
from smolux.model_dict import model_from_dict, model_to_dict
from smolux.processes import Aggregation, Removal, Shattering
from smolux.stochastic.time_windows import time_windows_for

HOURS = np.array([0.0, 7.0, 7.01, 7.02, 100.0])
FLOW = np.array([0.5, 0.0, 50.0, 0.0, 2.0])
FALLING = np.array([3.0, 2.0, -1.0])


def measured(t: float) -> float:
    return float(np.interp(t, HOURS, FLOW))


def square_spike(t: float, height: float = 1000.0) -> float:
    """Narrow, at the square root of 900.03, which it does not name."""
    return height if 900.0 < t * t < 900.06 else 0.0


def pair_by_square(i: float, j: float) -> float:
    return 1.0 if (i + j) ** 2 == 4e8 else 0.0


def twice(a: float, b: float, height: float) -> tuple[float, float]:
    return 0.0, height if a < 30.01 and b > 29.99 else 0.0


# --- one law -------------------------------------------------------------------------------------


def rises(t: float, a: float = 2.0) -> float:
    return a + t * t


def jumps(t: float, high: float = 3.0) -> float:
    return high if t < 1.25 else 0.5


@pytest.mark.parametrize("one", ["1 + t", 2.0, rises, jumps, sx.law(jumps, bounds=3.0)])
@pytest.mark.parametrize("two", ["3 - t", 0.5, rises, jumps])
@pytest.mark.parametrize("operator", ["+", "*"])
def test_sums_and_products(one: Any, two: Any, operator: str) -> None:
    """Values, the compiled law and bounds are those of the two numbers."""
    laws = TimeFunction.of(one), TimeFunction.of(two)
    both = laws[0] + laws[1] if operator == "+" else laws[0] * laws[1]
    times = np.linspace(0.0, 2.0, 41)
    first, second = (law(times) for law in laws)
    expected = first + second if operator == "+" else first * second
    np.testing.assert_allclose(both(times), expected, rtol=1e-14)
    for t, value in zip(times, expected, strict=True):
        assert both.rate(t, *both.arguments) == pytest.approx(value, rel=1e-14)
    low, high = both.bounds(times[:-1], times[1:])
    assert (low <= np.minimum(expected[1:], expected[:-1])).all()
    assert (high >= np.maximum(expected[1:], expected[:-1])).all()
    assert both == (laws[0] + laws[1] if operator == "+" else laws[0] * laws[1])
    assert len({both, laws[0]}) == 2
    # where one of both jumps, windows of time end
    assert (1.25 in both.edges) == any(f is jumps for f in (one, two))
    assert len(both.functions) == sum(law.user is not None for law in laws)


def test_what_stays_of_sums_and_products() -> None:
    law = TimeFunction.of("1 + t")
    assert 1 * law is law
    assert law + 0 is law
    assert 2 * law == law * 2
    assert (law * TimeFunction.of("2 - t")).text == "(1 + t) * (2 - t)"
    assert (2 * TimeFunction.of(3)).constant == 6.0
    stated = TimeFunction.of(sx.law(square_spike, bounds=1000.0, breakpoints=[30.0, 30.01]))
    assert (law * stated).breakpoints == (30.0, 30.01)
    assert (law * stated).bounds(29.0, 31.0)[1] == pytest.approx(32.0e3)
    long = TimeFunction.of("t + 1.5" + "0" * 500)
    assert (long * long)(0.5) == 4.0  # longer than a formula may be
    sizes = SizeFunction.of([1.0, 4.0], "rate") * SizeFunction.of("k", "rate") + 1.0
    np.testing.assert_array_equal(sizes(np.array([1.0, 2.0, 3.0])), [2.0, 9.0, 13.0])
    assert sizes.rate(3.0, *sizes.arguments) == 13.0
    with pytest.raises(TypeError):
        law * SizeFunction.of("k", "rate")  # type: ignore[operator]


@pytest.mark.parametrize(
    ("law", "points"),
    [
        (TimeFunction.of(2), (3.0,)),
        (TimeFunction.of("1 + t**2"), (3.0,)),
        (TimeFunction.of(measured), (7.015,)),
        (SizeFunction.of([1.0, 4.0, 2.0], "rate"), (2.0,)),
        (SizeFunction.of([1.0, 4.0, 2.0], "rate"), (7.0,)),
        (SizeFunction.of("sqrt(k)", "rate"), (9.0,)),
        (formula("a*(i + j)", a=0.5).law, (1.0, 3.0)),
        (from_function(lambda i, j, a=2.0: a * i * j, a=3.0).law, (1.0, 3.0)),
    ],
)
def test_rate_array_and_interval_agree(law: Law, points: tuple[float, ...]) -> None:
    value = law.rate(*points, *law.arguments)
    assert law.on(*(np.full((2, 3), x) for x in points)) == pytest.approx(np.full((2, 3), value))
    found = law.interval(*(Interval(x) for x in points))
    assert found.lo <= value <= found.hi
    assert law.rigorous
    again = pickle.loads(pickle.dumps(law)) if "lambda" not in law.text else law
    assert again == law
    assert hash(again) == hash(law)


def test_numbers_that_a_function_reads(monkeypatch: pytest.MonkeyPatch) -> None:
    module = types.ModuleType("mine")
    module.FIRST, module.TIMES, module.OTHER = 41.5, [7.5, 8.5], 9.5  # type: ignore[attr-defined]
    monkeypatch.setitem(globals(), "mine", module)
    limit = 3.5

    def held(t: float, until: float = 2.5) -> float:
        return 1.0 if t < until or t > mine.FIRST or t == limit else mine.TIMES[0]  # noqa: F821

    assert set(numbers_of(held)) == {1.0, 2.5, 3.5, 7.5, 8.5, 41.5, 0.0}


def test_ranges_of_lists() -> None:
    rng = np.random.default_rng(1)
    values = rng.random(50)
    low = rng.integers(1, 80, 200)
    high = low + rng.integers(0, 60, 200)
    found = SizeFunction.of(values, "rate").interval(Interval(low, high))
    for a, b, least, most in zip(low, high, found.lo, found.hi, strict=True):
        inside = values[np.minimum(np.arange(a, b + 1), 50) - 1]
        assert (least, most) == (inside.min(), inside.max())


# --- tables --------------------------------------------------------------------------------------


def test_tables_are_followed() -> None:
    law = TimeFunction.of(measured)
    assert law.rigorous
    for low, high in ((0.0, 3.5), (6.0, 8.0), (7.005, 7.006), (7.015, 60.0), (0.0, 1e4), (99, 1e3)):
        times = np.linspace(low, high, 10_001)
        inside = HOURS[(low <= HOURS) & (high >= HOURS)]
        values = law(np.concatenate([times, inside]))
        lower, upper = law.bounds(low, high)
        assert (lower, upper) == (pytest.approx(values.min()), pytest.approx(values.max()))
        assert lower <= values.min()
        assert upper >= values.max()
    assert law.bounds(0, 5)[0] >= 0.0


def test_ranges_of_tables() -> None:
    low, high = np.array([[-1.0, 0.2], [0.9, 1.5]]), np.array([[-0.5, 0.3], [1.1, 9.0]])
    found: Any = np.interp(Interval(low, high), [0.0, 1.0, 2.0], FALLING)
    np.testing.assert_allclose(found.lo, [[3.0, 2.7], [1.7, -1.0]], rtol=1e-12)
    np.testing.assert_allclose(found.hi, [[3.0, 2.8], [2.1, 0.5]], rtol=1e-12)
    found = np.interp(Interval(low, high), [0.0, 1.0, 2.0], FALLING, left=7.0, right=8.0)
    np.testing.assert_allclose(found.hi, [[7.0, 2.8], [2.1, 8.0]], rtol=1e-12)
    with pytest.raises(TypeError):
        np.interp(Interval(low, high), [0.0, 1.0, 2.0], FALLING, period=2.0)
    with pytest.raises(TypeError):
        np.where(Interval(low, high), 1.0, 2.0)


# --- what is stated ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("bounds", "expected"), [(2000.0, 2000.0), ((0, 2000), 2000.0), (twice, 1000.0)]
)
def test_stated_bounds_of_time(bounds: Any, expected: float) -> None:
    law = TimeFunction.of(sx.law(square_spike, bounds=bounds))
    assert law.bounds(28, 32) == (0.0, expected)
    assert not law.rigorous
    assert law.bounds([28, 29], [32, 33])[1].tolist() == [expected] * 2
    # what nobody states is not seen here
    assert TimeFunction.of(square_spike).bounds(28, 32) == (0.0, 0.0)


def test_windows_bound_a_factor_up_to_their_ends() -> None:
    """Of encounters the sum, without single particles; the last window begins after the end."""
    rising = Shattering("0.1 + t")
    windows = time_windows_for([Aggregation(), rising, Removal(0.1, varying="1 + t")], 10.0)
    begun = windows.edges[:-1] < 10.0
    ends = windows.edges[1:][begun]
    assert ends[-1] >= 10.0
    for k, least in enumerate((np.ones_like(ends), 0.1 + ends, 1.0 + ends)):
        assert (least <= windows.bounds[begun, k]).all()
        assert (windows.bounds[begun, k] <= 1.02 * least).all()
    np.testing.assert_allclose(windows.total, windows.bounds[:, :2].sum(axis=1))


def test_breakpoints_end_windows() -> None:
    low, high = np.sqrt(900.0), np.sqrt(900.06)
    stated = sx.law(square_spike, breakpoints=[high, low])
    windows = time_windows_for([Aggregation(), Shattering(stated), Removal(0.1)], 100.0)
    (held,) = np.flatnonzero(windows.bounds[:, 1])
    assert windows.edges[[held, held + 1]].tolist() == [low, high]
    assert windows.bounds[held, 1] == pytest.approx(1100.0)
    # those of a factor do not depend on the end
    longer = time_windows_for([Aggregation(), Shattering(stated), Removal(0.1)], 1000.0)
    count = len(windows.edges) - 2
    np.testing.assert_array_equal(windows.edges[:count], longer.edges[:count])
    np.testing.assert_array_equal(windows.bounds[:count], longer.bounds[:count])


def test_stated_of_pairs() -> None:
    box = 8192, 10_239, 9000, 12_287
    assert from_function(pair_by_square).bounds(*box)[1] == 0
    assert from_function(pair_by_square, breakpoints=[20_000]).bounds(*box)[1] >= 1.0
    kernel = from_function(pair_by_square, bounds=2.0)
    assert kernel.bounds(*box) == (0.0, 2.0)
    assert kernel.bounds([1, 2], 3, 4, 5)[1].tolist() == [2.0, 2.0]
    assert not kernel.rigorous
    wrong = from_function(lambda i, j: i + j, bounds=(1.0, 5.0)).problems()
    assert "the bounds [1, 5]" in wrong[0]


def test_stated_in_files() -> None:
    stated = sx.law(square_spike, bounds=1000.0, breakpoints=[30, 31])
    model = sx.Model(sx.kernels.Constant(), [Aggregation(), Shattering(stated)])
    data = json.loads(json.dumps(model_to_dict(model)))
    assert data == model_to_dict(model)
    table = data["processes"][1]["rate"]
    assert (table["function"], table["breakpoints"]) == ("square_spike", [30.0, 31.0])
    assert table["bounds"] == [0.0, 1000.0]
    with pytest.raises(InputError, match="which no file can bring back"):
        model_from_dict(data)


def test_stated_bounds_that_fail() -> None:
    law = TimeFunction.of(sx.law(square_spike, bounds=lambda a: a))
    with pytest.raises(InputError, match="square_spike: its bounds raise TypeError"):
        law.bounds(0.0, 1.0)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: sx.law("t"), ["must be a Python function; numbers and formulas are given as"]),
        (lambda: sx.law(measured, bounds="x"), ["bounds = 'x': must be the highest value"]),
        (lambda: sx.law(measured, bounds=(2, 1)), ["bounds = (2, 1)"]),
        (lambda: sx.law(measured, bounds=-1.0, breakpoints=["a"]), ["bounds = -1.0", "breakpoi"]),
        (lambda: sx.law(measured, breakpoints=[np.inf]), ["must be a list of finite numbers"]),
        (lambda: Shattering(sx.law(max)), ["must be a Python function such as"]),
        (lambda: Removal(sx.law(square_spike)), ["must be a number, a formula in k"]),
        (lambda: from_function(pair_by_square, breakpoints="x", bounds=-1), ["bounds", "breakp"]),
    ],
)
def test_mistakes(make: Any, words: list[str]) -> None:
    with pytest.raises(InputError) as error:
        make()
    assert len(error.value.problems) == len(words), error.value.problems
    for word, problem in zip(words, error.value.problems, strict=True):
        assert word in problem
