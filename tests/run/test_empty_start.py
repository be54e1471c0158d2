"""Systems that begin empty: their volume follows from what comes in, and they are not doubled."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import smolux as sx
from smolux import processes
from smolux.cli.estimate import Pilot
from smolux.stochastic.make_plan import make_plan
from smolux.stochastic.plan import Plan
from smolux.stochastic.time_windows import time_windows_for


def planned(
    varying: Any, parts: int = 1, end: float = 10.0, weighting: str = "number", times: Any = None
) -> Plan:
    kinds = [processes.Aggregation(), processes.Source({1: 1.5, 2: 0.5}, varying=varying)]
    model = sx.Model(sx.kernels.Constant(), kinds, sx.initial.empty())
    return make_plan(
        model,
        times or [end],
        method="size-class",
        weighting=weighting,
        particles=2000,
        replicas=1,
        seed=1,
        orders=(0, 1),
        sizes=8,
        subvolumes=parts,
    )


@pytest.mark.parametrize(
    ("varying", "mean"),
    [(1.0, 1.0), ("t", 5.0), ("max(0, t - 5)", 1.25), ("1e-9 + t", 5.0), (lambda t: 3 * t, 15.0)],
)
def test_the_volume_follows_from_the_mean_inflow(varying: Any, mean: float) -> None:
    assert planned(varying).volume == pytest.approx(2000 / (2.0 * mean), rel=2e-3)


def test_the_volume_counts_what_is_simulated_until_the_end() -> None:
    """By mass, one of the size two counts twice; the first output time does not matter."""
    assert planned("t", weighting="mass-flow").volume == pytest.approx(2000 / (2.5 * 5), rel=2e-3)
    assert planned("t", times=[1.0, 10.0]).volume == pytest.approx(2000 / (2.0 * 5), rel=2e-3)


def test_a_source_brings_in_what_is_simulated() -> None:
    """By mass, half a dimer beside one and a half monomers is two fifths."""
    plan = planned(1.0, weighting="mass-flow")
    windows = time_windows_for(plan.model.processes, 10.0, plan.weighting)
    np.testing.assert_allclose(windows.inflow, [2.5])
    np.testing.assert_allclose(windows.share, [[0.6, 1.0]])


def test_nothing_comes_in_is_said() -> None:
    with pytest.raises(sx.InputError, match=r"inflow from t = 0 .* 4, is 0"):
        _ = planned("max(0, t - 5)", end=4.0).volume


@pytest.mark.parametrize("parts", [1, 2])
def test_what_begins_empty_is_not_doubled(parts: int) -> None:
    assert planned(1.0, parts).doubles_at == 0


def test_an_estimate_of_a_system_that_begins_empty() -> None:
    density, volume = np.array([0.0, 1.0, 3.0]), np.full(3, 100.0)
    pilot = Pilot(100, np.arange(3.0), density, np.zeros(3), volume, np.ones(3), 1e-8, 2.0, False)
    run: Any = type("Run", (), {"particles": 1000, "population": "fixed-volume"})()
    assert pilot.fewest(run) == np.inf
    assert pilot.growth(run) == 3.0
