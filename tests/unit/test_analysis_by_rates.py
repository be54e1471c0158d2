"""Densities from the rates at which sizes appear; the loop is that of the tests of ensembles."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import smolux as sx
from smolux.analysis import densities_by_rates
from smolux.errors import InputError, SmoluxWarning

MODEL = sx.Model(kernel=sx.kernels.Constant())


def simulated(q: float, times: Any, **settings: Any) -> Any:
    given = {"particles": 24, "replicas": 3000, "population": "none", "seed": 3, "sizes": 24}
    return sx.simulate(
        MODEL, times, method="acceptance-rejection", weighting=sx.weighting.WeightFunction(q),
        **given | settings,
    )  # fmt: skip


@pytest.mark.parametrize("kernel", [sx.kernels.Constant(), sx.kernels.Additive(0.5)], ids=str)
def test_of_infinitely_many_particles_the_estimate_is_exact(kernel: Any) -> None:
    """The solver in place of a simulation; few sizes are counted, the others are in bins."""
    model, times = sx.Model(kernel=kernel), np.linspace(0.0, 3.0, 61)
    ds = sx.solve(model, times, sizes=20)
    ds = ds.assign(volume=ds["volume"] * np.inf).assign_attrs(weighting="number")
    found = densities_by_rates(ds, [1, 2, 7, 20])
    exact = ds["n"].sel(size=[1, 2, 7, 20])
    # at first a density of size k grows as t**(k - 1), which takes short steps to follow
    np.testing.assert_allclose(found["n"][:, 40:], exact[:, 40:], rtol=2e-4)
    off = np.abs(found["n"] / exact - 1.0)[0, 40:].max("time")
    told = (found["quadrature_error"] / exact[0])[40:].max("time")
    assert (off <= told + 1e-6).all()


@pytest.mark.parametrize("weighting", [sx.weighting.Number(), sx.weighting.MassFlow()], ids=str)
def test_a_particle_alone_meets_nothing(weighting: Any) -> None:
    """One of size 7 in a volume of 5, whatever it stands for: it stays, and makes none of 14."""
    ds = sx.solve(MODEL, np.linspace(0.0, 1.0, 5), sizes=20)
    density = 1.0 / weighting.weights(np.array([7.0]))[0] / 5.0
    ds["n"][:], ds["n_bin"][:], ds["volume"][:] = 0.0, 0.0, 5.0
    ds["n"].loc[{"size": 7}] = density
    ds["moment"].loc[{"order": 1}] = 7 * density
    found = densities_by_rates(ds.assign_attrs(weighting=weighting.name), [7, 14])["n"]
    np.testing.assert_allclose(found.sel(size=7), density, rtol=1e-12)
    np.testing.assert_allclose(found.sel(size=14), 0.0, atol=1e-15)


@pytest.mark.parametrize("q", [0.0, 0.5, 1.0])
def test_the_mean_is_that_of_the_counts(q: float) -> None:
    """24 particles, so that pairs of a particle with itself would be seen."""
    times = np.linspace(0.0, 2.0, 21)
    ds = simulated(q, times)
    found = densities_by_rates(ds, [1, 2, 4, 7])
    apart = (found["n"] - ds["n"].sel(size=[1, 2, 4, 7])).sel(time=[0.5, 2.0])
    z = apart.mean("replica") / (apart.std("replica", ddof=1) / np.sqrt(ds.sizes["replica"]))
    assert float(np.abs(z).max()) < 4.5, z


def test_rare_sizes_are_far_more_certain() -> None:
    """By a factor of about 60 in the variance for n_50(20); here for n_20(5)."""
    ds = simulated(1.0, np.linspace(0.0, 5.0, 21), particles=500, replicas=100)
    found = densities_by_rates(ds, [20])
    at = {"time": 5.0, "size": 20}
    assert float(ds["n"].sel(at).var()) > 8 * float(found["n"].sel(at).var())
    exact = sx.exact.solution(MODEL).densities([5.0], [20])[0, 0]
    off = float(found["mean"].sel(at)) - exact
    assert abs(off) < 4.5 * float(found["standard_error"].sel(at))


def test_too_few_times_are_told() -> None:
    ds = simulated(1.0, [0.0, 10.0, 20.0], particles=500, replicas=20)
    with pytest.warns(SmoluxWarning, match="use more output times"):
        densities_by_rates(ds, [5])


def test_mistakes() -> None:
    ds = simulated(0.0, [0.0, 1.0], replicas=2)
    with pytest.raises(InputError) as error:
        densities_by_rates(ds, [0, 25])
    assert len(error.value.problems) == 2
    assert "from 1 to 24" in error.value.problems[0]
    assert "three or more" in error.value.problems[1]
    aggregation, shattering = sx.processes.Aggregation, sx.processes.Shattering
    for others in ([aggregation(), shattering(0.1)], [aggregation(2.0)], [aggregation("1 + t")]):
        with pytest.raises(InputError, match="aggregation alone"):
            densities_by_rates(ds, [2], model=sx.Model(MODEL.kernel, others))
    with pytest.raises(InputError, match="a Python function; give the model"):
        densities_by_rates(ds.assign_attrs(model=""), [2])
