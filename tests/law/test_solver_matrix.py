"""The solver from any start, with anything that happens, against closed forms.

What has no closed form is in `test_solver_reference.py`.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from solving import CLOSE, K1, STARTS, I, P, moment, number, slow, solved, with_
from verification.solver import closed, reference
from verification.solver.axes import KERNELS

import smolux as sx
from smolux import analysis
from smolux.errors import SmoluxWarning


def by_method(*quick):
    """Starts with a method, of which those are not slow; no direct sums that are dear."""
    return [
        pytest.param(start, method, id=name, marks=[] if name in quick else slow)
        for start in STARTS[:-1]
        for method in ("direct", "low-rank")
        if method == "low-rank" or start.largest <= 100
        for name in [f"{start.name} {method}"]
    ]


# Closed forms from any start


CONSTANT = ["2 direct", "33 direct", "1, few of 60 direct"]
CONSTANT += [f"{start.name} low-rank" for start in STARTS]


@pytest.mark.parametrize(("start", "method"), by_method(*CONSTANT))
def test_constant_kernel(start, method):
    times = [0.5, 1.5]
    ds = solved(sx.Model(K1, initial=start.initial), times, method=method)
    n = start.densities(start.largest)
    k = np.arange(1.0, len(n) + 1.0)
    mass, second = float(n @ k), float(n @ k**2)
    right = [closed.constant_number(start.density, t) for t in times]
    np.testing.assert_allclose(number(ds), right, rtol=CLOSE)
    np.testing.assert_allclose(moment(ds, 1), mass, rtol=CLOSE)
    right = [closed.second_moment("constant", mass, second, t) for t in times]
    np.testing.assert_allclose(moment(ds, 2), right, rtol=CLOSE)
    densities = closed.constant_densities(start.densities(1024), times[-1])
    np.testing.assert_allclose(ds["n"].values[0, -1], densities, atol=CLOSE)


ADDITIVE = ["33 direct"]
ADDITIVE += [f"{name} low-rank" for name in ("32", "47", "1 and 100", "exponential 10")]


@pytest.mark.parametrize(("start", "method"), by_method(*ADDITIVE))
def test_additive_kernel(start, method):
    n = start.densities(start.largest)
    k = np.arange(1.0, len(n) + 1.0)
    mass, second = float(n @ k), float(n @ k**2)
    times = [0.1 / mass, 0.3 / mass]
    ds = solved(sx.Model(sx.kernels.Additive(), initial=start.initial), times, method=method)
    right = [closed.additive_number(start.density, mass, t) for t in times]
    np.testing.assert_allclose(number(ds), right, rtol=CLOSE)
    right = [closed.second_moment("additive", mass, second, t) for t in times]
    np.testing.assert_allclose(moment(ds, 2), right, rtol=CLOSE)


@pytest.mark.parametrize("method", ["direct", "low-rank"])
@pytest.mark.parametrize("size", [23, 33, *(pytest.param(s, marks=slow) for s in (22, 24, 50))])
def test_brownian_kernel_knows_no_unit(size, method):
    # of degree 0: only the density decides; spec R2
    model = sx.Model(sx.kernels.Brownian(), initial=I.monodisperse(size=size))
    ds = solved(model, [1, 10], method=method)
    np.testing.assert_allclose(number(ds), [0.3294563200617, 0.04534585261516], rtol=CLOSE)


@pytest.mark.parametrize(
    "initial",
    [
        I.monodisperse(size=100),
        I.monodisperse(size=1000),
        I.from_sizes({1: 0.5, 100: 0.5}),
        I.from_sizes(dict.fromkeys(range(95, 106), 1 / 11)),
        pytest.param(I.lognormal(1000, 1.01), marks=slow),
    ],
    ids=["100", "1000", "1 and 100", "95 to 105", "lognormal 1000, 1.01"],
)
def test_large_starts_for_a_long_time(initial):
    ds = solved(sx.Model(K1, initial=initial), [1, 5, 10])
    np.testing.assert_allclose(number(ds), [2 / 3, 2 / 7, 1 / 6], rtol=CLOSE)


@pytest.mark.parametrize("size", [32, 60, 100, 300, pytest.param(1000, marks=slow)])
def test_shattering_of_large_particles(size):
    # d/dt N = λ M1 N - (1/2 + λ) N^2, whatever the sizes
    ds = solved(with_(P.Shattering(0.1), initial=I.monodisperse(size=size)), [0.5 / size, 1.0])
    right = [closed.riccati(1.0, 0.0, 0.1 * size, 0.6, t) for t in ds["time"].values]
    np.testing.assert_allclose(number(ds), right, rtol=CLOSE)
    np.testing.assert_allclose(moment(ds, 1), size, rtol=CLOSE)


def test_breakage_and_removal_of_large_particles():
    start = I.monodisperse(size=100)
    ds = solved(with_(P.Fragmentation(0.02), initial=start), [1.0, 3.0])
    right = [closed.riccati(1.0, 1.0, -0.01, 0.5, t) for t in (1.0, 3.0)]
    np.testing.assert_allclose(number(ds), right, rtol=CLOSE)
    ds = solved(with_(P.Removal(0.2), initial=start), [1.0, 3.0])
    right = [closed.riccati(1.0, 0.0, -0.2, 0.5, t) for t in (1.0, 3.0)]
    np.testing.assert_allclose(number(ds), right, rtol=CLOSE)
    np.testing.assert_allclose(moment(ds, 1), 100 * np.exp([-0.2, -0.6]), rtol=CLOSE)


@pytest.mark.filterwarnings("ignore:M1 of the lognormal law:smolux.errors.SmoluxWarning")
@pytest.mark.parametrize(("median", "sigma"), [(20, 2), (1, 2.5), (1, 3), (2, 2.5), (15, 2)])
def test_wide_lognormals(median, sigma):
    ds = solved(sx.Model(K1, initial=I.lognormal(median, sigma)), [1.0], method="low-rank")
    assert number(ds)[0] == pytest.approx(2 / 3, rel=CLOSE)


@pytest.mark.parametrize(
    ("sizes", "t"), [({32: 1.0}, 2.9), ({1: 1.0, 60: 1e-3}, 3.0), ({2: 1.0, 301: 1e-6}, 3.0)]
)
def test_gaps_between_sizes(sizes, t):
    ds = solved(sx.Model(K1, initial=I.from_sizes(sizes)), [t], method="low-rank")
    density = sum(sizes.values())
    assert number(ds)[0] == pytest.approx(closed.constant_number(density, t), rel=CLOSE)
    mass, second = (sum(s**p * d for s, d in sizes.items()) for p in (1, 2))
    assert moment(ds, 2)[0] == pytest.approx(second + mass**2 * t, rel=CLOSE)


@slow
def test_steep_breakage():
    # Radau on 1800 fixed sizes, which 3e-4 of the mass had left at t = 10
    law = "0.2*exp(0.01*min(i+j,2000))/(i+j-1)"
    model = with_(P.Fragmentation(law), kernel=sx.kernels.Shear(1.0))
    ds = solved(model, [1, 10], orders=(0, 1, 4 / 3))
    assert number(ds)[0] == pytest.approx(0.0526540801, rel=1e-6)
    np.testing.assert_allclose(moment(ds, 1), 1.0, rtol=CLOSE)
    mean = ds["moment"].values[0, :, 2]
    assert mean[0] == pytest.approx(5.454046, rel=2e-6)
    assert mean[1] == pytest.approx(6.5478, rel=1e-4)


# Sources and removal


@pytest.mark.parametrize(
    ("rates", "initial", "t"),
    [
        ({1: 1.0, 5000: 1e-3}, I.empty(), 2.0),
        ({100: 1.0}, I.monodisperse(), 2.0),
        ({40: 1.0}, I.empty(), 4.0),
        ({64: 1.0}, I.empty(), 4.0),
        ({65: 0.5}, I.monodisperse(size=3), 4.0),
        ({3000: 0.1}, I.monodisperse(), 2.0),
    ],
)
def test_sources_of_any_size(rates, initial, t):
    ds = solved(with_(P.Source(rates), initial=initial), [0.5 * t, t])
    flux, mass = sum(rates.values()), sum(s * r for s, r in rates.items())
    first = initial.total * initial.largest
    times = np.array([0.5 * t, t])
    np.testing.assert_allclose(moment(ds, 1), first + mass * times, rtol=CLOSE)
    np.testing.assert_allclose(ds["mass_in"].values[0], mass * times, rtol=CLOSE)
    np.testing.assert_allclose(
        ds["events"].sel(process="source").values[0], flux * times, rtol=CLOSE
    )
    # what comes in collides with nothing
    collisions = ds["events"].sel(process="aggregation").values
    np.testing.assert_array_equal(ds["collisions"].values, collisions)
    right = [closed.riccati(initial.total, flux, 0.0, 0.5, s) for s in times]
    np.testing.assert_allclose(number(ds), right, rtol=CLOSE)


@pytest.mark.parametrize(
    ("kernel", "above", "printed"),
    [("constant", 1, 0.3333), ("constant", 2, 0.4176), ("constant", 3, 0.4572)]
    + [("Brownian", above, None) for above in (1, 3, 7)],
)
def test_removal_above_any_size(kernel, above, printed):
    chosen = next(k for k in KERNELS if k.name == kernel)
    start = STARTS[0]
    problem = reference.Problem(
        chosen.law, [reference.Pairs("aggregation")], [], [], start.densities, above, cut=above
    )
    exact = reference.solve(problem, [0.5, 2.0])
    if printed:
        assert exact.moment[-1, 0] == pytest.approx(printed, abs=5e-5)
    ds = solved(with_(P.Removal(above=above), kernel=chosen.kernel), [0.5, 2.0])
    np.testing.assert_allclose(number(ds), exact.moment[:, 0], rtol=CLOSE)
    np.testing.assert_allclose(ds["mass_out"].values[0], exact.mass_out, rtol=CLOSE)
    np.testing.assert_allclose(moment(ds, 1) + ds["mass_out"].values[0], 1.0, rtol=CLOSE)


def test_everything_leaves():
    ds = solved(with_(P.Removal(1.0)), [1.0, 20.0, 800.0])
    right = [closed.riccati(1.0, 0.0, -1.0, 0.5, t) for t in (1.0, 20.0)]
    np.testing.assert_allclose(number(ds)[:2], right, rtol=CLOSE)
    assert 0.0 <= number(ds)[2] < 1e-300
    np.testing.assert_allclose(ds["mass_out"].values[0], -np.expm1([-1.0, -20.0, -800.0]))


# What varies in time

SPIKE = "1000*exp(-((t-50)/0.01)**2)"
#: its integral
AREA = 10 * math.sqrt(math.pi)
SLOW = sx.kernels.Constant(1e-6)


def test_source_with_a_narrow_pulse():
    ds = solved(with_(P.Source(1, varying=SPIKE)), [100])
    assert ds["mass_in"].values[0, 0] == pytest.approx(AREA, rel=CLOSE)
    assert moment(ds, 1)[0] == pytest.approx(1 + AREA, rel=CLOSE)
    # before, the pulse itself, after: the pulse lasts 0.02, over which next to nothing meets
    after = 2 / (2 / (2 / 52 + AREA) + 50)
    assert number(ds)[0] == pytest.approx(after, rel=2e-3)


def test_periodic_source_in_a_slow_system():
    ds = solved(with_(P.Source(1, varying="max(0, sin(2*pi*t))"), kernel=SLOW), [20])
    assert ds["mass_in"].values[0, 0] == pytest.approx(20 / math.pi, rel=CLOSE)


def box(t):
    return 1.0 if 42 <= t < 78 else 0.0


@pytest.mark.parametrize("stated", [False, True])
def test_box_in_a_slow_system(stated):
    varying = sx.law(box, breakpoints=[42, 78]) if stated else box
    ds = solved(with_(P.Source(1, varying=varying), kernel=SLOW), [100])
    assert ds["mass_in"].values[0, 0] == pytest.approx(36, rel=CLOSE)


def test_pulse_by_a_formula_with_corners():
    # a triangle of height 1 and width 2 about 50
    ds = solved(with_(P.Source(1, varying="max(0, 1 - abs(t - 50))"), kernel=SLOW), [30, 100])
    np.testing.assert_allclose(ds["mass_in"].values[0], [0.0, 1.0], rtol=CLOSE)


@pytest.mark.parametrize("process", ["removal", "shattering", "fragmentation"])
def test_pulses_of_other_processes(process):
    # the pulse is over before particles meet: what it does is known alone
    pulse = f"0.05*{SPIKE}"
    strength = 0.05 * AREA
    slow = sx.kernels.Constant(1e-10)
    if process == "removal":
        ds = solved(with_(P.Removal(1, varying=pulse), kernel=slow), [100])
        right = math.exp(-strength)
    elif process == "fragmentation":
        start = I.monodisperse(size=2)
        ds = solved(with_(P.Fragmentation(2.0, varying=pulse), kernel=slow, initial=start), [100])
        right = 2 - math.exp(-strength)
    else:
        # N' = λ(t) K (M1 - N) N, with 100-mers and λ of 1e6
        kernel = sx.kernels.Constant(1e-8)
        start = I.monodisperse(size=100)
        ds = solved(with_(P.Shattering(f"1e6*{pulse}"), kernel=kernel, initial=start), [100])
        grown = math.exp(100 * 0.01 * strength)
        right = 100 * grown / (99 + grown)
    assert number(ds)[0] == pytest.approx(right, rel=2e-6 if process == "shattering" else CLOSE)


@pytest.mark.parametrize(
    ("varying", "share"), [("t", 0.5), ("t**3", 0.25), ("max(0, t - 0.4)", 0.18), (box, None)]
)
def test_source_that_begins_with_nothing(varying, share):
    end = 1.0 if share else 100.0
    model = with_(P.Source(2.0, varying=varying), kernel=SLOW, initial=I.empty())
    ds = solved(model, [end])
    assert moment(ds, 1)[0] == pytest.approx(2 * share if share else 72.0, rel=CLOSE)


def test_kinks_cost_no_accuracy():
    varying = "max(0, sin(2*pi*t))"
    ds = solved(with_(P.Removal(1, varying=varying)), [3.25])
    right = closed.diluted_number(
        1.0, lambda t: max(0.0, math.sin(2 * math.pi * t)), 3.25, [0.5 * k for k in range(1, 7)]
    )
    assert number(ds)[0] == pytest.approx(right, rel=CLOSE)
    assert moment(ds, 1)[0] == pytest.approx(math.exp(-3.5 / math.pi), rel=CLOSE)


# Gelation


@pytest.mark.parametrize(
    "initial",
    [I.monodisperse(3.0), I.exponential(1.5), I.monodisperse(1 / 3, size=3)],
    ids=["three monomers", "exponential", "trimers"],
)
@pytest.mark.parametrize("kernel", [sx.kernels.Multiplicative(), sx.kernels.formula("i*j")])
def test_gel_time(kernel, initial):
    # 1 / M2 at the start: 1/3 for all three
    model = sx.Model(kernel, initial=initial)
    ds = solved(model, np.linspace(0.0, 0.25, 26))
    assert analysis.gelation(ds).attrs["gel_time"] == pytest.approx(1 / 3, rel=1e-3)


@pytest.mark.parametrize("times", [[1.5, 2.0], pytest.param([0.5, 1.5, 2.0], marks=slow)])
@pytest.mark.parametrize(
    "kernel", [sx.kernels.formula("i*j"), pytest.param(sx.kernels.Multiplicative(), marks=slow)]
)
def test_gel_fraction_is_of_the_mass_at_the_start(kernel, times):
    with pytest.warns(SmoluxWarning, match="gel"):
        ds = solved(sx.Model(kernel), times)
    found = analysis.gel_fraction(ds).values[0]
    np.testing.assert_allclose(found[-2:], [1 / 3, 1 / 2], atol=1e-3)  # Stockmayer
