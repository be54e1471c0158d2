"""Compiled functions of the events, one by one: in two dimensions and in three."""

from __future__ import annotations

import math

import numpy as np
import pytest

import smolux.spatial as sp
from smolux.jit.compile import entry
from smolux.spatial.events import direct, geometry, predicting, steps


@entry
def _power(x, axes):
    return geometry.power(x, axes)


@entry
def _largest(values):
    return geometry.largest(values)


@entry
def _speed(f, c):
    return predicting.speed(f, c)


@entry
def _apart(s, i, j):
    return steps.apart(s, i, j)


@entry
def _wall(discs):
    return direct.next_wall(discs)


def two(dimension: int, walls: str = "periodic") -> sp.System:
    """Return two discs, one of them near a wall and moving towards it along the last axis."""
    x, v = np.full((2, dimension), 5.0), np.zeros((2, dimension))
    x[0], v[0, -1] = 1.0, -2.0
    x[1, -1] = 9.0
    return sp.System(x, v, radius=0.5, box=(10.0,) * dimension, walls=walls)


@pytest.mark.parametrize("dimension", [2, 3])
class TestAxes:
    def test_powers(self, dimension):
        axes = tuple(range(dimension))
        assert _power(3, axes) == 3**dimension
        assert _power(1.5, axes) == 1.5**dimension

    def test_speed_of_a_cluster(self, dimension):
        flight = sp.Windowed().start(two(dimension), np.empty(0)).flight
        assert len(flight.axes) == dimension
        assert sorted(_speed(flight, c) for c in range(2)) == [0.0, 2.0]

    def test_distance_of_nearest_images(self, dimension):
        state = sp.TimeStepping().start(two(dimension), np.empty(0)).state
        # 4 along all axes but the last, where the way over the edge is shorter
        assert _apart(state, 0, 1) == pytest.approx(math.sqrt(16 * (dimension - 1) + 4))

    def test_the_next_wall(self, dimension):
        discs = sp.AllPairs().start(two(dimension, "reflecting"), np.empty(0)).discs
        assert _wall(discs) == (0.25, 0, dimension - 1)


def test_the_largest_of_none_is_zero():
    assert _largest(np.array([1.0, 3.0, 2.0])) == 3.0
    assert _largest(np.empty(0)) == 0.0
