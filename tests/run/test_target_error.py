"""Pilots say how many replicas it takes, and the result is that of a plain run of so many."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import runs
from scipy import stats

import shared
import smolux as sx
from smolux.confidence import Sample, mean_interval
from smolux.core.state import new_tally
from smolux.errors import InputError, SmoluxWarning
from smolux.observables import recorded
from smolux.settings.target_error import StoppingRule, Trial, assess, plan_replicas
from smolux.stochastic import driving, replicas
from smolux.stochastic import simulation as stochastic
from smolux.stochastic.make_plan import make_plan
from smolux.stochastic.observe import observable
from smolux.stochastic.plan import PILOT

pytestmark = shared.stopped

TIMES = [0.0, 0.5, 2.0]
#: reached with 16 to 64 replicas of 150 particles
WANTED = 0.08


def simulate(**settings: Any) -> Any:
    given = {"particles": 150, "replicas": 8, "seed": 5, "sizes": 40, "orders": (0, 1, 2)}
    given |= {"method": "acceptance-rejection", "target_error": WANTED}
    return sx.simulate(runs.model(0.1), TIMES, **given | settings)


def half_width(ds: Any, name: str = "number_density", **where: Any) -> float:
    statistic = sx.summary(ds, sizes=(1,))[name].sel(**where)
    mean = statistic.sel(statistic="mean")
    sides = [abs(statistic.sel(statistic=side) / mean - 1).max() for side in ("lower", "upper")]
    return float(max(sides))


def test_the_target_is_reached_and_the_result_is_that_of_a_plain_run() -> None:
    ds = simulate()
    assert 8 < ds.sizes["replica"] < 200
    assert half_width(ds) <= WANTED
    assert ds.attrs["reached_error"] == pytest.approx(half_width(ds), rel=1e-9)
    assert (ds.attrs["target"], ds.attrs["target_error"]) == ("number_density", WANTED)
    assert sx.results.warnings(ds) == []
    # a quarter fewer would not have done, by the scatter that was found
    assert half_width(ds) > 0.6 * WANTED
    plain = simulate(target_error=None, replicas=ds.sizes["replica"])
    runs.assert_same(plain, ds)
    assert plain.sizes == ds.sizes
    assert plain.attrs["events"] == ds.attrs["events"]
    assert "target" not in plain.attrs


@pytest.mark.parametrize(
    ("target", "name", "where"),
    [
        ("M2", "moment", {"order": 2}),
        ("n_1", "n", {"size": 1}),
        ("M0", "moment", {"order": 0}),
    ],
)
def test_observables(target: str, name: str, where: Any) -> None:
    ds = simulate(target=target, target_error=0.04)
    assert half_width(ds, name, **where) <= 0.04
    assert ds.attrs["reached_error"] == pytest.approx(half_width(ds, name, **where), rel=1e-9)


def test_replicas_begin_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where those that were planned are too few, and further ones are asked for."""
    begun: list[int] = []
    planned = set()
    start = driving.start

    def noted(plan: Any, first: int, count: int) -> Any:
        if first < PILOT:
            planned.add(plan.replicas)
            begun.extend(range(first, first + count))
            assert len(begun) == len(set(begun))
        return start(plan, first, count)

    monkeypatch.setattr(driving, "start", noted)
    ds = simulate(target="M2", target_error=0.04)
    assert begun == list(range(ds.sizes["replica"]))
    assert len(planned) > 1


def test_the_largest_cluster() -> None:
    ds = simulate(target="largest", target_error=0.1)
    values = ds["largest"].isel(time=-1).values
    assert values.std(ddof=1) / np.sqrt(len(values)) * 1.9 < 0.1 * values.mean()
    assert len(values) > 8


def test_enough_from_the_start() -> None:
    assert simulate(target_error=0.5).sizes["replica"] == 8
    # what does not scatter is sure at once
    assert simulate(target="M1", target_error=1e-9).sizes["replica"] == 8


def test_the_most_replicas_end_it_with_a_warning() -> None:
    with pytest.warns(SmoluxWarning, match="not reached with 13"):
        ds = simulate(target_error=0.001, max_replicas=13)
    assert ds.sizes["replica"] == 13
    (warning,) = sx.results.warnings(ds)
    assert "target_error = 0.001 was not reached with 13 replicas" in warning
    assert "number_density" in warning
    assert "t = 2" in warning
    runs.assert_same(simulate(target_error=None, replicas=13), ds)


def test_what_nobody_has_seen_has_no_interval() -> None:
    with pytest.warns(SmoluxWarning, match="too little was seen"):
        simulate(target="n_37", target_error=0.1, max_replicas=9)


def test_the_bias_of_few_particles_is_told() -> None:
    with pytest.warns(SmoluxWarning, match=r"1/particles = 0\.05"):
        simulate(target_error=0.045, particles=20, max_replicas=2000)


def test_the_same_on_threads_and_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = simulate()
    for workers in (1, 2, 4):
        monkeypatch.setattr(stochastic, "cores", lambda n=workers: n)
        assert expected.identical(simulate().assign_attrs(expected.attrs))
        with ThreadPoolExecutor(workers) as executor:
            assert expected.equals(simulate(executor=executor))
    with ProcessPoolExecutor(2) as executor:
        assert expected.equals(simulate(executor=executor))


def test_progress_is_shown_toward_it() -> None:
    seen: list[Any] = []
    ds = simulate(progress=seen.append)
    assert seen[0].replicas == 8
    assert np.isnan(seen[0].error)
    assert seen[-1].replicas == ds.sizes["replica"]
    assert seen[-1].error > WANTED  # of the last look before the last replicas
    assert all(p.target_error == WANTED for p in seen)
    assert all(0 <= p.fraction <= 1 for p in seen)


def test_stopped_again_and_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = simulate(particles=300)
    assert expected.sizes["replica"] > 8
    monkeypatch.setattr(replicas, "_SLICE", 1e-9)
    path = tmp_path / "run.npz"
    ds = simulate(particles=300, checkpoint=path, time_limit=1e-9)
    seen = set()
    while not ds.attrs["complete"]:
        seen.add(ds.sizes["replica"])
        ds = sx.resume(path, time_limit=1e-9)
    assert len(seen) > 1
    assert expected.equals(ds)
    assert ds.attrs["reached_error"] == expected.attrs["reached_error"]


def test_replicas_that_no_longer_fit_end_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(plan: Any, done: int) -> None:
        assert plan.replicas > done
        raise InputError("the run needs more than there is")

    monkeypatch.setattr(driving, "check_memory", full)
    with pytest.warns(SmoluxWarning) as told:
        ds = simulate()
    assert ds.sizes["replica"] == 8
    warnings = sx.results.warnings(ds)
    assert [str(w.message) for w in told] == warnings
    assert len(warnings) == 2
    assert "no further replicas" in warnings[0]
    assert "not reached" in warnings[1]


# --- the rule ------------------------------------------------------------------------------------


def until(rule: StoppingRule, draw: Any) -> Any:
    """Pilots, then the replicas of the result, as `smolux.stochastic.driving.Run.more` does it."""
    pilots = draw(rule.first)
    moved = np.array([True] * pilots.shape[1])
    while (trial := plan_replicas(rule, pilots, moved)).pilots > len(pilots):
        assert trial.pilots <= 2 * len(pilots)
        pilots = np.concatenate([pilots, draw(trial.pilots - len(pilots))])
    values = draw(trial.replicas)
    while True:
        assessment = assess(rule, values, moved)
        if assessment.following == len(values):
            return values, assessment, len(pilots)
        assert len(values) < assessment.following <= max(2 * len(values), len(values) + 2)
        values = np.concatenate([values, draw(assessment.following - len(values))])


@pytest.mark.parametrize(
    ("law", "error"),
    [
        (stats.norm(1, 0.06), 0.01),
        (stats.lognorm(0.6), 0.2),  # as the third moment of an additive kernel
    ],
)
def test_intervals_hold_and_the_mean_has_no_bias(law: Any, error: float) -> None:
    """Coverage of 95 %; stopping when the interval is short makes a skewed mean too small."""
    rule, draws = StoppingRule("M3", error, 8, 10_000), np.random.default_rng(3)
    means, inside, trials = [], 0, 200
    for _ in range(trials):
        values, assessment, _ = until(rule, lambda n: law.rvs((n, 1), random_state=draws))
        lower, upper = mean_interval(Sample.of(values))
        inside += int(lower[0] <= law.mean() <= upper[0])
        means.append(values.mean() / law.mean())
        assert assessment.error <= error
    # four standard deviations of the share of 200 trials
    assert inside / trials > 0.95 - 4 * 0.0154
    assert np.mean(np.abs(np.array(means) - 1) <= error) > 0.93
    assert abs(np.mean(means) - 1) < 0.1 * error + 4 * np.std(means) / np.sqrt(trials)


def test_every_output_time_counts() -> None:
    rule, draws = StoppingRule("number_density", 0.01, 8, 10_000), np.random.default_rng(4)
    scatter = np.array([0.0, 0.04, 0.01])
    values, assessment, pilots = until(rule, lambda n: 1 + scatter * draws.standard_normal((n, 3)))
    assert assessment.at == 1
    assert assessment.error <= rule.error
    assert 40 < len(values) < 200
    assert pilots < 60


def test_pilots_say_what_it_takes() -> None:
    """A scatter of 4 % takes ``(1.96 * 4)**2 = 61`` replicas for 1 %, and some to be sure."""
    pilots = 1 + 0.04 * stats.norm.ppf((np.arange(30) + 0.5) / 30)[:, None]
    trial = plan_replicas(StoppingRule("M2", 0.01, 8, 10_000), pilots, np.array([True]))
    assert trial.pilots == 30
    assert 61 <= trial.replicas <= 100


def test_what_pilots_do_not_see_takes_more_of_them() -> None:
    rule, moved = StoppingRule("n_30", 0.1, 8, 500), np.array([True])
    assert plan_replicas(rule, np.zeros((8, 1)), moved) == Trial(16, 500)
    assert plan_replicas(rule, np.zeros((500, 1)), moved) == Trial(500, 500)
    # nothing has happened: certain
    assert plan_replicas(rule, np.zeros((8, 1)), np.array([False])) == Trial(8, 8)


def test_evaporation_without_a_collision_is_something() -> None:
    """Of a size of which nothing was seen nothing is certain, although nothing has collided."""
    plan = make_plan(
        runs.model(0.1),
        [1.0],
        method="acceptance-rejection",
        population="none",
        particles=20,
        replicas=8,
        seed=1,
        orders=(0, 1),
        sizes=4,
        bins_per_octave=1,
        target_error=0.1,
        target="n_3",
    )
    tally = new_tally(8, plan.grid, 4, 2)
    tally.scalars[:] = 1.0
    for name in ("collisions", "mass_in", "mass_out"):
        recorded(tally, name)[:] = 0.0
    group: Any = SimpleNamespace(tally=tally)
    assert plan.rule is not None
    values, moved = observable(plan, plan.rule, [group])
    assert not moved.any()
    recorded(tally, "events")[0, 0, 1] = 1
    values, moved = observable(plan, plan.rule, [group])
    assert moved.all()
    assert assess(plan.rule, values, moved).error == np.inf


# --- mistakes ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"target_error": 0.0}, ("target_error = 0.0", "between 0 and 1")),
        ({"target_error": "small"}, ("target_error = 'small'", "between 0 and 1")),
        ({"target": "number-density"}, ("target = 'number-density'", "'number_density'?")),
        ({"target": "M3"}, ("target = 'M3'", "orders has 0, 1, 2")),
        ({"target": "n_41"}, ("target = 'n_41'", "sizes = 40")),
        ({"target": 2}, ("target = 2", "unknown")),
        ({"replicas": 4}, ("replicas = 4", "at least 8")),
        ({"max_replicas": 7}, ("max_replicas = 7", "replicas = 8")),
        ({"max_replicas": 0}, ("max_replicas = 0", "whole number")),
    ],
)
def test_mistakes(given: Any, words: Any) -> None:
    with pytest.raises(InputError) as caught:
        simulate(**given)
    assert any(all(word in message for word in words) for message in caught.value.problems)
    assert len(caught.value.problems) <= 2
