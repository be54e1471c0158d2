"""Laws that are known by their values only: what a sample must not step over."""

from __future__ import annotations

import numpy as np
import pytest

from smolux import kernels
from smolux.processes import Removal
from smolux.timefunction import TimeFunction
from smolux.windows import windows_for

TABLE = np.array([0.0, 7.0, 7.01, 7.02, 100.0])
VALUES = np.array([0.0, 0.0, 50.0, 0.0, 0.0])


def spike(t: float) -> float:
    return 1000.0 if 30 < t < 30.001 else 0.0


def day_and_night(t: float) -> float:
    return 1.0 if t % 1 > 0.5 else 0.0


def table(t: float) -> float:
    return float(np.interp(t, TABLE, VALUES))


def one_sum(i: float, j: float) -> float:
    return 1.0 if i + j == 1001 else 1e-9


def one_pair(i: float, j: float) -> float:
    return 1.0 if min(i, j) == 37 and max(i, j) == 41 else 0.0


@pytest.mark.parametrize(
    ("function", "window", "peak"),
    [
        (spike, (28, 32), 1000.0),
        (day_and_night, (512, 640), 1.0),
        (day_and_night, (1792, 2048), 1.0),
        (table, (6, 8), 50.0),
    ],
)
def test_functions_of_time(function: object, window: tuple[float, float], peak: float) -> None:
    low, high = TimeFunction.of(function).bounds(*window)
    assert low == 0
    assert high >= peak


def test_no_window_of_zero_beside_one_that_is_not() -> None:
    """A bound of zero is never tried, and so never repaired."""
    windows = windows_for([Removal(0.1, varying=spike)], 100.0)
    upper, edges = windows.bounds[:, 0], windows.edges
    peak = int(np.searchsorted(edges, 30.0, side="right")) - 1  # from 30 on, which it names
    assert upper[peak] >= 1000
    assert upper[peak - 1] > 0
    assert upper[peak + 1] > 0


def test_kernels() -> None:
    upper = kernels.from_function(one_sum).bounds([448, 1, 600], [511, 1, 700], 512, 575)[1]
    assert upper[0] >= 1
    assert (upper[1:] < 1e-8).all()
    kernel = kernels.from_function(one_pair)
    assert kernel.bounds(32, 40, 40, 47)[1] >= 1
    assert kernel.problems() == []
