"""The size-class method where its store and its classes are strained."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import smolux as sx
from shared import extinction
from smolux.methods.size_class.method import SizeClass

#: one law for many kernels: far from low rank, a narrow ridge, with zeros, gelling
LAW = "a*abs(i - j) + b*exp(-((i - j)/w)**2) + c*(i*j)**m"


def kernel(a: float = 0.0, b: float = 0.0, w: float = 1.0, c: float = 0.0, m: float = 0.0) -> Any:
    return sx.kernels.formula(LAW, a=a, b=b, w=w, c=c, m=m)


def model(law: Any, shattering: float = 0.0, initial: Any = None) -> sx.Model:
    processes = [sx.processes.Aggregation(), sx.processes.Shattering(shattering)]
    return sx.Model(law, processes, initial or sx.initial.monodisperse())


KERNELS = {
    "difference": kernel(a=1.0, b=0.1, w=0.5),
    "difference with zeros": kernel(a=1.0),
    "ridge": kernel(b=1.0, w=0.3, c=0.01),
    "nearly gelling": kernel(c=1.0, m=0.5),
}
INITIAL = sx.initial.from_sizes({1: 0.5, 2: 0.3, 20: 0.2})


@cache
def solution(name: str) -> Any:
    return sx.solve(model(KERNELS[name], 0.05, INITIAL), [0.1, 0.3], tolerance=1e-6)


#: the one that is furthest from low rank; the others say the same again
QUICK = ("difference", 4)


@pytest.mark.parametrize(
    ("name", "classes"),
    [
        pytest.param(name, k, marks=() if (name, k) == QUICK else pytest.mark.slow)
        for name in KERNELS
        for k in (1, 4, 16)
    ],
)
def test_kernels_far_from_low_rank_follow_the_rate_equations(name: str, classes: int) -> None:
    case = model(KERNELS[name], 0.05, INITIAL)
    ds = sx.simulate(
        case, [0.1, 0.3], method=SizeClass(classes), particles=20_000, replicas=12, seed=5
    )
    exact = solution(name)
    for order in (0, 2):
        found = ds["moment"].sel(order=order).values
        error = found.std(axis=0, ddof=1) / np.sqrt(len(found))
        deviation = found.mean(axis=0) - exact["moment"].sel(order=order).values[0]
        assert np.abs(deviation / error).max() < 5.5  # Student, 11 degrees of freedom: 2e-4
    mass = ds["moment"].sel(order=1).values * ds["volume"].values
    assert (mass == np.rint(mass)).all()


@extinction
@pytest.mark.parametrize("particles", [2, 3, 17, 1000])
def test_few_particles_end_as_one_cluster(particles: int) -> None:
    ds = sx.simulate(
        model(kernel(c=1.0)), [1e6], method="size-class", particles=particles, replicas=3, seed=1,
        population="fixed-volume",
    )  # fmt: skip
    assert (ds["particles"].values == 1).all()
    assert (ds["largest"].values == particles).all()
    assert (ds["collisions"].values == particles - 1).all()


@pytest.mark.slow
def test_ten_million_particles_follow_the_exact_solution() -> None:
    particles, times = 10_000_000, [1.0, 10.0]
    ds = sx.simulate(
        model(kernel(c=1.0)), times, method="size-class", particles=particles, replicas=1, seed=6
    )
    exact = sx.exact.solution(sx.Model(kernel=sx.kernels.Constant()))
    assert exact is not None
    np.testing.assert_array_equal(ds["moment"].sel(order=1), 1.0)
    # one replica, so by a bound of the variance: Poisson's, each particle doubled with its volume
    sizes = np.array([1, 2, 5, 20])
    volume = ds["volume"].values[0, :, None]
    mean = exact.densities(np.array(times), sizes) * volume
    error = np.sqrt(mean * volume / particles)
    assert np.abs((ds["n"].sel(size=sizes).values[0] * volume - mean) / error).max() < 5.0


@pytest.mark.slow
@pytest.mark.parametrize("method", ["size-class", "low-rank"])
def test_sizes_beyond_32_bits_and_beyond_the_classes_of_the_start(method: str) -> None:
    times = [1e3, 1e9, 1e12]
    ds = sx.simulate(model(kernel(c=1.0)), times, method=method, particles=400, replicas=8, seed=2)
    clusters = ds["number_density"].values * np.array(times)
    error = clusters.std(axis=0, ddof=1) / np.sqrt(8)
    assert (np.abs(clusters.mean(axis=0) - 2.0 / (1.0 + 2.0 / np.array(times))) < 7 * error).all()
    assert ds["largest"].values[:, -1].min() > 1 << 40
    assert ds["moment"].sel(order=1).values == pytest.approx(1.0, abs=0.0)


def test_shattering_fills_the_lists_beyond_their_start() -> None:
    case = model(kernel(c=1.0), 0.02, sx.initial.from_sizes({60: 1.0}))
    ds = sx.simulate(case, [0.5, 5.0], method="size-class", particles=20_000, replicas=8, seed=3,
                     distribution=True)  # fmt: skip
    assert ds["particles"].values.max() > 40_000
    assert (ds["moment"].sel(order=1).values == 60.0).all()
    # N' = 60 * 0.02 N - (1/2 + 0.02) N**2, whatever the sizes are
    steady = 0.52 / 1.2
    exact = 1.0 / (steady + (1.0 - steady) * np.exp(-1.2 * np.array([0.5, 5.0])))
    found = ds["number_density"].values
    error = found.std(axis=0, ddof=1) / np.sqrt(len(found))
    print(found.mean(axis=0), exact, error)
    assert (np.abs(found.mean(axis=0) - exact) < 7 * error).all()  # Student, 7 degrees


@pytest.mark.parametrize("method", ["size-class", pytest.param("low-rank", marks=pytest.mark.slow)])
def test_debris_that_falls_into_one_class_finds_room(method: str) -> None:
    largest, cluster = 1040, 60_000
    debris = np.zeros(largest)
    debris[0], debris[1024:] = 1e-6, 1.0  # some 116 pieces of 1025 to 1040 from two clusters
    case = sx.Model(
        kernel(c=float(cluster) ** -8, m=4.0),  # pieces hardly collide
        [sx.processes.CollisionalFragmentation(1.0, list(debris))],
        sx.initial.from_sizes({cluster: 1.0}),
    )
    ds = sx.simulate(case, [3.0], method=method, particles=16, replicas=16, seed=1,
                     population="fixed-volume")  # fmt: skip
    assert ds["particles"].values.min() > 200
    assert (ds["moment"].sel(order=1) * ds["volume"] == 16 * cluster).all()


def test_sizes_that_react_with_nothing() -> None:
    # only equal sizes meet, so that whole classes come and go without a rate
    means, errors = [], []
    for classes in (1, 16):
        ds = sx.simulate(
            model(kernel(b=1.0, w=0.01)), [3.0, 30.0], method=SizeClass(classes), particles=100,
            replicas=400, seed=classes, population="fixed-volume",
        )  # fmt: skip
        found = ds["number_density"].values
        means.append(found.mean(axis=0))
        errors.append(found.std(axis=0, ddof=1) / np.sqrt(len(found)))
    assert (np.abs(means[0] - means[1]) < 4.5 * np.hypot(*errors)).all()
    # n_1' = -n_1**2, n_2' = n_1**2/2 - n_2**2, ...; what few particles change is of the order 1/N
    assert means[0] == pytest.approx([0.55159, 0.18729], abs=0.01)


def test_the_number_of_classes_is_checked() -> None:
    with pytest.raises(sx.errors.InputError, match="classes = 3: must be 1, 2, 4"):
        SizeClass(3)


@pytest.mark.slow
def test_a_kernel_that_fails_beyond_some_size_is_named() -> None:
    law = sx.kernels.formula("1/(c - i*j)", c=4e12)  # infinite for sizes of two million
    case = model(law, initial=sx.initial.from_sizes({1_000_000: 1.0}))
    with pytest.raises(sx.errors.InputError, match=r"no finite bound|gave .* for the sizes"):
        sx.simulate(case, [1e15], method="size-class", particles=100, replicas=1, seed=1)
