"""Functions of time: numbers, formulas, Python functions."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numba
import numpy as np
import pytest

from smolux.errors import InputError
from smolux.functions.time import TimeFunction

of = TimeFunction.of


def decay(t: float, rate: float = 0.5) -> float:
    return math.exp(-rate * t)


def step(t: float) -> float:
    return 1.0 if t < 5 else 3.0


def wave(t: float) -> float:
    return 1 + np.sin(t) ** 2


def test_number() -> None:
    f = of(0.01)
    assert (f.constant, f.text, f.rigorous, f.parameters) == (0.01, "0.01", True, (0.01,))
    assert f(3.0) == 0.01
    assert f(np.zeros((2, 3))).tolist() == [[0.01] * 3] * 2
    assert f.bounds(0, 1e9) == (0.01, 0.01)
    assert f.rate(7.0, *f.parameters) == 0.01
    assert of(np.float32(0.5)).constant == 0.5
    assert of(f) is f
    assert of("2*pi").constant == pytest.approx(2 * math.pi)


@pytest.mark.parametrize("value", [0.01, "0.01*(1 - t/400)", decay, step, wave, lambda t: 2 + t])
def test_every_kind(value: Any) -> None:
    f = of(value)
    times = np.linspace(0, 20, 1001)
    values = f(times)
    np.testing.assert_allclose(values, [f(t) for t in times], rtol=1e-15)
    compiled = numba.njit(f.rate)
    assert compiled(7.5, *f.parameters) == pytest.approx(f(7.5), rel=1e-14)
    lower, upper = f.bounds(0, 20)
    assert lower <= values.min()
    assert values.max() <= upper
    assert f.rigorous is (value is not step)  # intervals follow no branches
    assert f == of(value)
    assert hash(f) == hash(of(value))
    assert f.rate is of(value).rate


def test_formula() -> None:
    f = of("0.01*(1 - t/400)")
    assert (f.constant, f.text, f.parameters) == (None, "0.01*(1 - t/400)", ())
    assert f(100.0) == pytest.approx(0.0075)
    lower, upper = f.bounds(100, 200)
    assert (lower, upper) == (pytest.approx(0.005), pytest.approx(0.0075))
    assert lower <= f(200.0)
    assert upper >= f(100.0)
    # Not made negative by rounding at its zero, but negative where it is.
    assert f.bounds(0, 400)[0] == 0
    assert f.bounds(0, 500)[0] == pytest.approx(-0.0025, rel=0.02)
    assert f.bounds(50, 50) == (pytest.approx(f(50.0)), pytest.approx(f(50.0)))
    assert of("1/(3 - t)").bounds(0, 10)[1] == math.inf


def test_bounds_are_tight() -> None:
    for value in ("1 + sin(t)**2", wave, "t*exp(-t)", lambda t: t * np.exp(-t)):
        f = of(value)
        for t0, t1 in ((0.0, 0.3), (0.0, 40.0), (3.0, 9.0)):
            values = f(np.linspace(t0, t1, 4001))
            lower, upper = f.bounds(t0, t1)
            assert lower <= values.min()
            assert values.max() <= upper <= 1.02 * values.max()
            assert lower >= 0.98 * values.min() - 2e-3 * values.max()


def test_python_functions() -> None:
    f = of(decay)
    assert (f.text, f.parameters, f.constant) == ("decay", (0.5,), None)
    assert f.rate is decay
    assert f(2.0) == math.exp(-1)
    assert f.bounds(0, 4) == (pytest.approx(math.exp(-2)), pytest.approx(1.0))
    # Branches cannot be followed: sampled with a margin.
    assert of(step).bounds(0, 10) == (pytest.approx(0.8), pytest.approx(3.2))
    assert of(numba.njit(step)).rate is step


@pytest.mark.parametrize("value", [0.25, "exp(-t)", decay, step])
def test_pickle(value: Any) -> None:
    f = of(value)
    again = pickle.loads(pickle.dumps(f))
    assert again == f
    assert again(1.5) == f(1.5)
    assert again.rate is f.rate


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (-0.1, "λ = -0.1: is -0.1; must be a finite number, zero or more"),
        (math.nan, "is nan"),
        ("-1", "λ = -1: is -1"),
        ("t - 1", "λ = t - 1: is -1 at t = 0"),
        ("1/t", "is inf at t = 0"),
        (lambda t: -t - 1, "is -1 at t = 0"),
        (lambda t: math.log(t), "raises ValueError at t = 0"),
        (lambda t: "a", "raises ValueError at t = 0"),
        ("x", "unknown name 'x'"),
        (True, "must be a number"),
        (None, "must be a number"),
        ([0.1], "must be a number"),
        (lambda: 1.0, "must take t"),
        (lambda t, a: 1.0, "argument 'a' needs a default"),
        (lambda *t: 1.0, "give each argument by name"),
        (max, "must be a Python function"),
    ],
)
def test_mistakes(value: Any, words: str) -> None:
    with pytest.raises(InputError) as error:
        of(value, "λ")
    assert words in str(error.value)
