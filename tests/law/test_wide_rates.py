"""Rates over many decades: what is left of the large ones must not stand for the small ones."""

from __future__ import annotations

import json
from typing import Any

import chains
import laws
import pytest

import smolux as sx
from shared import EVERY, extinction, laborious, repaired
from smolux.core.state import TRIALS
from smolux.methods import METHODS
from smolux.stochastic.make_plan import make_plan
from smolux.stochastic.replicas import Group

pytestmark = [extinction, laborious]

END = 1e12


#: one law for all tests, so that they share their loops
FORMULA = "c0 + c1*min(1, max(0, min(i, j) - 10)) + c2*(i*j)**power + c3*(i - j)**2"

every_method = pytest.mark.parametrize("method", [method.name for method in METHODS])
every_but_fictitious = pytest.mark.parametrize("method", EVERY)


def _kernel(
    c0: float = 0.0, c1: float = 0.0, c2: float = 0.0, c3: float = 0.0, power: float = 4.0
) -> Any:
    return sx.kernels.formula(FORMULA, c0=c0, c1=c1, c2=c2, c3=c3, power=power)


@pytest.mark.parametrize("method", ["inverse", "size-class"])
def test_rates_over_24_decades(method: str) -> None:
    kernel = _kernel(c0=1e-12, c1=1e12)
    start = sx.initial.from_sizes({1: 4 / 7, 11: 3 / 7})
    ds = sx.simulate(
        sx.Model(kernel, initial=start), [END], method=method, population="fixed-volume",
        particles=7, replicas=4000, bins_per_octave=1, seed=1,
    )  # fmt: skip
    volume = float(ds["volume"][0, 0])
    # what merges at once has merged: the exponential of the other rates is left
    moves = chains.pairs(lambda i, j: 1e-12, lambda k: 1.0, volume)
    place, p = chains.law((1, 1, 1, 1, 33), moves, (END,), 5)
    mean = sum(p[0][k] * len(state) for state, k in place.items())
    laws.agree(ds["particles"].values[:, 0], mean, method)


@every_method
def test_the_largest_of_a_class_alone_has_a_rate(method: str) -> None:
    """The size 11 with itself, and no smaller one: two of it merge a million times before the end.

    One replica, as what it finds out about bounds serves the others.
    """
    kernel = _kernel(c0=1e-12, c1=1e6)
    ds = sx.simulate(
        sx.Model(kernel, initial=sx.initial.monodisperse(size=11)), [1e2], method=method,
        population="fixed-volume", particles=2, replicas=1, bins_per_octave=1, seed=6,
    )  # fmt: skip
    assert ds["extinction_time"].item() < 1e-4


@pytest.mark.parametrize(
    ("sizes", "end"),
    [((1, 1, 10**4), 1e-16), ((1, 1, 1, 10, 12), 1e-5), ((1, 60, 60, 60, 60), 1e7)],
    ids=["giant", "two-merge-first", "dwarf"],
)
@every_but_fictitious
def test_a_lone_particle_does_not_meet_itself(
    method: str, sizes: tuple[int, ...], end: float
) -> None:
    """In a law so steep that one with itself would have all but 1e-32 of the rates."""
    steep = 4.0 if sizes[1] == 1 else -4.0
    kernel = _kernel(c2=1.0, power=steep)
    n = len(sizes)
    start = sx.initial.from_sizes({k: sizes.count(k) / n for k in sizes})
    ds = sx.simulate(
        sx.Model(kernel, initial=start), [end], method=method, population="fixed-volume",
        particles=n, replicas=2000, bins_per_octave=1, seed=2,
    )  # fmt: skip
    volume = float(ds["volume"][0, 0])
    moves = chains.pairs(lambda i, j: float(i * j) ** steep, lambda k: 1.0, volume)
    place, p = chains.law(sizes, moves, (end,), n)
    mean = sum(p[0][k] * len(state) for state, k in place.items())
    assert 1.2 < mean < n - 0.2
    laws.agree(ds["particles"].values[:, 0], mean, method)


@pytest.mark.parametrize("method", ["inverse", "low-rank"])
def test_the_small_rates_of_particles_that_had_large_ones(method: str) -> None:
    """Of giants with a dwarf that merges at once: 1e16 times those that are left, and rounded."""
    steep, giant, end = -6.0, 600, 1e33
    start = sx.initial.from_sizes({1: 0.2, giant: 0.8})
    ds = sx.simulate(
        sx.Model(_kernel(c2=1.0, power=steep), initial=start), [end], method=method,
        population="fixed-volume", particles=5, replicas=2000, bins_per_octave=1, seed=5,
    )  # fmt: skip
    volume = float(ds["volume"][0, 0])
    moves = chains.pairs(lambda i, j: float(i * j) ** steep, lambda k: 1.0, volume)
    place, p = chains.law((giant, giant, giant, giant + 1), moves, (end,), 4)
    mean = sum(p[0][k] * len(state) for state, k in place.items())
    assert 1.2 < mean < 3.8
    laws.agree(ds["particles"].values[:, 0], mean, method)


@repaired  # a bound that is too low is to be seen by the law
@pytest.mark.parametrize("method", ["acceptance-rejection", "low-rank"])
def test_a_second_lone_particle_is_noticed(method: str) -> None:
    """Pairs without the one of 15 have bounds in which two that merge have no part."""

    def law(i: int, j: int) -> float:
        return 5e4 + float(i * j) ** 4

    kernel, sizes, end = _kernel(c0=5e4, c2=1.0), (1, 1, 1, 15), 1.5e-5
    start = sx.initial.from_sizes({1: 0.75, 15: 0.25})
    ds = sx.simulate(
        sx.Model(kernel, initial=start), [end], method=method, population="fixed-volume",
        particles=4, replicas=1000, bins_per_octave=1, seed=4,
    )  # fmt: skip
    moves = chains.pairs(law, lambda k: 1.0, float(ds["volume"][0, 0]))
    place, p = chains.law(sizes, moves, (end,), 4)
    mean = sum(p[0][k] * len(state) for state, k in place.items())
    laws.agree(ds["particles"].values[:, 0], mean, method)


def _all_merge(kernel: Any, particles: int, method: str, most: int) -> None:
    plan = make_plan(
        sx.Model(kernel),
        [1e9],
        method=method,
        population="fixed-volume",
        particles=particles,
        replicas=1,
        seed=1,
        orders=(0, 1),
        sizes=64,
    )
    group = Group.start(plan, 0, 1)
    group.advance(lambda: int(group.state.count[0, TRIALS]) > 2 * most)
    assert group.events == particles - 1
    assert group.state.count[0, TRIALS] < most


@every_method
def test_all_merge_in_few_candidates(method: str) -> None:
    _all_merge(_kernel(c2=1.0), 200, method, 20_000_000)


def test_auto_finishes_a_steep_law() -> None:
    _all_merge(_kernel(c2=1.0, power=3.0), 2000, "auto", 200_000)


@pytest.mark.slow
def test_auto_finishes_a_steep_law_with_a_majorant() -> None:
    _all_merge(sx.kernels.Product(mu=4.0), 200, "auto", 200_000)


@pytest.mark.parametrize("octaves", [-1012, 990], ids=["1e-305", "1e298"])
@every_method
def test_rates_near_the_ends_of_all_numbers(method: str, octaves: int) -> None:
    """In a unit of time that is a power of two, nothing is rounded otherwise: the same bits."""
    found = []
    for unit in (1.0, 2.0**octaves):
        kernel = _kernel(c0=unit, c3=0.01 * unit)
        ds = sx.simulate(
            sx.Model(kernel), [0.3 / unit, 1.0 / unit], method=method, population="fixed-volume",
            particles=300, replicas=3, bins_per_octave=1, seed=3,
        )  # fmt: skip
        assert json.loads(ds.attrs["warnings"]) == []
        found.append(ds["particles"].values)
    assert found[0].max() < 300
    assert (found[0] == found[1]).all()


def test_rates_whose_sum_no_number_holds() -> None:
    with pytest.raises(sx.InputError, match=r"no finite sum.* longer unit of time"):
        sx.simulate(
            sx.Model(_kernel(c0=1e305)), 1e-305, method="inverse", particles=3000, replicas=1
        )


@pytest.mark.parametrize(
    "method", ["low-rank", pytest.param("fictitious-jumps", marks=pytest.mark.slow)]
)
def test_a_majorant_of_a_law_with_zeros(method: str) -> None:
    kernel = _kernel(c3=1.0)
    start = sx.initial.from_sizes({1: 0.5, 2: 0.5})
    ds = sx.simulate(
        sx.Model(kernel, initial=start), [0.5], method=method, population="fixed-volume",
        particles=6, replicas=4000, bins_per_octave=1, seed=3,
    )  # fmt: skip
    volume = float(ds["volume"][0, 0])
    moves = chains.pairs(lambda i, j: float((i - j) ** 2), lambda k: 1.0, volume)
    place, p = chains.law((1, 1, 1, 2, 2, 2), moves, (0.5,), 6)
    mean = sum(p[0][k] * len(state) for state, k in place.items())
    laws.agree(ds["particles"].values[:, 0], mean, method)
    assert not any("bound" in text for text in sx.results.warnings(ds))
