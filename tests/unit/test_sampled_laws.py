"""Laws that are known by their values only: what a sample must not step over."""

from __future__ import annotations

import math

import numpy as np
import pytest

from smolux import kernels
from smolux.functions.time import TimeFunction
from smolux.processes import Removal
from smolux.stochastic.time_windows import time_windows_for

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


def one_difference(i: float, j: float) -> float:
    return 1.0 if abs(i - j) == 301 else 1e-9


def with_one_size(i: float, j: float) -> float:
    return max(i, j) if 101 in (i, j) else 1e-9


def peak(i: float, j: float) -> float:
    """Highest near 77.8, above the size of the coarse grid that is next to it."""
    if i <= 0:
        return 0.0
    return math.exp(-555 * ((math.log(i) - 4.354) ** 2 + (math.log(j) - 4.354) ** 2))


def bump(i: float, j: float) -> float:
    """Five per cent more with the size 91, which it does not name and the grid does not hold."""
    return 1.05 if abs(i * i - 8281.3) < 1 or abs(j * j - 8281.3) < 1 else 1.0


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
    windows = time_windows_for([Removal(0.1, varying=spike)], 100.0)
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


@pytest.mark.parametrize(
    ("function", "box"),
    [
        (one_difference, (448, 511, 128, 191)),
        (one_difference, (128, 191, 448, 511)),
        (with_one_size, (64, 127, 1024, 2047)),
        (with_one_size, (1024, 2047, 64, 127)),
        (peak, (64, 127, 64, 127)),
        (bump, (64, 127, 64, 127)),
    ],
)
def test_bounds_by_trial_hold(function: object, box: tuple[int, int, int, int]) -> None:
    """Of differences and sizes that a law names, of peaks, and of a little that is missed."""
    kernel = kernels.from_function(function)
    assert not kernel.rigorous
    a, b, c, d = box
    values = kernel(np.arange(a, b + 1.0)[:, None], np.arange(c, d + 1.0))
    assert values.max() <= kernel.bounds(*box)[1] <= 1.2 * values.max()
