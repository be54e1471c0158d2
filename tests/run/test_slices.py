"""Trajectories depend neither on slices, nor on the growth of stores, nor on other replicas.

How long a slice is depends on the clock, and a store grows when any replica of its group is full.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import smolux as sx
from smolux import processes
from smolux.plan import make_plan
from smolux.replicas import Group

slow = pytest.mark.slow
METHODS = [
    pytest.param(m.name, marks=() if m.name == "size-class" else slow) for m in sx.methods.METHODS
]
PAIRS = [processes.Aggregation(), processes.Shattering("0.1 * (1 + sin(t)**2)")]
OPEN = [processes.Aggregation(), processes.Removal(0.12), processes.Source({1: 1.0, 10: 0.1})]
LONE = [
    processes.Aggregation(),
    processes.Fragmentation("0.05/(i + j)"),
    processes.Source(2.0, varying="1 + sin(t)"),
]
#: name, processes, density of monomers at the start, particles, end
CASES = {
    "pairs": (PAIRS, 1.0, 300, 6.0),
    "open": (OPEN, 0.012, 150, 5.0),
    "open, fewer at the start": (OPEN, 0.3, 20, 9.0),
    "single": (LONE, 0.5, 40, 6.0),
}


def started(case: str, method: str, population: str, first: int, count: int) -> Group:
    kinds, density, particles, end = CASES[case]
    model = sx.Model(sx.kernels.formula("1 + 0*(i + j)"), kinds, sx.initial.monodisperse(density))
    plan = make_plan(
        model, [0.3 * end, end], method, "number", population, particles, 3, 5, (0, 1), 16, 4, False
    )
    return Group.start(plan, first, count)


def finished(group: Group, budget: int) -> Group:
    while not group.done:
        group._call(group.codes, budget)
        group._serve()
    return group


def assert_same(one: Group, other: Group, a: Any, b: Any) -> None:
    for name in ("rng", "clock", "count", "events"):
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
