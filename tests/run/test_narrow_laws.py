"""Rates that differ from zero in a narrow place of time: nothing steps over it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import smolux as sx
from smolux.functions.time import TimeFunction

HOURS = np.array([0.0, 7.0, 7.01, 7.02, 100.0])
FLOW = np.array([0.0, 0.0, 50.0, 0.0, 0.0])
SPIKE, DAY_AND_NIGHT, TABLE, SQUARE = 0.0, 1.0, 2.0, 3.0
#: hardly ever do particles meet
RARELY = sx.kernels.Constant(1e-12)


def inflow(t: float, kind: float = SPIKE) -> float:
    if kind == DAY_AND_NIGHT:
        return 0.01 if t % 1 > 0.5 else 0.0
    if kind == TABLE:
        return float(np.interp(t, HOURS, FLOW))
    if kind == SPIKE:
        return 1000.0 if 30 < t < 30.001 else 0.0
    return 1000.0 if 900 < t * t < 900.06 else 0.0


def varying(kind: float, breakpoints: Any = ()) -> TimeFunction:
    """A kind of it, as data: all tests here need one loop."""
    law = TimeFunction.of(sx.law(inflow, breakpoints=breakpoints))
    return replace(law, parameters=(kind,))


@pytest.mark.parametrize(
    ("kind", "breakpoints", "end", "comes"),
    [
        (SPIKE, (), 100.0, 1.0),
        (DAY_AND_NIGHT, (), 2000.0, 10.0),
        (TABLE, (), 50.0, 0.5),
        (SQUARE, np.sqrt([900.0, 900.06]), 100.0, 1000.0 * (np.sqrt(900.06) - 30.0)),
    ],
)
def test_what_comes_in(kind: float, breakpoints: Any, end: float, comes: float) -> None:
    source = sx.processes.Source(1.0, varying=varying(kind, breakpoints))
    model = sx.Model(RARELY, [source], sx.initial.monodisperse(density=1.0))
    ds = sx.simulate(
        model, [end], particles=200, replicas=8, seed=3, population="fixed-volume",
        method="acceptance-rejection",
    )  # fmt: skip
    expected = 8 * 200 * comes
    found = float(ds["events"].sum())
    assert abs(found - expected) < 4.5 * np.sqrt(expected)
    assert ds.attrs["warnings"] == "[]"
