"""A trajectory depends on the model, the seed and the replica, and on nothing else."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
import runs

import smolux as sx
from shared import EVERY, QUICK, VARYING
from smolux.stochastic import replicas
from smolux.stochastic import simulation as stochastic
from smolux.stochastic.replicas import Group

every_method = pytest.mark.parametrize("method", EVERY)
TIMES = [0.5, 3.0]


def simulate(method: str, rate: Any = 0.1, times: Any = TIMES, **settings: Any) -> Any:
    given = {"particles": 150, "replicas": 3, "seed": 5, "sizes": 40, "orders": (0, 1, 2)}
    return sx.simulate(runs.model(rate), times, method=method, **given | settings)


@runs.every_rate
def test_output_times(method: str, rate: Any) -> None:
    sparse = simulate(method, rate)
    assert sparse.attrs["events"] > 200
    assert sparse.attrs["doublings"] > 0 or rate == VARYING
    dense = simulate(method, rate, times=np.unique([0.0, *np.linspace(0.01, 3.0, 200), *TIMES]))
    runs.assert_same(sparse, dense)
    longer = simulate(method, rate, times=[0.5, 3.0, 3.5])
    runs.assert_same(sparse, longer, "extinction_time", "attempts")  # of the whole run


@every_method
def test_whole_populations_change_nothing(method: str) -> None:
    given = simulate(method)
    whole = simulate(method, distribution=True)
    for name in ("n", "collisions", "volume", "moment", "largest"):
        np.testing.assert_array_equal(given[name], whole[name])


@runs.every_rate
def test_budget_of_a_call(method: str, rate: Any) -> None:
    plan = runs.plan(runs.model(rate), TIMES, method)
    ends = []
    for budgets in ([10**9], [1], [1, 7, 2, 40]):
        group = Group.start(plan, 0, plan.replicas)
        calls = 0
        while not group.done:
            group._call(group.codes, budgets[calls % len(budgets)])
            group._serve()
            calls += 1
            assert calls < 100_000
        ends.append((calls, group))
    (few, whole), *others = ends
    for calls, group in others:
        assert calls > 10 * few
        for kind in ("state", "tally"):
            for name, values in getattr(whole, kind)._asdict().items():
                np.testing.assert_array_equal(values, getattr(getattr(group, kind), name), name)


@every_method
def test_length_of_a_slice(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = simulate(method, particles=3000)
    monkeypatch.setattr(replicas, "_SLICE", 1e-9)
    runs.assert_same(expected, simulate(method, particles=3000))


@runs.every_rate
def test_threads_and_groups(method: str, rate: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = simulate(method, rate, replicas=5)
    for workers in (2, 16):
        monkeypatch.setattr(stochastic, "cores", lambda n=workers: n)
        runs.assert_same(expected, simulate(method, rate, replicas=5))
    for workers in (1, 2):
        with ThreadPoolExecutor(workers) as executor:
            runs.assert_same(expected, simulate(method, rate, replicas=5, executor=executor))


def test_groups_hold_each_replica_once() -> None:
    for number, start, workers in ((7, 0, 2), (5, 0, 3), (9, 4, 2), (3, 0, 8)):
        plan = runs.plan(runs.model(), TIMES, "size-class", replicas=number)
        groups = plan.groups(workers, start)
        assert [r for first, n in groups for r in range(first, first + n)] == list(
            range(start, number)
        )


def test_processes() -> None:
    with ProcessPoolExecutor(1) as executor:
        for method in runs.METHODS:
            rate = VARYING if method in QUICK else 0.1
            runs.assert_same(simulate(method, rate), simulate(method, rate, executor=executor))


@runs.every_rate
def test_number_of_replicas(method: str, rate: Any) -> None:
    few, many = simulate(method, rate, replicas=2), simulate(method, rate, replicas=7)
    runs.assert_same(few, many)
    # and they are different ones
    assert len(np.unique(many["collisions"].isel(time=-1))) > 3


@every_method
def test_seed(method: str) -> None:
    first = simulate(method, seed=None)
    again = simulate(method, seed=int(first.attrs["seed"]))
    runs.assert_same(first, again)
    assert (first["collisions"] != simulate(method, seed=6)["collisions"]).any()
