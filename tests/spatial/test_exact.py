"""The three methods make the same merges, in the same order, at the same times."""

from __future__ import annotations

import numpy as np
import plain_numpy
import pytest
from flights import METHODS, assert_same, merges, run, system, wide_system

import smolux.spatial as sp
from smolux.spatial.results.eventlog import Logger


@pytest.mark.parametrize("number", range(100))
def test_windowed_is_all_pairs_is_cells(number):
    s = system(number, most=200 if number < 6 else 60)
    pairs = run(s, "all-pairs")
    assert pairs.stopped == ""
    assert len(merges(pairs)) == len(s) - 1  # a tree
    assert_same(run(s, "windowed"), pairs)
    assert_same(run(s, "cells"), pairs)


@pytest.mark.parametrize("number", range(12))
def test_in_space_against_plain_numpy(number):
    s = system(number, dimension=3, most=24)
    expected = plain_numpy.merges(s)
    for method in ("windowed", "cells"):
        trace = run(s, method)
        np.testing.assert_array_equal(merges(trace), [[i, j] for _, i, j in expected])
        times = trace.log.time[trace.log.merges]
        np.testing.assert_allclose(times, [t for t, _, _ in expected], rtol=1e-9)


@pytest.mark.parametrize("number", range(30))
def test_radii_that_differ_widely(number):
    s = wide_system(number)
    assert s.radius.max() >= 50 * s.radius.min()
    pairs = run(s, "all-pairs")
    assert len(merges(pairs)) == len(s) - 1
    assert_same(run(s, "windowed"), pairs)
    thin = sp.Windowed(skin=2 * s.radius.mean())
    assert len(thin.start(s, np.empty(0)).flight.cells) > 1  # grids for several levels
    assert_same(run(s, thin), pairs)


@pytest.mark.parametrize("number", range(8))
def test_radii_that_differ_widely_in_space(number):
    s = wide_system(number, dimension=3, most=40)
    trace = run(s, sp.Windowed(skin=2 * s.radius.mean()))
    expected = plain_numpy.merges(s)
    np.testing.assert_array_equal(merges(trace), [[i, j] for _, i, j in expected])
    times = trace.log.time[trace.log.merges]
    np.testing.assert_allclose(times, [t for t, _, _ in expected], rtol=1e-9)


@pytest.mark.parametrize("number", range(5))
def test_all_pairs_against_plain_numpy(number):
    s = system(number, most=20)
    expected = plain_numpy.merges(s)
    np.testing.assert_array_equal(merges(run(s, "all-pairs")), [[i, j] for _, i, j in expected])


@pytest.mark.parametrize("skin", [1e-3, 0.05, 3.0])
def test_the_skin_changes_the_cost_only(skin):
    s = sp.lattice(225, 0.3, seed=5, walls=("periodic", "reflecting"))
    assert_same(run(s, sp.Windowed(skin=skin)), run(s, "windowed"))


def test_stopping_and_going_on_changes_nothing():
    s = sp.lattice(144, 0.2, seed=8)
    whole, parts = run(s, "windowed"), sp.Windowed().start(s, np.empty(0))
    for until in (0.3, 0.31, 1.0, 4.0):
        while parts.advance(until, 1, 3) is None:
            assert parts.time <= until
        assert parts.time == until
    while parts.advance(np.inf, 1, 1) is None:
        pass
    assert_same(parts.trace(), whole)


def far_pair(dimension: int, miss: float, angle: float) -> sp.System:
    """Two discs of radius 1 that fly towards each other across a box of side 1e9.

    Their centres pass at `2 + miss`.
    """
    ahead, aside = np.zeros(dimension), np.zeros(dimension)
    ahead[:2] = np.cos(angle), np.sin(angle)
    aside[:2] = -np.sin(angle), np.cos(angle)
    if dimension == 3:  # both out of the plane
        ahead[1:] = ahead[1] * 0.6, ahead[1] * 0.8
        aside[1:] = aside[1] * 0.6, aside[1] * 0.8
    way = 4e8 * ahead + (2 + miss) / 2 * aside
    return sp.System(5e8 + np.array([-way, way]), np.array([ahead, -ahead]), radius=1.0, box=1e9)


@pytest.mark.parametrize(
    ("dimension", "method"),
    [(2, "windowed"), (2, "cells"), (2, "all-pairs"), (3, "windowed"), (3, "cells")],
)
def test_a_miss_from_afar_is_a_miss(dimension, method):
    for angle in (0.0, 0.3, 1.1, 2.5):
        assert len(merges(run(far_pair(dimension, 1.0, angle), method, until=4.1e8))) == 0
        trace = run(far_pair(dimension, -1.0, angle), method, until=4.1e8)
        np.testing.assert_array_equal(merges(trace), [[0, 1]])
        # centres at 1 aside touch at sqrt(3) ahead; positions are known to 1e-7
        time = trace.log.time[trace.log.merges]
        np.testing.assert_allclose(time, 4e8 - np.sqrt(3) / 2, rtol=0, atol=1e-6)


@pytest.mark.parametrize("method", ["all-pairs", "cells", "windowed"])
def test_a_box_hardly_wider_than_two_discs(method):
    """Two images of a disc are near another one all the time: neither may cut the steps short."""
    for room in (1e-7, 1e-9):
        s = sp.System(
            position=[[0.1, 0.1], [1.12, 1.05]], velocity=[[1.0, 0.3], [-0.4, 0.2]], radius=0.5,
            box=2.0 + room, walls="periodic",
        )  # fmt: skip
        current = METHODS[method]().start(s, np.empty(0))
        stopped = None
        for _ in range(200):
            stopped = stopped if stopped is not None else current.advance(np.inf, 1, 10)
        assert stopped == ""
        np.testing.assert_array_equal(merges(current.trace()), [[0, 1]])
        # the first of all images to be touched
        gap = (
            s.position[1]
            - s.position[0]
            + s.box.lengths[0] * np.array([[a, b] for a in (-1, 0, 1) for b in (-1, 0, 1)])
        )
        w = s.velocity[1] - s.velocity[0]
        b, c = gap @ w, (gap**2).sum(1) - 1.0
        square = b**2 - (w @ w) * c
        times = np.where((square >= 0) & (b < 0), c / (np.sqrt(np.maximum(square, 0)) - b), np.inf)
        assert current.time == pytest.approx(times.min(), rel=1e-12)


@pytest.mark.parametrize("method", ["cells", "windowed"])
def test_reflections_in_a_slit_are_counted(method, monkeypatch):
    """The log of a disc that goes to and fro in a narrow slit does not grow with each touch."""
    s = sp.System(
        position=[[2.0, 0.5005], [3.5, 0.501], [0.6, 0.5]], radius=0.5, box=(10.0, 1.002),
        velocity=[[1.0, 1.0], [1.5, -0.7], [0.05, 0.9]],
    )  # fmt: skip
    each = sp.simulate(s, method, until=8.0)
    monkeypatch.setattr(Logger, "_MANY", 500)
    few = sp.simulate(s, method, until=8.0)
    walls = few["walls"]
    assert walls.sizes["reflection"] < each["walls"].sizes["reflection"] / 20
    total = walls.sizes["reflection"] + int(walls["more"].sum())
    assert total == each["walls"].sizes["reflection"] > 4000
    half = sp.simulate(s, method, until=3.0)
    for one in (few, sp.resume(half, until=8.0)):
        assert one["events"].sizes["event"] == 1
        for t in (*np.random.default_rng(1).uniform(0.0, 8.0, 40), 7.9991):
            a, b = sp.replay(each, float(t)), sp.replay(one, float(t))
            np.testing.assert_allclose(a["position"], b["position"], rtol=0, atol=1e-9)
            np.testing.assert_allclose(a["velocity"], b["velocity"], rtol=0, atol=1e-12)
