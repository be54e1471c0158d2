"""Trajectories depend neither on slices, nor on the growth of stores, nor on other replicas.

How long a slice is depends on the clock, and a store grows when any replica of its group is full.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import runs

import smolux as sx
from smolux import processes
from smolux.core.state import GROW, STORED
from smolux.methods import base
from smolux.methods.acceptance_rejection import method as acceptance_rejection
from smolux.methods.acceptance_rejection.pieces import SLACK
from smolux.methods.inverse import method as inverse
from smolux.methods.low_rank import method as low_rank
from smolux.methods.low_rank.store import POOL_NEEDED, TAIL
from smolux.methods.size_class import method as size_class
from smolux.methods.size_class.state import CHUNK, FREE
from smolux.runtime import files
from smolux.stochastic.make_plan import make_plan
from smolux.stochastic.replicas import Group

slow = pytest.mark.slow
METHODS = [
    pytest.param(m.name, marks=() if m.name == "size-class" else slow) for m in sx.methods.METHODS
]
PAIRS = [processes.Aggregation(), processes.Shattering("0.1 * (1 + sin(t)**2)")]
OPEN = [processes.Aggregation(), processes.Removal(0.12), processes.Source({1: 1.0, 10: 0.1})]
UNARY = [
    processes.Aggregation(),
    processes.Fragmentation("0.05/(i + j)"),
    processes.Source(2.0, varying="1 + sin(t)"),
]
#: name, processes, density of monomers at the start, particles, end
CASES = {
    "pairs": (PAIRS, 1.0, 300, 6.0),
    "open": (OPEN, 0.012, 150, 1.0),
    "open, fewer at the start": (OPEN, 0.3, 20, 9.0),
    "single": (UNARY, 0.5, 40, 6.0),
}


def started(case: str, method: str, population: str, first: int, count: int) -> Group:
    kinds, density, particles, end = CASES[case]
    model = sx.Model(sx.kernels.formula("1 + 0*(i + j)"), kinds, sx.initial.monodisperse(density))
    plan = make_plan(
        model,
        [0.3 * end, end],
        method=method,
        population=population,
        particles=particles,
        replicas=3,
        seed=5,
        orders=(0, 1),
        sizes=16,
    )
    return Group.start(plan, first, count)


def finished(group: Group, budget: int) -> Group:
    while not group.done:
        group._call(group.codes, budget)
        group._serve()
    return group


def assert_same(one: Group, other: Group, a: Any, b: Any) -> None:
    for name in ("rng", "clock", "count", "events", "attempts"):
        values = getattr(one.state, name)[a], getattr(other.state, name)[b]
        np.testing.assert_array_equal(*values, err_msg=name)
    for name in one.tally._fields:
        values = getattr(one.tally, name)[a], getattr(other.tally, name)[b]
        np.testing.assert_array_equal(*values, err_msg=name)


@pytest.mark.parametrize(
    ("case", "population"),
    [
        ("open", "doubling"),
        ("open, fewer at the start", "doubling"),
        pytest.param("open", "fixed-volume", marks=slow),
        pytest.param("pairs", "doubling", marks=slow),
        pytest.param("single", "fixed-volume", marks=slow),
    ],
)
@pytest.mark.parametrize("method", METHODS)
def test_slices_of_any_length(method: str, case: str, population: str) -> None:
    whole = finished(started(case, method, population, 0, 3), 1 << 40)
    for budget in (1, 7, 1000):
        other = finished(started(case, method, population, 0, 3), budget)
        assert_same(whole, other, slice(None), slice(None))
    for r in range(3):
        assert_same(whole, finished(started(case, method, population, r, 1), 7), r, 0)


# --- stores that grow by the least, and runs that are written at every turn -----------------------


@pytest.fixture
def grudging(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every store grow by the least that is possible."""

    def by_one(array: Any, capacity: int) -> Any:
        return base.enlarged(array, array.shape[-1] + 1)

    def by_a_chunk(work: Any) -> Any:
        return size_class._with_chunks(work, work.free.shape[1] + 1, work.where.shape[2] + 1)

    grow = low_rank.LowRank.grow

    def by_an_entry(method: Any, work: Any, state: Any) -> Any:
        wanted = work.meta[:, POOL_NEEDED]
        wanted[:] = np.minimum(wanted, work.pool.shape[1] + 1)
        return grow(method, work, state)

    monkeypatch.setattr(acceptance_rejection, "enlarged", by_one)
    monkeypatch.setattr(inverse, "enlarged", by_one)
    monkeypatch.setattr(size_class, "_more_chunks", by_a_chunk)
    monkeypatch.setattr(low_rank.LowRank, "grow", by_an_entry)


def cut(group: Group) -> Group:
    """Leave a store no room that it does not need."""
    work, stored = group.work, int(group.state.count[:, STORED].max())
    shorter = {}
    if "free" in work._fields:  # chunks are taken from the end of the list of free ones
        old, chunk = work.free.shape[1], int(work.meta[0, CHUNK])
        used = max(1, old - int(work.meta[:, FREE].min()))
        work.meta[:, FREE] -= old - used
        longest = -(-int(work.number.max()) >> chunk)
        shorter = {
            "free": work.free[:, -used:],
            "pool": work.pool[:, : used << chunk],
            "where": work.where[:, :, : longest + 1],
        }
    elif "sizes" in work._fields:
        shorter["sizes"] = work.sizes[:, : stored + SLACK]
    elif "large" in work._fields:
        shorter = {name: getattr(work, name)[:, : stored + 1] for name in ("large", "large_rate")}
    elif "tree" in work._fields:
        shorter["pool"] = work.pool[:, : int(work.meta[:, TAIL].max()) + 1]
    group.work = work._replace(**{name: array.copy() for name, array in shorter.items()})
    return group


@pytest.mark.parametrize(
    ("case", "population"),
    [
        ("open, fewer at the start", "doubling"),
        pytest.param("open", "fixed-volume", marks=slow),
        pytest.param("pairs", "doubling", marks=slow),
        pytest.param("single", "fixed-volume", marks=slow),
    ],
)
@pytest.mark.parametrize("method", METHODS)
def test_growth_by_the_least_and_resuming_at_every_slice(
    method: str,
    case: str,
    population: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
) -> None:
    whole = finished(started(case, method, population, 0, 3), 1 << 40)
    request.getfixturevalue("grudging")
    monkeypatch.setattr(files, "_sync", lambda *_: None)  # nothing here is to last
    grown = 0
    # a slice of one candidate comes to thousands of files
    for budget, every in ((1, 300), (7, 40), (1000, 1)):
        group, turn = cut(started(case, method, population, 0, 3)), 0
        while not group.done:
            group._call(group.codes, budget)
            if (group.codes == GROW).any():
                grown += 1
                expected = group.plan.method.growth(group.work, group.state)
                before = group.work
                group._serve()
                new = [a for a, b in zip(group.work, before, strict=True) if a is not b]
                assert sum(a.nbytes for a in new) <= expected
            else:
                group._serve()
            turn += 1
            if turn % every == 0:
                group = runs.written(group, tmp_path / "run.npz")
        assert_same(whole, group, slice(None), slice(None))
    # the inverse method counts the sizes that come here, and has no list of large ones to grow
    assert grown or (method == "inverse" and case in ("open", "pairs"))
