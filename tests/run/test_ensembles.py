"""Ensembles of small systems: statistics, reproducibility, coverage, efficiency.

All runs share one compiled loop: weightings are powers of the size, which are data.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import stats

import smolux as sx
from shared import FORMULA, extinction
from smolux.ensembles import Moments
from smolux.ensembles.batches import Batch, Sampler, make_sampler
from smolux.ensembles.efficiency import _compared, _reference
from smolux.ensembles.ensemble import Collected
from smolux.errors import InputError
from smolux.exact import finite
from smolux.settings.target_error import Target
from smolux.stochastic.make_plan import make_plan

METHOD = "acceptance-rejection"
MODEL = sx.Model(kernel=sx.kernels.Constant())
NAMES = ("number_density", "M2", "n_3", "largest")


def power(q: float) -> Any:
    return sx.weighting.WeightFunction(q)


def sampler(
    observables: Any, times: Any, particles: int, replicas: int, q: float = 0.0, seed: int = 5
) -> Sampler:
    return make_sampler(
        MODEL, times, observables, METHOD, power(q), "none", particles, replicas, seed
    )


# --- statistics ----------------------------------------------------------------------------------


def test_moments_of_parts_are_those_of_the_whole():
    rng = np.random.default_rng(1)
    values = 1e3 + rng.exponential(size=(1000, 2, 3))
    parts = [Moments.of(part) for part in np.split(values, [1, 2, 40, 500, 501])]
    merged = parts[0]
    for part in parts[1:]:
        merged = merged + part
    away = values - values.mean(axis=0)
    assert merged.count == 1000
    np.testing.assert_allclose(merged.mean, values.mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(merged.variance, values.var(axis=0, ddof=1), rtol=1e-11)
    np.testing.assert_allclose(merged.third, (away**3).sum(axis=0), rtol=1e-10)
    np.testing.assert_allclose(merged.fourth, (away**4).sum(axis=0), rtol=1e-10)


def test_equal_samples_have_no_variance():
    merged = Moments.of(np.full((3, 1), 0.1)) + Moments.of(np.full((4, 1), 0.1))
    assert merged.variance == 0.0


def test_intervals_of_the_variance_cover_it():
    """2000 samples of 3000 exponential numbers, of variance one: 93 to 97 % hold it."""
    values = np.random.default_rng(2).exponential(size=(3000, 2000))
    low, high = Moments.of(values).variance_interval()
    assert 0.93 < np.mean((low < 1.0) & (high > 1.0)) < 0.97


# --- ensembles -----------------------------------------------------------------------------------


@pytest.mark.parametrize("q", [0.0, 1.0])
def test_the_replicas_are_those_of_simulate(q: float):
    settings: dict[str, Any] = {
        "method": METHOD, "weighting": power(q), "particles": 50, "seed": 3, "replicas": 203,
    }  # fmt: skip
    found = sx.ensemble(MODEL, [1.0, 4.0], NAMES, **settings, threads=2)
    ds = sx.simulate(MODEL, [1.0, 4.0], **settings, orders=[2], sizes=5)
    rows = np.stack(
        [ds["number_density"], ds["moment"].sel(order=2), ds["n"].sel(size=3), ds["largest"]],
        axis=1,
    )
    np.testing.assert_allclose(found["mean"], rows.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(found["variance"], rows.var(axis=0, ddof=1), rtol=1e-9)
    error = rows.std(axis=0, ddof=1) / np.sqrt(203)
    np.testing.assert_allclose(found["standard_error"], error, rtol=1e-9)
    assert float(found["collisions"]) * 203 == pytest.approx(ds.attrs["events"], rel=1e-12)


@extinction
def test_a_run_whose_stores_grow_leaves_no_wrong_tables():
    """With the loop of the law tests; the first run learns tables for twice as many slots."""
    kernel = sx.kernels.formula(FORMULA, c0=0.0, c1=1.0, c2=0.0, c3=0.0)
    model = sx.Model(kernel, [sx.processes.Aggregation(), sx.processes.Shattering(0.0)])
    settings: dict[str, Any] = {"method": "low-rank", "population": "none", "particles": 60}
    settings |= {"replicas": 100, "seed": 3}
    found = sx.ensemble(model, [3.0], ["M2"], **settings, threads=1)
    rows = sx.simulate(model, [3.0], **settings)
    assert float(found["collisions"]) == rows["collisions"].mean()
    np.testing.assert_allclose(found["mean"], rows["moment"].sel(order=[2]).mean("replica").T)


def test_initial_sizes_that_are_drawn_are_those_of_simulate():
    model = sx.Model(kernel=sx.kernels.Constant(), initial=sx.initial.exponential(mean=3.0))
    settings: dict[str, Any] = {"method": METHOD, "weighting": power(0.0), "particles": 50}
    settings |= {"seed": 3, "replicas": 60}
    found = sx.ensemble(model, [1.0], ["M2"], **settings)
    rows = sx.simulate(model, [1.0], **settings)["moment"].sel(order=2).values
    np.testing.assert_allclose(found["mean"].values[0], rows.mean(axis=0), rtol=1e-12)


def test_threads_change_nothing():
    runs = [
        sx.ensemble(
            MODEL, [1.0, 4.0], NAMES, method=METHOD, weighting=power(0.5), particles=40,
            replicas=501, seed=8, threads=threads,
        )
        for threads in (1, 3)
    ]  # fmt: skip
    for name in ("mean", "variance", "standard_error", "variance_upper", "collisions"):
        assert np.array_equal(runs[0][name], runs[1][name])


def test_intervals_of_the_mean_contain_the_truth_of_a_finite_system():
    """2000 ensembles of 30 replicas each: 93 to 97 % of their intervals hold the exact mean."""
    blocks, each, particles = 2000, 30, 24
    source = sampler(("number_density", "M2"), [1.0, 3.0], particles, blocks * each)
    law = finite.Constant(particles)
    truth = np.array(
        [
            [law.number_mean(t) / particles for t in (1.0, 3.0)],
            [law.second_moment(t) for t in (1.0, 3.0)],
        ]
    )
    step, values = source.plan.replicas, []
    for first in range(0, blocks * each, step):
        count = min(step, blocks * each - first)
        values.append(source.values(source.start(first, count), lambda: False))
    rows = np.concatenate(values).reshape(blocks, each, 2, 2)
    low, high = Moments.of(np.moveaxis(rows, 1, 0)).interval()
    covered = np.mean((low <= truth) & (truth <= high), axis=0)
    assert (covered > 0.93).all()
    assert (covered < 0.97).all()


# --- efficiency ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def measured() -> Any:
    return sx.efficiency(
        MODEL, [METHOD], [power(0.0), power(1.0)], ["n_50", "M2"], times=[20.0], population="none",
        particles=512, replicas=1500, seed=4,
    )  # fmt: skip


def test_mass_flow_has_the_smaller_variance_of_large_sizes(measured: Any):
    """Constant kernel, u_50(20): 60 to 130 times smaller with doubling, more without."""
    number, flow = measured.isel(scheme=0), measured.isel(scheme=1)
    at = {"observable": "n_50", "time": 20.0}
    assert float(number["variance_lower"].sel(at)) > 10 * float(flow["variance_upper"].sel(at))


def test_the_bias_is_that_of_the_finite_system(measured: Any):
    """M2 of N particles: ``N - (N - 1) exp(-t / N)`` by number, ``1 + t (N - 1) / N`` by mass."""
    expected = [512 - 511 * np.exp(-20 / 512) - 21, 1 + 20 * 511 / 512 - 21]
    found = measured.sel(observable="M2", time=20.0)
    assert (np.abs(found["bias"] - expected) < 4 * found["standard_error"]).all()


def test_efficiency_is_what_it_says(measured: Any):
    eff = 1 / (measured["cost"] * measured["variance"])
    np.testing.assert_allclose(measured["efficiency"], eff.transpose(*measured["efficiency"].dims))
    ratio = measured["efficiency"] / measured["efficiency"].isel(scheme=0)
    np.testing.assert_allclose(measured["ratio"], ratio)
    inside = (measured["ratio_lower"] <= ratio) & (ratio <= measured["ratio_upper"])
    assert inside.all()
    assert (measured["bias_lower"] < measured["bias"]).all()
    assert (measured["bias"] < measured["bias_upper"]).all()
    top = measured["efficiency"] == measured["efficiency"].max("scheme")
    assert measured["best"].where(top, True).all()


def test_cost_of_a_replica():
    """Batches of 10, 10 and 5 replicas: the mean is over replicas, the scatter over whole ones."""
    source = sampler(("M2",), [1.0], 20, 200)
    whole, last = (source.batch(first, n, lambda: False) for first, n in ((0, 10), (10, 5)))
    found = Collected(replace(whole, seconds=20.0))
    for batch, seconds in ((whole, 40.0), (last, 15.0)):
        found.add(replace(batch, seconds=seconds))
    assert found.cost() == pytest.approx((3.0, 1 / 3, 2))
    upper, lower = (found.variables()[f"cost_{end}"][1] for end in ("upper", "lower"))
    assert np.log([upper / 3, 3 / lower]) == pytest.approx(stats.t.ppf(0.975, 1) / 3)


def test_intervals_of_efficiencies_hold_the_scatter_of_variances():
    """Of 400 normal numbers a variance has the relative standard error ``sqrt(2/399)``."""
    values = np.random.default_rng(7).standard_normal((2, 20, 20, 1, 1))
    schemes = []
    for rows in values:
        parts = [Batch(Moments.of(part), None, 1.0) for part in rows]  # type: ignore[arg-type]
        schemes.append(Collected(parts[0]))
        for part in parts[1:]:
            schemes[-1].moments += part.moments
            schemes[-1].spent.append((20, 1.0))
    found = _compared(schemes)
    half = 1.96 * np.sqrt(2 / 399)
    for name, width in (("efficiency", half), ("ratio", np.sqrt(2) * half)):
        assert np.log(found[f"{name}_upper"] / found[name])[1] == pytest.approx(width, rel=0.25)
        assert np.log(found[name] / found[f"{name}_lower"])[1] == pytest.approx(width, rel=0.25)


@pytest.mark.filterwarnings("default:from t = .* mass lies beyond:smolux.errors.SmoluxWarning")
@pytest.mark.parametrize(
    ("kernel", "t", "expected"),
    [
        (sx.kernels.Constant(), 4.0, [1 / 3, 5.0, 4 / 81, np.nan]),
        (sx.kernels.formula("1 + 0*i*j"), 4.0, [1 / 3, 5.0, 4 / 81, np.nan]),
        # a gel that reacts: n_k = k**(k - 2) t**(k - 1) exp(-k t) / k!
        (sx.kernels.formula("i*j", gels=True), 1.5, [None, None, 1.125 * np.exp(-4.5), np.nan]),
    ],
)
def test_the_bias_is_against_the_solution(kernel: Any, t: float, expected: Any):
    plan = make_plan(
        sx.Model(kernel),
        [t],
        method=METHOD,
        population="none",
        particles=20,
        replicas=1,
        seed=1,
        orders=(0, 2),
        sizes=8,
        bins_per_octave=1,
    )
    targets = [Target(name) for name in NAMES]
    found = _reference(SimpleNamespace(plan=plan, targets=targets), NAMES, None)[0]  # type: ignore[arg-type]
    for one, value in zip(found[:, 0], expected, strict=True):
        assert value is None or one == pytest.approx(value, rel=1e-5, nan_ok=True)


@pytest.mark.parametrize(("slower", "told"), [(1.0, False), (2.0, True)])
def test_the_same_twice_is_not_told_apart(
    monkeypatch: pytest.MonkeyPatch, slower: float, told: bool
):
    """Two schemes of one law, the power zero: only what a made-up clock says is between them."""
    noise, run = np.random.default_rng(3), Sampler.batch

    def batch(self: Any, *given: Any) -> Any:
        found = run(self, *given)
        factor = slower if self.plan.weighting.w > 0.0 else 1.0
        return replace(found, seconds=factor * noise.lognormal(0.0, 0.1))

    monkeypatch.setattr(Sampler, "batch", batch)
    ds = sx.efficiency(
        MODEL, schemes=[(METHOD, power(0.0)), (METHOD, power(1e-300))], observables=["M2"],
        times=[4.0], particles=40, replicas=800, seed=9, exact=[[5.0]], threads=1,
    )  # fmt: skip
    assert ds["best"].isel(scheme=0).all()
    assert bool(ds["best"].isel(scheme=1).all()) != told
    assert float(ds["mean"].std()) > 0.0  # each has random numbers of its own
    assert ds.attrs["reference"] == "given"


def test_table_and_figure(measured: Any, tmp_path: Path):
    text = sx.ensembles.efficiency_table(measured)
    assert "n_50 at t = 20" in text
    assert "weight-function=1" in text
    place = measured.isel(scheme=0).sel(observable="M2", time=20.0)
    assert f" {float(100 * place['bias'] / place['reference']):.3g} " in text
    figure = sx.plotting.efficiency(measured)
    assert len(figure.axes) == 2
    last = measured.isel(time=-1)
    for ax, name in zip(figure.axes, last["observable"].values, strict=True):
        ends = [bar[2][0].get_segments()[0][:, 0] for bar in ax.containers]
        known = [last[v].sel(observable=name) for v in ("ratio_lower", "ratio_upper")]
        np.testing.assert_allclose(ends, np.stack(known, axis=1))
    assert sx.plotting.save(figure, tmp_path / "eff.png").stat().st_size > 5000


def test_mistakes_are_told_together():
    with pytest.raises(InputError) as error:
        sx.ensemble(MODEL, [1.0, 0.5], ("M2", "weight"), replicas=1, particles=1)
    text = str(error.value)
    for word in ("times", "weight", "replicas = 1", "particles = 1"):
        assert word in text
    with pytest.raises(InputError, match="methods"):
        sx.efficiency(MODEL, [], times=[1.0])
    with pytest.raises(InputError, match=r"(?s)threads = 0.*schemes"):
        sx.efficiency(MODEL, schemes=[("inverse",)], times=[1.0], threads=0)


# --- warnings, and what is kept of a run that ends early ------------------------------------------


SMALL: dict[str, Any] = {"population": "fixed-volume", "particles": 20, "seed": 3}


def test_warnings_are_those_of_simulate():
    given = {"method": METHOD, "weighting": power(0.0), "replicas": 300, **SMALL}
    with pytest.warns(sx.SmoluxWarning, match="ended as one cluster") as issued:
        ds = sx.ensemble(MODEL, [40.0], ("M2",), **given)
    assert [str(each.message) for each in issued] == sx.results.warnings(ds)
    with pytest.warns(sx.SmoluxWarning):
        rows = sx.simulate(MODEL, [40.0], **given)
    assert sx.results.warnings(ds) == sx.results.warnings(rows)
    assert ds.attrs["complete"]


@extinction
def test_warnings_of_schemes_name_them():
    ds = sx.efficiency(
        MODEL, [METHOD], [power(0.0), power(1.0)], ["M2"], times=[40.0], replicas=100, **SMALL
    )
    (text,) = sx.results.warnings(ds)  # with mass flow one particle is never alone
    assert text.startswith(f"{METHOD}, weight-function=0: 64 of 100 replicas ended")


@pytest.mark.parametrize(
    ("error", "raised"),
    [
        (InputError("a rate is none"), InputError),
        (MemoryError(), sx.errors.OutOfMemoryError),
        (KeyboardInterrupt(), sx.Interrupted),
    ],
    ids=["rate", "memory", "ctrl-c"],
)
def test_what_was_computed_is_kept(
    monkeypatch: pytest.MonkeyPatch, error: BaseException, raised: type
):
    """The third turn does not end: the statistics are those of the two before it."""
    run = Sampler.batch
    step = 5  # 100 replicas in twenty batches

    def batch(self: Sampler, first: int, count: int, stop: Any) -> Any:
        if first >= 2 * step:
            raise error
        return run(self, first, count, stop)

    given = {"times": [1.0], "observables": ("M2",), "replicas": 100, "threads": 1, **SMALL}
    one = {"method": METHOD, "weighting": power(0.0)}
    both = {"methods": [METHOD], "weightings": [power(0.0), power(1.0)]}
    for entry, schemes in ((sx.ensemble, one), (sx.efficiency, both)):
        with monkeypatch.context() as patch:
            patch.setattr(Sampler, "batch", batch)
            with pytest.raises(raised) as caught:
                entry(MODEL, **given, **schemes)
        ds = caught.value.dataset
        assert not ds.attrs["complete"]
        assert ds.attrs["replicas"] == 2 * step
        assert "statistics of 10 of 100 replicas" in sx.results.warnings(ds)
        rows = sx.ensemble(MODEL, **(given | {"replicas": 2 * step}), **one)
        np.testing.assert_allclose(ds["mean"].values.ravel()[0], rows["mean"].values[0, 0])


def test_nothing_computed_is_no_dataset(monkeypatch: pytest.MonkeyPatch):
    def batch(self: Sampler, *_: Any) -> Any:
        raise InputError("a rate is none")

    monkeypatch.setattr(Sampler, "batch", batch)
    with pytest.raises(InputError, match="a rate is none") as caught:
        sx.ensemble(MODEL, [1.0], method=METHOD, weighting=power(0.0), replicas=100, **SMALL)
    assert caught.value.dataset is None
