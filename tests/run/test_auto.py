"""The choice of a method."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import smolux as sx
from shared import FORMULA
from smolux.methods.costs import Circumstances, choose, effort
from smolux.stochastic.rates import rates_for
from smolux.weighting import Number

AGGREGATION = [sx.processes.Aggregation()]


def estimate(kernel: Any, particles: int, end: float, processes: Any = AGGREGATION) -> float:
    rates = rates_for(sx.Model(kernel, processes), Number())
    return effort(Circumstances(rates, processes, particles, 1.0, (1.0, 1.0), end))[0]


def test_a_constant_kernel_is_never_rejected() -> None:
    assert estimate(sx.kernels.Constant(), 10_000, 100.0) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("law", "particles", "end"),
    [("ballistic", 20_000, 20.0), ("additive", 5_000, 1.0)],
)
def test_the_estimate_is_near_what_a_run_needs(law: str, particles: int, end: float) -> None:
    from smolux.stochastic.make_plan import make_plan
    from smolux.stochastic.replicas import Group

    given = {"c0": 0.0, "c1": 0.0, "c2": 0.0, "c3": 0.0}
    kernel = sx.kernels.formula(
        FORMULA, **given | {"additive": {"c1": 1.0}, "ballistic": {"c3": 1.0}}[law]
    )
    processes = [sx.processes.Aggregation(), sx.processes.Shattering(0.0)]
    plan = make_plan(
        sx.Model(kernel, processes),
        [end],
        method="acceptance-rejection",
        particles=particles,
        replicas=2,
        seed=1,
        orders=(0,),
        sizes=16,
    )
    group = Group.start(plan, 0, 2)
    group.advance(lambda: False)
    from smolux.core.state import EVENTS, TRIALS

    needed = group.state.count[:, TRIALS].sum() / group.state.count[:, EVENTS].sum()
    assert estimate(kernel, particles, end) == pytest.approx(needed, rel=0.6)


def test_what_is_chosen_and_why_stands_in_the_result() -> None:
    ds = sx.simulate(
        sx.Model(sx.kernels.Constant()), [1000.0], particles=10_000, replicas=8, seed=1
    )
    assert ds.attrs["method"] == "acceptance-rejection"
    assert "candidates an event" in ds.attrs["method_reason"]
    given = sx.simulate(
        sx.Model(sx.kernels.Constant()), [1000.0], particles=10_000, replicas=8, seed=1,
        method="acceptance-rejection",
    )  # fmt: skip
    assert given.attrs["method_reason"] == "asked for"
    np.testing.assert_array_equal(ds["n"], given["n"])


def test_kernels_far_below_their_bound_are_not_left_to_rejection() -> None:
    for kernel in (sx.kernels.GeneralizedBrownian(0.95), sx.kernels.Multiplicative()):
        rates = rates_for(sx.Model(kernel, AGGREGATION), Number())
        method, reason = choose(Circumstances(rates, AGGREGATION, 100_000, 1.0, (1.0, 1.0), 100.0))
        assert method.name == "size-class", reason


@pytest.mark.parametrize(
    ("kernel", "particles", "end", "method"),
    [
        (sx.kernels.Additive(), 1_000, 1.0, "low-rank"),
        (sx.kernels.Additive(), 50_000, 3.0, "size-class"),
        (sx.kernels.Brownian(), 1_000, 1.0, "size-class"),  # two products
        (sx.kernels.Constant(), 5_000, 300.0, "acceptance-rejection"),  # nothing is rejected
        (sx.kernels.Constant(), 1_000, 1.0, "low-rank"),  # the start is all
    ],
)
def test_one_product_and_few_particles_are_for_low_rank(
    kernel: Any, particles: int, end: float, method: str
) -> None:
    rates = rates_for(sx.Model(kernel, AGGREGATION), Number())
    run = Circumstances(rates, AGGREGATION, particles, 1.0, (1.0, 1.0), end, replicas=4)
    found, reason = choose(run)
    assert found.name == method, reason


def test_shattering_and_rates_that_fade_are_followed() -> None:
    fading = [sx.processes.Aggregation(), sx.processes.Shattering("0.1*max(0, 1 - t/5)")]
    assert 1.0 < estimate(sx.kernels.Ballistic(), 10_000, 50.0, fading) < 50.0
