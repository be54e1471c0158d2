"""One gate for numbers: what has a unit, or is a text or a flag, is never read as a bare number."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pint
import pytest
import synthetic

import smolux as sx
from smolux import kernels, processes
from smolux.checks import is_number, numbers, whole
from smolux.exact.base import check_times

SECONDS = pd.to_timedelta([1, 2], unit="s")
UREG = pint.UnitRegistry()
WITH_UNITS = [
    (SECONDS, "duration"),
    (SECONDS.to_numpy(), "duration"),
    (list(SECONDS), "duration"),
    (pd.Series(SECONDS), "duration"),
    (np.timedelta64(1, "s"), "duration"),
    ([SECONDS[0].to_pytimedelta()], "duration"),
    (pd.to_datetime(["2020-01-01", "2020-01-02"]), "date"),
    ([np.datetime64("2020-01-01")], "date"),
    (UREG.Quantity([1.0, 2.0], "min"), "unit"),
    ([UREG.Quantity(1.0, "min")], "unit"),
    (UREG.Quantity(1.0, ""), "unit"),
    (["1", "2"], "numbers"),
    ("1 s", "numbers"),
    ([0.5, True], "numbers"),
    (True, "numbers"),
    (1j, "numbers"),
    ([[1.0], [2.0, 3.0]], "numbers"),
    (None, "numbers"),
]
MODEL = sx.Model(kernels.Constant())


@pytest.mark.parametrize(("times", "word"), WITH_UNITS, ids=lambda x: str(x)[:30])
@pytest.mark.parametrize(
    "call",
    [
        lambda times: numbers("times", times),
        lambda times: sx.simulate(MODEL, times, particles=10),
        lambda times: sx.solve(MODEL, times),
        check_times,
    ],
    ids=["gate", "simulate", "solve", "exact"],
)
def test_times_that_are_no_plain_numbers_are_refused(call, times, word):
    with pytest.raises(sx.InputError, match="times = (.|\n)*" + word):
        call(times)


@pytest.mark.parametrize(
    "given",
    [
        1,
        2.5,
        np.float32(0.5),
        [1, 2.5],
        (1,),
        np.arange(3),
        pd.Series([1.0, 2.0]),
        [np.int64(3), 1],
    ],
    ids=str,
)
def test_plain_numbers_are_read(given):
    np.testing.assert_array_equal(numbers("times", given), np.asarray(given, float))


ODD = [
    np.timedelta64(3, "s"), SECONDS[0], UREG.Quantity(3.0, "s"), UREG.Quantity(3.0, ""), True,
    np.True_, 3j, np.complex128(3),
]  # fmt: skip


@pytest.mark.parametrize("value", [*ODD, "3"], ids=str)
def test_what_is_no_number(value):
    assert not is_number(value)
    assert whole(value) is None


@pytest.mark.parametrize("value", ODD, ids=str)
@pytest.mark.parametrize(
    "make",
    [
        kernels.Constant,
        processes.Shattering,
        processes.Evaporation,
        processes.Removal,
        lambda x: processes.Removal([0.1, x]),
        processes.Source,
        lambda x: processes.Removal(above=x),
        sx.initial.exponential,
        lambda x: sx.initial.monodisperse(density=x),
        lambda x: sx.initial.monodisperse(size=x),
        lambda x: kernels.Brownian.continuum(x, 1e-3),
    ],
)
def test_parameters_that_are_no_plain_numbers_are_refused(make, value):
    with pytest.raises(sx.InputError):
        make(value)


@pytest.mark.parametrize(
    "given",
    [
        True,
        "2",
        ["2"],
        (2, True),
        (1, 1),
        (),
        [np.nan],
        [[1, 2]],
        SECONDS,
        UREG.Quantity([1, 2], "s"),
    ],
    ids=str,
)
def test_orders_of_moments_that_are_none(given):
    """In every place that takes them: one gate."""
    model, ds = sx.Model(kernels.Constant()), synthetic.constant_dataset(particles=50)
    for take in (
        lambda: sx.simulate(model, [1.0], orders=given),
        lambda: sx.solve(model, [1.0], orders=given),
        lambda: sx.analysis.moments(ds, given),
        lambda: sx.plotting.moments(ds, given),
    ):
        with pytest.raises(sx.InputError, match=r"^orders = "):
            take()


@pytest.mark.parametrize("given", [True, ["1"], SECONDS, UREG.Quantity([1.0], "s")], ids=str)
def test_times_of_figures_and_analysis_that_are_none(given):
    ds = synthetic.constant_dataset(particles=50)
    values = np.ones(np.size(given))
    for take in (
        lambda: sx.plotting.size_distribution(ds, given),
        lambda: sx.plotting.scaling(ds, given),
        lambda: sx.analysis.extrema(given, values),
    ):
        with pytest.raises(sx.InputError, match=r"^times = "):
            take()
