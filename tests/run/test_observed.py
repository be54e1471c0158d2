"""What is observed, in units in which nothing is one: density 2.5, few sizes by themselves.

The constant kernel, ``n_k = n_0 (5/6)**k / 30`` when n_0 t is 10. The loops are those of all laws.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import runs

import smolux as sx
from shared import QUICK
from smolux.core.state import COUNTS, TRIALS
from smolux.results import to_dataset
from smolux.stochastic.observe import observable, to_records
from smolux.stochastic.replicas import Group
from smolux.stochastic.totals import attempts_of

DENSITY, PARTICLES = 2.5, 4000
#: standard errors by which a mean may be off
SIGMAS = 4.5


def simulate(method: str, population: str, **settings: Any) -> Any:
    given = {"particles": PARTICLES, "replicas": 16, "seed": 4, "sizes": 6} | settings
    model = runs.model(0.0, sx.initial.monodisperse(DENSITY), c1=0.0)
    return sx.simulate(model, [0.4, 4.0], method=method, population=population, **given)


def agree(values: Any, expected: Any) -> None:
    error = values.std(axis=0, ddof=1) / np.sqrt(len(values))
    assert (np.abs(values.mean(axis=0) - expected) < SIGMAS * error).all()


@pytest.mark.parametrize("method", QUICK)
def test_densities_of_sizes_and_of_bins(method: str) -> None:
    """Bins hold the sizes of their edges, the first one 7 alone; the volume is doubled twice."""
    ds = simulate(method, "doubling")
    last = ds.isel(time=-1)
    np.testing.assert_array_equal(ds["volume"].isel(time=0), PARTICLES / DENSITY)
    np.testing.assert_array_equal(last["volume"], 4 * PARTICLES / DENSITY)
    agree(last["n"].values, DENSITY * (5 / 6) ** np.arange(1, 7) / 30)
    low, high = last["bin_lower"].values, last["bin_upper"].values
    assert (low[0], high[0]) == (7, 8)
    np.testing.assert_array_equal(low[1:], high[:-1])
    # the sum of a geometric series; .0093 times the density in the first bin
    expected = DENSITY * ((5 / 6) ** low - (5 / 6) ** high) / 5
    assert expected[0] == pytest.approx(DENSITY * 0.0093, rel=1e-3)
    found = last["n_bin"].values
    many = expected * last["volume"].values.sum() > 200
    assert many.sum() >= 8
    agree(found[:, many], expected[many])
    # and no cluster is lost
    total = last["n"].sum("size") + last["n_bin"].sum("bin")
    np.testing.assert_allclose(total, last["number_density"], rtol=1e-12)
    agree(last["moment"].sel(order=0).values, DENSITY / 6)
    np.testing.assert_allclose(last["moment"].sel(order=1), DENSITY, rtol=1e-12)
    agree(last["moment"].sel(order=2).values, DENSITY * 11)


def test_a_target_is_what_the_result_has() -> None:
    """Also of clusters above the sizes that are counted by themselves."""
    model = runs.model(0.0, sx.initial.monodisperse(DENSITY), c1=0.0)
    for target, name, place in (
        ("M2", "moment", {"order": 2}),
        ("M0", "moment", {"order": 0}),
        ("n_3", "n", {"size": 3}),
        ("number_density", "number_density", {}),
        ("largest", "largest", {}),
    ):
        plan = runs.plan(
            model, [0.4, 4.0], "acceptance-rejection", sizes=6, replicas=8, target_error=0.1,
            target=target,
        )  # fmt: skip
        group = Group.start(plan, 0, 8)
        group.advance(lambda: False)
        assert plan.rule is not None
        values, moved = observable(plan, plan.rule, [group])
        ds = to_dataset(plan.model, to_records(plan, [group]))
        np.testing.assert_allclose(values, ds[name].sel(place), rtol=1e-12)
        assert moved.all()


def test_candidates_are_shared_among_processes() -> None:
    """Of 100, single particles had 30; those of encounters are shared as their events are."""
    p = sx.processes
    kinds = [p.Aggregation(), p.Shattering(0.1), p.Removal(0.1)]
    plan = runs.plan(replace(runs.model(), processes=kinds), [1.0], "size-class", replicas=2)
    count = np.zeros((2, COUNTS), int)
    count[:, TRIALS] = 100
    events, attempts = np.array([[30, 10, 5], [0, 0, 5]]), np.array([[0, 0, 30]] * 2)
    state = SimpleNamespace(count=count, events=events, attempts=attempts)
    found = attempts_of(plan, [SimpleNamespace(state=state)])  # type: ignore[list-item]
    np.testing.assert_allclose(found, [[52.5, 17.5, 30.0], [35.0, 35.0, 30.0]])


@pytest.mark.parametrize("method", QUICK)
def test_every_collision_takes_one_cluster_away(method: str) -> None:
    ds = simulate(method, "fixed-volume")
    np.testing.assert_array_equal(ds["volume"], PARTICLES / DENSITY)
    gone = ds["collisions"] / ds["volume"]
    np.testing.assert_allclose(gone + ds["number_density"], DENSITY, rtol=1e-12)
    agree(ds["number_density"].values, [DENSITY / 1.5, DENSITY / 6])
