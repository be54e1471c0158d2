"""One system in sub-volumes that are mixed again and again."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import runs

import shared
import smolux as sx
from shared import VARYING
from smolux.core.state import TIME
from smolux.errors import InputError, SmoluxWarning
from smolux.exact import finite
from smolux.runtime import resources, room
from smolux.settings import simulation
from smolux.stochastic import subvolumes
from smolux.stochastic.replicas import Group
from smolux.stochastic.subvolumes import SubvolumeReplica

pytestmark = shared.stopped

SETTINGS: dict[str, Any] = {"particles": 4000, "replicas": 2, "seed": 3, "sizes": 40}
TIMES = [0.0, 0.5, 2.0]


def simulate(method: str = "size-class", times: Any = TIMES, **settings: Any) -> Any:
    given = {"subvolumes": 2, "remix": 0.3} | settings
    return sx.simulate(runs.model(VARYING), times, method=method, **SETTINGS | given)


@pytest.mark.parametrize("method", ["size-class", "acceptance-rejection"])  # their own, and any
def test_the_same_physics(method: str) -> None:
    ds = simulate(method, replicas=8)
    whole = simulate(method, replicas=8, subvolumes=1)
    assert ds.attrs["subvolumes"] == 2
    # at the last output time
    assert ds.attrs["events"] == ds["collisions"].isel(time=-1).sum()
    np.testing.assert_array_equal(ds["moment"].sel(order=1), 1.4)
    assert (ds["particles"] / ds["volume"] == ds["number_density"]).all()
    for order in (0, 2):
        a, b = (d["moment"].sel(order=order) for d in (ds, whole))
        error = np.sqrt((a.var("replica", ddof=1) + b.var("replica", ddof=1)) / 8)
        # five sigmas of Student's law with 14 degrees of freedom: 2e-4
        assert (abs(a.mean("replica") - b.mean("replica")) <= 5 * error + 1e-12).all()
    assert (ds["largest"].isel(time=0) == 3).all()


def test_neither_output_times_nor_threads_matter() -> None:
    expected = simulate()
    runs.assert_same(expected, simulate())
    more = simulate(times=[0.0, 0.1, 0.5, 0.7, 2.0])
    np.testing.assert_array_equal(more["n"].sel(time=TIMES), expected["n"])
    with ThreadPoolExecutor(1) as pool:
        runs.assert_same(expected, simulate(executor=pool))
    assert (simulate(seed=4)["n"] != expected["n"]).any()


@pytest.mark.parametrize("distribution", [False, True])
def test_goes_on_from_a_checkpoint(distribution: bool, tmp_path: Path) -> None:
    expected = simulate(distribution=distribution)
    path = tmp_path / "run.npz"
    ds = simulate(checkpoint=path, time_limit=1e-9, distribution=distribution)
    assert not ds.attrs["complete"]
    for _stops in range(1000):
        ds = sx.resume(path, time_limit=1e-9)
        if ds.attrs["complete"]:
            break
    runs.assert_same(expected, ds)
    assert sx.results.warnings(ds) == []
    if distribution:
        assert ds["sample_count"].sum() == ds["particles"].sum()


@pytest.mark.parametrize("kind", ["error", "memory"])
def test_a_late_error_goes_on_in_the_middle_of_a_stretch(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected, path, left = simulate(distribution=True), tmp_path / "run.npz", [6]
    serve, free = Group._serve, resources.free_memory

    def late(group: Any) -> None:
        serve(group)
        if group.state.clock[0, TIME] > 0.7 and group.done:
            left[0] -= 1
            if left[0] <= 0:
                raise InputError("a rate is nan; it must be a finite number")

    with monkeypatch.context() as patch:
        if kind == "error":
            patch.setattr(Group, "_serve", late)
        else:
            patch.setattr(room, "_SMALL", 0)
            patch.setattr(resources, "free_memory", lambda: (free() or 1e9) if left[0] else 0.0)
            mix = SubvolumeReplica._mix

            def fewer(divided: Any, pool: Any) -> None:
                left[0] -= divided.state.clock[0, TIME] > 0.7 and left[0] > 0
                mix(divided, pool)

            patch.setattr(SubvolumeReplica, "_mix", fewer)
        with pytest.raises(InputError, match=r"finite number|memory: .* are free") as caught:
            simulate(checkpoint=path, distribution=True)
    assert caught.value.checkpoint == path
    ds: Any = caught.value.dataset
    assert np.isfinite(ds["n"].values[0, 1]).all()
    assert np.isnan(ds["n"].values[:, 2]).any()
    assert not ds.attrs["complete"]
    runs.assert_same(expected, sx.resume(path))


def _clusters(remix: float) -> np.ndarray:
    ds = sx.simulate(
        runs.model(0.0, sx.initial.monodisperse(), c1=0.0), [2.0], method="size-class",
        particles=16, seed=1, replicas=200, population="fixed-volume", subvolumes=4, remix=remix,
        sizes=16,
    )  # fmt: skip
    return ds["particles"].values[:, 0]


@pytest.mark.slow
def test_mixing_takes_the_bias_away(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulation, "LEAST", 4)
    monkeypatch.setattr(subvolumes, "LEAST", 4)
    exact = finite.number_mean("constant", 16, 2.0)
    apart, mixed = _clusters(10.0), _clusters(0.2)
    error = mixed.std(ddof=1) / np.sqrt(200)
    assert apart.mean() - exact > 3 * error  # four particles each: not the same system
    assert abs(mixed.mean() - exact) < 3 * error
    # fluctuations are those of the whole: the variance of 200 values scatters by 10 %
    variance = finite.number_variance("constant", 16, 2.0)
    assert 0.6 < mixed.var() / variance < 1.6


def test_fluctuations_are_those_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Variance of the number of clusters of many particles; in parts that agree it would be more.

    Mean and variance after two mixings for each particle that is left.
    """
    particles, replicas, end = 400, 60, 2.0
    for module in (simulation, subvolumes):
        monkeypatch.setattr(module, "LEAST", 4)
    ds = sx.simulate(
        runs.model(0.0, sx.initial.monodisperse(), c1=0.0), [end], method="acceptance-rejection",
        particles=particles, seed=2, replicas=replicas, population="fixed-volume", subvolumes=4,
        remix=0.3, sizes=1, bins_per_octave=1,
    )  # fmt: skip
    number = ds["particles"].values[:, 0]
    mean, variance = finite.law("constant", particles).number_moments(end)
    assert abs(number.mean() - mean) < 4.5 * np.sqrt(variance / replicas)
    # sixty values: their variance is within 4.5 standard errors of 18 %
    assert abs(number.var(ddof=1) / variance - 1.0) < 0.83


@pytest.mark.slow
def test_a_kernel_above_its_bound_is_remembered() -> None:
    def ridge(i: float, j: float) -> float:  # where sizes differ by 37, which it does not name
        return 1.0 + 20.0 * np.exp(-((((i - j) ** 2 - 1369.0) / 74.0) ** 2))

    model = sx.Model(kernel=sx.kernels.from_function(ridge, bounds=lambda a, b, c, d: (1.0, 1.5)))
    with pytest.warns(SmoluxWarning, match="above its bound"):
        sx.simulate(
            model, [30.0], particles=4000, replicas=1, seed=1, subvolumes=2, method="size-class"
        )


@pytest.mark.slow
def test_the_mass_of_open_systems_is_balanced() -> None:
    given = {1: 0.5, 3: 0.1}
    processes = [sx.processes.Aggregation(), sx.processes.Source(given), sx.processes.Removal(0.2)]
    model = sx.Model(kernel=sx.kernels.Constant(), processes=processes)
    ds = sx.simulate(
        model, [0.5, 3.0], method="size-class", particles=4000, replicas=2, seed=3, sizes=16,
        subvolumes=2, remix=0.3, population="fixed-volume",
    )  # fmt: skip
    inside = ds["moment"].sel(order=1) * ds["volume"]
    np.testing.assert_array_equal(inside, 4000 + ds["mass_in"] - ds["mass_out"])
    assert (np.diff(ds["mass_in"]) > 0).all()
    assert (np.diff(ds["mass_out"]) > 0).all()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"subvolumes": 0}, "subvolumes = 0: must be a whole number from 1 to 1024"),
        ({"subvolumes": 5}, "each needs 1000 particles or more"),
        ({"remix": 0.0}, "remix = 0.0: must be a number of collisions for each particle"),
    ],
)
def test_mistakes(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        simulate(**settings)
