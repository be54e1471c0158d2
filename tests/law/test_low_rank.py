"""The low-rank method with wide slots, which small systems never reach else, and mixed signs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import laws
import numpy as np
import pytest

import smolux as sx
from shared import extinction
from smolux import exact
from smolux.core.state import TRIALS
from smolux.kernels import Kernel, Majorant
from smolux.kernels.formula_kernel import FormulaKernel
from smolux.stochastic.make_plan import make_plan
from smolux.stochastic.replicas import Group

pytestmark = extinction

#: every size from 2 on lies in the pool, two and more sizes to a slot
WIDE = sx.methods.LowRank(bits=0)


#: ``1 + i**2 + j**2 - i j``, never below ``i + j``: of rank three, with a factor below zero
SIGNED = Majorant(((0.5, 0.0, 0.0), (0.5, 2.0, 0.0), (0.5, 0.0, 2.0), (-0.5, 1.0, 1.0)))


@dataclass(frozen=True)
class Given(FormulaKernel):
    """A law with the loop of all laws and a majorant of its own."""

    known: Majorant | None = None

    def majorant(self) -> Majorant | None:
        return self.known


def given(law: str, majorant: Majorant | None) -> Given:
    kernel = laws.kernel(law)
    return Given(kernel.expression, kernel.names, kernel.values, known=majorant)


def partitions(model: sx.Model, method: Any, times: tuple[float, ...], shattering: float) -> None:
    particles, replicas = 8, 20_000
    ds = sx.simulate(
        model, times, method=method, population="fixed-volume", particles=particles,
        replicas=replicas, sizes=8, seed=21,
    )  # fmt: skip
    assert ds.attrs["warnings"].count("bound") == 0
    for k, t in enumerate(times):
        _, p = exact.finite.partition_pmf(model.kernel, particles, t, shattering=shattering)
        found = laws.chi_square(laws.partition_counts(ds, particles, k), replicas * p)
        assert found > laws.RARE, (t, found)


@pytest.mark.parametrize("method", [sx.methods.LowRank(), WIDE])
def test_factors_of_mixed_sign(method: Any) -> None:
    processes = [sx.processes.Aggregation(), sx.processes.Shattering(0.1)]
    partitions(sx.Model(given("additive", SIGNED), processes), method, (0.3, 1.0), 0.1)


@pytest.mark.parametrize("law", [pytest.param("additive", marks=pytest.mark.slow), "ballistic"])
def test_wide_slots(law: str) -> None:
    laws.whole_distribution(WIDE, law, 0.1)
    laws.mass(WIDE, law, "doubling")
    laws.agreement([WIDE, sx.methods.LowRank(bits=6)], law)


@pytest.mark.slow
@pytest.mark.parametrize("shattering", [0.0, 0.1])
def test_laws_that_bring_their_majorant(shattering: float) -> None:
    processes = [sx.processes.Aggregation(), sx.processes.Shattering(shattering)]
    model = sx.Model(sx.kernels.Brownian(), processes)
    partitions(model, sx.methods.LowRank(bits=1), (0.3, 1.0), shattering)


def _group(kernel: Kernel, method: Any, particles: int, end: float, replicas: int = 1) -> Group:
    model = sx.Model(kernel, [sx.processes.Aggregation(), sx.processes.Shattering(0.01)])
    plan = make_plan(
        model,
        [0.5 * end, end],
        method=method,
        particles=particles,
        replicas=replicas,
        seed=5,
        orders=(0, 1),
        sizes=64,
    )
    return Group.start(plan, 0, replicas)


@pytest.mark.slow
@pytest.mark.parametrize("method", [WIDE, sx.methods.LowRank(), sx.methods.FictitiousJumps()])
@pytest.mark.parametrize("kernel", [sx.kernels.Ballistic(), sx.kernels.formula("i + j")], ids=repr)
def test_a_replica_does_not_depend_on_the_others(kernel: Kernel, method: Any) -> None:
    together = _group(kernel, method, 400, 3.0, 4)
    together.advance(lambda: False)
    for r in range(4):
        alone = Group.start(together.plan, r, 1)
        while not alone.done:
            alone._call(alone.codes, 997)
            alone._serve()
        np.testing.assert_array_equal(alone.state.rng[0], together.state.rng[r])
        np.testing.assert_array_equal(alone.state.clock[0], together.state.clock[r])
        for a, b in zip(alone.tally, together.tally, strict=True):
            np.testing.assert_array_equal(a[0], b[r])


@pytest.mark.parametrize(
    ("kernel", "most"),
    [
        pytest.param(sx.kernels.Brownian(), 1.02, marks=pytest.mark.slow),
        pytest.param(sx.kernels.Ballistic(), 1.42, marks=pytest.mark.slow),
        (given("ballistic", sx.kernels.Ballistic().majorant()), 1.42),
    ],
    ids=repr,
)
def test_few_candidates_are_rejected(kernel: Kernel, most: float) -> None:
    group = _group(kernel, "low-rank", 2000, 2.0)
    group.advance(lambda: False)
    assert group.state.count[0, TRIALS] < most * group.events


@pytest.mark.slow
def test_one_huge_cluster_and_many_particles() -> None:
    start = sx.initial.Sizes((1, 3, 10**9 + 7), (0.9, 0.099, 0.001))
    model = sx.Model(sx.kernels.Brownian(), initial=start)
    ds = sx.simulate(
        model, [0.1, 0.2], method="low-rank", population="fixed-volume", particles=3000, replicas=2,
        seed=3, distribution=True,
    )  # fmt: skip
    for replica in range(2):
        before, after = (sx.results.population(ds, replica, t) for t in (0.1, 0.2))
        assert before[0] @ before[1] == after[0] @ after[1]
        assert after[0][-1] > 10**9
        assert after[1].sum() < before[1].sum()
