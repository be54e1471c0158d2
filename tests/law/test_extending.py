"""A kernel, a process, a start and a method that are not in the package meet the laws."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import laws
import numpy as np
import pytest
from tests.shared import QUICK, extinction

import smolux as sx
from smolux.kernels import Kernel

FOLDER = Path(__file__).parents[2] / "examples/extending"
OWN: Any = runpy.run_path(str(FOLDER / "plot_extending.py"), run_name="extension")
DIRECT: Any = runpy.run_path(str(FOLDER / "plot_method.py"), run_name="method")["Direct"]()
MODEL = sx.Model(
    OWN["Turbulent"](0.1),
    [sx.processes.Aggregation(), OWN["Shedding"](0.3)],
    OWN["Uniform"](6, density=2.5),
)


def test_bounds_follow_from_the_rate() -> None:
    kernel = OWN["Turbulent"](0.7)
    formula = sx.kernels.formula(kernel.formula, scale=0.7)
    rng = np.random.default_rng(1)
    a, c = np.floor(10.0 ** rng.uniform(0, 6, (2, 200)))
    b, d = np.floor(a * rng.uniform(1, 9, 200)), np.floor(c * rng.uniform(1, 9, 200))
    for found, expected in zip(kernel.bounds(a, b, c, d), formula.bounds(a, b, c, d), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert kernel.rigorous
    assert kernel.problems() == []
    assert kernel.to_dict() == {"name": "turbulent", "scale": 0.7}


def test_a_law_with_branches_is_known_to_be_sampled_only() -> None:
    class Branched(Kernel):
        name = "branched"
        rate = staticmethod(lambda i, j: 2.0 if i + j > 5.0 else 1.0)

    assert not Branched().rigorous
    assert float(Branched().bounds(1, 9, 1, 9)[1]) >= 2.0
    # those of the package state their own, or have proved ones of their rate
    assert all(k(**k.example).rigorous for k in sx.kernels.KERNELS)


def test_the_start_is_drawn_and_solved_alike() -> None:
    initial = MODEL.initial
    np.testing.assert_allclose(initial.densities(8), [2.5 / 6] * 6 + [0, 0])
    sizes, counts = initial.sample(600, 0.5)
    np.testing.assert_array_equal(sizes, np.arange(1, 7))
    np.testing.assert_array_equal(counts, 100)


@extinction
def test_a_method_of_ones_own() -> None:
    laws.whole_distribution(DIRECT, "ballistic", 0.3)


@extinction
@pytest.mark.slow
def test_a_method_of_ones_own_waits_as_others_do() -> None:
    laws.waiting_times(DIRECT)


@pytest.mark.slow
def test_a_method_of_ones_own_with_other_processes() -> None:
    """Against the rate equations, with particles that come, leave and shed others."""
    processes = [
        sx.processes.Aggregation(), OWN["Shedding"](0.3), sx.processes.Removal("0.1*k"),
        sx.processes.Source({2: 0.4}),
    ]  # fmt: skip
    model = sx.Model(OWN["Turbulent"](0.1), processes, OWN["Uniform"](6, density=2.5))
    replicas, time = 60, 0.5
    ds = sx.simulate(
        model, [time], method=DIRECT, particles=120, replicas=replicas, seed=5, sizes=12,
    )  # fmt: skip
    exact = sx.solve(model, [time])
    for order in (0, 1, 2):
        expected = exact["moment"].sel(order=order).values[0]
        laws.agree(ds["moment"].sel(order=order).values, expected, order)


@pytest.mark.parametrize(
    ("method", "weighting"),
    [
        (QUICK[1], "number"),
        *(
            pytest.param(m.name, w, marks=pytest.mark.slow)
            for m in sx.methods.METHODS
            for w in ("number", "mass-flow")
            if (m.name, w) != (QUICK[1], "number")
        ),
    ],
)
def test_simulation_and_solver(method: str, weighting: str) -> None:
    times = [0.3, 1.0]
    given = {"particles": 1500, "replicas": 30, "seed": 4, "sizes": 12}
    ds = sx.simulate(MODEL, times, method=method, weighting=weighting, **given)
    exact = sx.solve(MODEL, times, sizes=12).isel(replica=0)
    for name, at in (("moment", {"order": [0, 2]}), ("n", {"size": [1, 2, 5]})):
        values = ds[name].sel(at)
        error = values.std("replica", ddof=1) / 30**0.5
        assert (np.abs(values.mean("replica") - exact[name].sel(at)) < 4 * error).all()
    if weighting == "number":
        mass = ds["moment"].sel(order=1)
        np.testing.assert_array_equal(mass, mass[0, 0])
