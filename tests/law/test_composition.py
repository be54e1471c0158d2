"""Composition: exact laws of what particles are made of, whatever happens to them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

import smolux as sx
from smolux import processes
from smolux.errors import InputError

SEED = 20_241_018
METHODS = [m.name for m in sx.methods.METHODS if m().carrying() is not None]
TWO = sx.attributes.Composition({"soot": 0.4, "salt": 0.6})
THREE = sx.attributes.Composition({"a": 1, "b": 2, "c": 5})
#: by the number of monomers, all of which are there at the start
BREAKING = {
    "aggregation": [processes.Aggregation()],
    "shattering": [processes.Aggregation(), processes.Shattering(0.3)],
    "fragmentation": [processes.Aggregation(), processes.Fragmentation(0.2)],
    "evaporation": [processes.Aggregation(), processes.Evaporation(0.3)],
}


def simulate(model: sx.Model, times: Any, method: str, **given: Any) -> Any:
    settings = {"seed": SEED, "replicas": 8, "population": "fixed-volume", **given}
    return sx.simulate(model, times, method=method, **settings)


def one_of_each_replica(ds: Any, size: int, rng: np.random.Generator) -> np.ndarray:
    """Composition of a particle of this size, drawn among those of a replica at the last time."""
    ends = np.cumsum(ds["row_size"].values)
    last = ds["instance_time"].values == ds["time"].values[-1]
    found = []
    for end, length, wanted in zip(ends, ds["row_size"].values, last, strict=True):
        rows = slice(end - length, end)
        here = ds["sample_size"].values[rows] == size
        if wanted and here.any():
            counts = ds["sample_count"].values[rows][here]
            which = rng.choice(len(counts), p=counts / counts.sum())
            found.append(ds["sample_composition"].values[rows][here][which])
    return np.array(found)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("what", BREAKING)
def test_a_particle_is_a_hypergeometric_draw_of_all_monomers(method: str, what: str) -> None:
    """Of 12 monomers, 5 of them marked, those of a particle are any three as likely as others."""
    composition = sx.attributes.Composition({"marked": 5 / 12, "plain": 7 / 12})
    model = sx.Model(sx.kernels.Constant(), BREAKING[what], attributes=[composition])
    ds = simulate(model, [1.5], method, particles=12, replicas=6000, sizes=12, distribution=True)
    numbers = one_of_each_replica(ds, 3, np.random.default_rng(SEED))[:, 0]
    expected = stats.hypergeom(12, 5, 3).pmf(np.arange(4)) * len(numbers)
    assert len(numbers) > 2000
    chi = ((np.bincount(numbers, minlength=4) - expected) ** 2 / expected).sum()
    assert stats.chi2.sf(chi, 3) > 1e-4
    # the binomial law, of draws that are put back, is seen to be another one
    other = stats.binom(3, 5 / 12).pmf(np.arange(4)) * len(numbers)
    chi = ((np.bincount(numbers, minlength=4) - other) ** 2 / other).sum()
    assert stats.chi2.sf(chi, 3) < 1e-6


@pytest.mark.parametrize("method", METHODS)
def test_the_scatter_among_particles_follows_from_their_number(method: str) -> None:
    """Of N monomers in n particles, on average ``(n - 1) / (N - 1)`` of that of pure ones."""
    model = sx.Model(sx.kernels.Constant(), BREAKING["shattering"], attributes=[THREE])
    ds = simulate(model, [0.3, 1.0, 2.0], method, particles=400, replicas=600)
    difference = ds["mixing"] - (ds["particles"] - 1) / 399
    sigma = difference.std("replica", ddof=1) / np.sqrt(600)
    assert (abs(difference.mean("replica")) < 4.5 * sigma).all()
    assert (sigma < 0.002).all()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("what", BREAKING)
def test_each_kind_is_conserved(method: str, what: str) -> None:
    model = sx.Model(sx.kernels.Constant(2.0), BREAKING[what], attributes=[THREE])
    ds = simulate(model, [0.0, 1.0, 5.0], method, particles=500, population="doubling")
    times = ds["volume"] / ds["volume"].isel(time=0)
    assert (ds["monomers"] == ds["monomers"].isel(time=0) * times).all()
    assert (ds["monomers"].isel(time=0) == [63, 125, 312]).all()
    # and so is the sum over sizes
    by_size = (ds["composition"] * ds["n"] * ds["volume"]).sum("size")
    np.testing.assert_allclose(by_size, ds["monomers"], rtol=1e-12)
    whole = (ds["composition"].sum("component") - ds["size"]).where(ds["n"] > 0, 0.0)
    np.testing.assert_allclose(whole, 0.0, atol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_what_comes_and_goes_is_accounted_for(method: str) -> None:
    model = sx.Model(
        sx.kernels.Constant(),
        [
            processes.Aggregation(),
            processes.Source(2.0),
            processes.Source({6: 1.0}, label="drops"),
            processes.Removal(0.5),
            processes.Removal(above=30, label="rain"),
        ],
        attributes=[
            sx.attributes.Composition(
                {"dust": 1.0, "water": 0.0}, sources={"drops": {"water": 3, "dust": 1}}
            )
        ],
    )
    ds = simulate(model, [0.0, 1.0, 4.0], method, particles=2000, population="doubling")
    start = ds["monomers"].isel(time=0) * ds["volume"] / ds["volume"].isel(time=0)
    assert (ds["monomers"] == start + ds["monomers_in"] - ds["monomers_out"]).all()
    assert (ds["monomers_out"].isel(time=-1) > 0).all()
    for name in ("in", "out"):
        np.testing.assert_array_equal(ds[f"monomers_{name}"].sum("component"), ds[f"mass_{name}"])
    # of drops each monomer is of water with a chance of 3/4, and nothing else is
    water = ds["monomers_in"].sel(component="water").isel(time=-1)
    drops = 6 * ds["events"].sel(process="drops").isel(time=-1) * (water / water)
    share = float(water.sum() / drops.sum())
    assert share == pytest.approx(0.75, abs=4.5 * np.sqrt(0.75 * 0.25 / float(drops.sum())))


def test_the_start_is_dealt_as_exactly_as_it_is_given() -> None:
    composition = sx.attributes.Composition(
        {"a": 0.5, "b": 0.25, "c": 0.25}, by_size={4: {"c": 1.0}, 2: {"a": 1, "b": 1}}
    )
    initial = sx.initial.from_sizes({1: 0.5, 2: 0.25, 4: 0.25})
    model = sx.Model(sx.kernels.Constant(), initial=initial, attributes=[composition])
    ds = simulate(model, [0.0, 1e-3], METHODS[0], particles=1000, distribution=True)
    # whole populations have what there is at both times
    rows = ds["sample_composition"] * ds["sample_count"]
    np.testing.assert_array_equal(rows.sum("sample"), ds["monomers"].sum(("replica", "time")))
    ds = ds.isel(time=[0])
    assert (ds["composition"].sel(size=4, component="c") == 4.0).all()
    assert (ds["composition"].sel(size=4, component="a") == 0.0).all()
    assert (ds["composition"].sel(size=2, component="c") == 0.0).all()
    np.testing.assert_allclose(ds["composition"].sel(size=2, component="a"), 1.0)
    np.testing.assert_allclose(ds["composition"].sel(size=1), [[[0.5, 0.25, 0.25]]] * 8)


def test_sizes_are_as_without() -> None:
    model = sx.Model(sx.kernels.Constant(), BREAKING["aggregation"])
    for method in METHODS:
        carried = sx.Model(sx.kernels.Constant(), BREAKING["aggregation"], attributes=[TWO])
        ds = simulate(carried, [0.5, 2.0], method, particles=200, replicas=400)
        found = sx.exact.finite.find(model, 200)
        for k, t in enumerate((0.5, 2.0)):
            seen = ds["particles"].isel(time=k).values
            sigma = np.sqrt(found.number_variance(t) / len(seen))
            assert abs(seen.mean() - found.number_mean(t)) < 4.5 * sigma


@pytest.mark.parametrize("method", METHODS)
def test_a_run_that_was_stopped_goes_on(method: str, tmp_path: Any) -> None:
    model = sx.Model(sx.kernels.Constant(), BREAKING["shattering"], attributes=[TWO])
    given = {"particles": 300, "distribution": True, "times": [0.5, 1.0, 2.0], "replicas": 2}
    whole = simulate(model, method=method, **given)
    file = tmp_path / "run.npz"

    def stop(progress: Any) -> None:
        if progress.fraction > 0.3:
            raise KeyboardInterrupt

    try:
        simulate(model, method=method, **given, checkpoint=file, progress=stop)
    except sx.Interrupted:
        ds = sx.resume(file)
    else:
        ds = sx.resume(file)
    for name in ("composition", "sample_composition", "mixing", "monomers"):
        np.testing.assert_array_equal(ds[name], whole[name])


def test_mistakes_are_named_all_at_once() -> None:
    model = sx.Model(sx.kernels.Constant(), attributes=[TWO])
    with pytest.raises(InputError) as caught:
        sx.simulate(model, [1], method="inverse", weighting="mass-flow", subvolumes=4)
    text = "\n".join(caught.value.problems)
    for part in (
        "method = 'inverse'",
        " or ".join(METHODS),
        "weighting = 'mass-flow'",
        "subvolumes = 4",
    ):
        assert part in text
    with pytest.raises(InputError) as caught:
        sx.attributes.Composition(
            {"a": -1.0, "b": 2.0}, by_size={0: {"a": 1.0}, 3: {"c": 1.0}}, sources={"s": {}}
        )
    text = "\n".join(caught.value.problems)
    assert len(caught.value.problems) == 4
    for part in ("shares: a = -1.0", "sizes are whole numbers", "'c' is no kind", "sources.s"):
        assert part in text
    with pytest.raises(InputError, match="give two or more"):
        sx.attributes.Composition({"a": 1.0})
    given = sx.attributes.Composition({"a": 1, "b": 1}, sources={"rain": {"a": 1}})
    with pytest.raises(InputError, match="'rain' is no source"):
        sx.Model(sx.kernels.Constant(), attributes=[given])
    with pytest.raises(InputError, match="attribute 'soot'"):
        sx.Model(sx.kernels.Constant(), attributes="soot")
    with pytest.raises(InputError, match="ensembles do not observe"):
        sx.ensemble(model, [1.0], ["M2"], replicas=100)
