"""Terms of a kernel that vary in time, each by itself: chains of few particles, closed moments."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.shared import FORMULA, QUICK, extinction

import smolux as sx
from smolux import case as cases
from smolux.analysis.reference import model_of
from smolux.cli.cautions import negative_rates
from smolux.deterministic.steady import steady_state
from smolux.errors import InputError
from smolux.exact import finite
from smolux.exact.find import solution
from smolux.kernels import Sum, from_dict
from smolux.methods.costs import unforeseen
from smolux.stochastic import checkpoint as checkpoints
from smolux.stochastic.make_plan import make_plan
from smolux.stochastic.replicas import Group
from smolux.stochastic.time_windows import time_windows_for

P = sx.processes
#: the choice by the sum is the loop's and not the method's: one method is quick to compile
METHODS = [
    pytest.param(m.name, marks=[] if m.name == QUICK[1] else pytest.mark.slow)
    for m in sx.methods.METHODS
]


def late(t):
    """Nothing at first: a function that is bounded by trial."""
    return 1.5 if t > 0.4 else 0.0


def term(c0: float = 0.0, c1: float = 0.0) -> sx.kernels.Kernel:
    return sx.kernels.formula(FORMULA, c0=c0, c1=c1, c2=0.0, c3=0.0)


def law(first="1 + sin(5*t)", second=late) -> sx.kernels.Kernel:
    """``f(t) + g(t) (i + j)``."""
    return term(c0=1.0) * first + term(c1=1.0) * second


def model(processes=None, kernel=None, initial=None) -> sx.Model:
    processes = processes or [P.Aggregation("1 + t/2"), P.Shattering("0.6*t")]
    return sx.Model(kernel or law(), processes, initial or sx.initial.monodisperse())


def deviation(ds, expected, name="moment", **at):
    """Return by how many standard errors a mean differs."""
    values, known = (d[name].sel(**at) if at else d[name] for d in (ds, expected))
    error = values.std("replica", ddof=1) / len(ds.replica) ** 0.5
    return np.abs((values.mean("replica") - known.isel(replica=0)) / error).values


@extinction
@pytest.mark.parametrize("method", METHODS)
def test_three_monomers(method):
    """The chain of 3, 2 and 1 particles, and back by shattering of a pair, in a fixed volume."""
    density, times = 2.5, [0.35, 1.1]
    ds = sx.simulate(
        model(initial=sx.initial.monodisperse(density)), times, method=method, particles=3,
        population="fixed-volume", replicas=8000, seed=3, sizes=3,
    )  # fmt: skip
    volume = 3 / density

    def change(t, p):
        f, g = 1 + np.sin(5 * t), late(t)
        sticks, shatters = 1 + t / 2, 0.6 * t
        first = 3 * sticks * (f + 2 * g) / volume * p[0]
        back, second = (rate * (f + 3 * g) / volume * p[1] for rate in (shatters, sticks))
        return [back - first, first - back - second, second]

    p = np.array([1.0, 0.0, 0.0])
    for start, end in ((0.0, 0.35), (0.35, 0.4), (0.4, 1.1)):
        now = (np.nextafter(start, 1), np.nextafter(end, 0))
        p = solve_ivp(change, now, p, rtol=1e-10, atol=1e-12).y[:, -1]
        if end in times:
            left = ds["particles"].isel(time=times.index(end))
            found = np.array([float((left == n).mean()) for n in (3, 2, 1)])
            assert (np.abs(found - p) < 4.5 * np.sqrt(p * (1 - p) / 8000)).all()


def test_the_rate_equations_have_the_moments_of_a_sum():
    """M0, M1 and M2 of ``f + g (i + j)`` obey equations of their own, whatever f and g."""
    times = [0.3, 1.5]
    kernel = sx.kernels.Constant(2.0) * "exp(-t)" + sx.kernels.Additive(0.5) * late
    assert len(kernel.in_time) == 2
    ds = sx.solve(sx.Model(kernel, P.Aggregation("1 + t")), times, tolerance=1e-9)

    def change(t, m):
        f, g = 2 * np.exp(-t) * (1 + t), 0.5 * late(t) * (1 + t)
        return [-0.5 * f * m[0] ** 2 - g * m[0], f + 2 * g * m[1]]

    m = np.ones(2)
    for k, (start, end) in enumerate([(0.0, 0.3), (0.3, 0.4), (0.4, 1.5)]):
        now = (np.nextafter(start, 1), np.nextafter(end, 0))
        m = solve_ivp(change, now, m, rtol=1e-11, atol=1e-13).y[:, -1]
        if k != 1:
            found = ds["moment"].sel(order=[0, 2]).isel(time=int(k > 0), replica=0)
            np.testing.assert_allclose(found, m, rtol=1e-7)


TWO = sx.kernels.Constant(0.5) * "2*(1 + t)*exp(-t)" + term(c0=1.0) * "(1 + t)*(1 - exp(-t))"


@pytest.mark.parametrize("gel", ["inert", "reacts"])
def test_two_terms_that_together_are_one(gel):
    """``1 + t`` in all: at t = 2, N = 1/3, and all densities are those of another time."""
    plain = sx.Model(sx.kernels.Constant())
    ds = sx.solve(sx.Model(TWO), [2.0], tolerance=1e-9, gel=gel)
    assert float(ds["number_density"][0, 0]) == pytest.approx(1 / 3, rel=1e-8)
    np.testing.assert_allclose(ds["n"], sx.solve(plain, [4.0], tolerance=1e-9)["n"], atol=1e-9)


def flash(t):
    """A short one, which steps in time would pass."""
    return 1000.0 if 30 < t < 30.001 else 0.0


def test_the_rate_equations_see_a_short_factor():
    ds = sx.solve(sx.Model(sx.kernels.Constant() * flash), [100.0])
    assert float(ds["number_density"][0, 0]) == pytest.approx(1 / (1 + 0.5), rel=1e-7)


@pytest.mark.filterwarnings("default:from t = .* on mass lies beyond:smolux.errors.SmoluxWarning")
def test_a_gel_reacts_by_every_term():
    two = sx.kernels.Multiplicative() * "exp(-t)" + 0.5 * sx.kernels.formula("2*i*j") * "1-exp(-t)"
    given = {"times": [0.5, 3.0], "gel": "reacts", "orders": [0, 1], "window": 500}
    ds, plain = (sx.solve(sx.Model(k), **given) for k in (two, sx.kernels.Multiplicative()))
    np.testing.assert_allclose(ds["moment"], plain["moment"], rtol=1e-6)


def test_a_common_factor_is_that_of_aggregation():
    times = [0.1, 0.4]
    both = sx.kernels.Constant() * "1 + t" + 2 * (sx.kernels.Additive() * "1 + t")
    assert [f.text for f, _ in both.in_time] == ["1 + t"]
    kernel = sx.kernels.Constant() + 2 * sx.kernels.Additive()
    assert sx.Model(kernel * "1 + t").kernel.in_time[0][0] == both.in_time[0][0]
    one, two = (
        sx.solve(m, times, tolerance=1e-9)
        for m in (sx.Model(both), sx.Model(kernel, P.Aggregation("1 + t")))
    )
    np.testing.assert_array_equal(one["moment"], two["moment"])


@pytest.mark.slow
@pytest.mark.parametrize("kernel", [TWO, sx.kernels.Constant() * "1 + t"], ids=["two", "one"])
def test_another_time_in_a_simulation(kernel):
    given = {"method": QUICK[1], "particles": 2000, "replicas": 60, "seed": 5}
    ds = sx.simulate(sx.Model(kernel), [2.0], **given)
    expected = sx.solve(sx.Model(sx.kernels.Constant()), [4.0])
    assert (deviation(ds, expected.assign_coords(time=[2.0]), order=[0, 2]) < 4).all()


@pytest.mark.slow
@pytest.mark.parametrize("weighting", ["mass-flow", sx.weighting.WeightFunction(0.5)])
@pytest.mark.parametrize("method", QUICK)
def test_with_every_weighting(method, weighting):
    given = {"method": method, "particles": 2000, "replicas": 40, "seed": 2}
    ds = sx.simulate(model(), [0.5, 1.0], weighting=weighting, **given)
    assert (deviation(ds, sx.solve(model(), [0.5, 1.0]), order=[0, 2]) < 4).all()


@pytest.mark.slow
def test_beside_other_processes_and_with_shares():
    share = "1/(1 + 0.2*(i + j))"
    processes = [P.Aggregation("1 + t/2", share=share), P.Shattering(0.3), P.Removal(0.2)]
    processes.append(P.Source(0.5, varying="1 + sin(3*t)"))
    given = {"method": QUICK[1], "particles": 2000, "replicas": 40, "seed": 4}
    ds = sx.simulate(model(processes), [0.5, 1.2], **given)
    expected = sx.solve(model(processes), [0.5, 1.2])
    assert (deviation(ds, expected, order=[0, 1, 2]) < 4).all()
    assert (deviation(ds, expected, "number_density") < 4).all()
    events = ds["events"] / ds["volume"]
    error = events.std("replica", ddof=1) / 40**0.5
    assert (np.abs(events.mean("replica") - expected["events"][0])[:, 0] < 4 * error[:, 0]).all()


@pytest.mark.slow
def test_sub_volumes():
    """Each has the rates of the whole; how long until they mix is estimated from the start."""
    given = {"method": QUICK[1], "particles": 2000, "replicas": 40, "subvolumes": 2, "seed": 6}
    ds = sx.simulate(model(), [0.5, 1.0], **given)
    assert (deviation(ds, sx.solve(model(), [0.5, 1.0]), order=[0, 2]) < 4).all()


def test_a_run_goes_on_from_its_checkpoint(tmp_path):
    plan = make_plan(
        model(), [0.2, 1.0], method=QUICK[1], weighting="number", particles=150, replicas=2, seed=5
    )
    whole, part = (Group.start(plan, 0, 2) for _ in range(2))
    part._call(part.codes, 100)
    part._serve()
    assert not part.done
    checkpoints.save(tmp_path / "run.npz", plan, [part])
    (again,) = checkpoints.load(tmp_path / "run.npz", model())[1]
    for group in (whole, again):
        while not group.done:
            group._call(group.codes, 1000)
            group._serve()
    for one, two in zip(whole.state, again.state, strict=True):
        np.testing.assert_array_equal(one, two)


def test_windows_bound_the_largest_term():
    """Pairs are drawn by the sum without factors, and no pair may be above the bound."""
    process = P.Aggregation("2 - t/10")
    kernel = sx.kernels.Constant() * "t" + sx.kernels.Additive() * "0.5*(4 - t)"
    windows = time_windows_for([process], 4.0, None, kernel)
    ends = zip(windows.edges[:-2], windows.edges[1:-1], windows.bounds[:-1], strict=True)
    for start, end, bound in ends:
        t = np.linspace(start, end, 101)
        most = ((2 - t / 10) * np.maximum(t, 0.5 * (4 - t))).max()
        assert most <= bound[0] <= 1.05 * most
    np.testing.assert_array_equal(windows.total, windows.bounds[:, 0])


def test_what_is_known():
    kernel = law()
    assert sx.Model(kernel).varying == (f"kernel {kernel.label}",)
    assert not sx.Model(kernel).plain_aggregation
    assert solution(sx.Model(TWO)) is None
    assert (sx.kernels.Multiplicative() * "1 + t").gels is None
    assert (sx.kernels.Additive() * "1 + t").gels is False
    assert "a kernel that varies in time" in unforeseen(sx.Model(kernel))[1]
    with pytest.raises(InputError, match="its rate depends on time, so there is no steady state"):
        steady_state(sx.Model(TWO, [P.Aggregation(), P.Shattering(0.1)]))
    with pytest.raises(InputError, match="kernel: varies in time"):
        finite.collision_moments(TWO, 3, 1.0)


def test_arithmetic():
    one, two = sx.kernels.Constant(), sx.kernels.Additive()
    assert "1 + t" * one == one * "1 + t"
    assert repr(one * "1 + t" + two) == "Constant(scale=1.0) * '1 + t' + Additive(scale=1.0)"
    assert (one + 2 * two) * "t" == one * "t" + (2 * two) * "t"
    assert (one * "1 + t" * "2 - t").in_time[0][0].text == "(1 + t) * (2 - t)"
    assert one * "2" == 2 * one
    assert (one * late).in_time[0][0].functions
    assert ((one * "t" + two * "t") * late).in_time[0][0](0.5) == 0.75
    with pytest.raises(TypeError):
        one * two
    with pytest.raises(TypeError):
        one * [1.0]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("t - 1", "varying = t - 1: is -1 at t = 0; must be a finite number, zero or more"),
        ("1 + s", "unknown name 's'"),
        ("0", "scale = 0.0"),
    ],
)
def test_mistakes(given, words):
    with pytest.raises(InputError) as caught:
        sx.kernels.Additive() * given
    assert words in str(caught.value)


def test_a_factor_that_turns_negative_ends_before_a_run():
    bad = sx.Model(sx.kernels.Constant() + sx.kernels.Additive() * "1 - t")
    with pytest.raises(InputError, match=r"1 - t, is -.* at t = .*; it must not be negative"):
        sx.simulate(bad, [2.0], method=QUICK[1], particles=100, replicas=1)
    with pytest.raises(InputError, match="1 - t"):
        sx.solve(bad, [2.0])
    case = cases.parse(CASE.replace("1 + 0.1*t", "1 - 2*t"))
    (told,) = negative_rates(case)
    assert "the rate of aggregation, 1 - 2*t, is -" in told


CASE = """
[[kernel.terms]]
name = "brownian"
temperature = "298 K"
viscosity = "0.89 mPa s"
varying = "1 + 0.1*t"

[[kernel.terms]]
name = "shear"
gradient = "10 1/s"
volume = "520 nm^3"
coefficient = 0.5

[initial]
density = "1e17 1/m^3"

[run]
times = ["1 s"]
"""


def test_case_files():
    case = cases.parse(CASE)
    brownian = sx.kernels.Brownian.continuum(temperature=298.0, viscosity=0.89e-3)
    shear = sx.kernels.Shear.laminar(gradient=10.0, volume=520e-27)
    assert case.model.kernel == brownian * "1 + 0.1*t" + Sum((shear,), (0.5,))
    assert cases.parse(case.to_toml()).model == case.model
    alone = cases.parse('[kernel]\nformula = "a*i*j"\na = 2\nvarying = "t"\n[run]\ntimes = [1]\n')
    assert alone.model.kernel == sx.kernels.formula("a*i*j", a=2) * "t"
    assert cases.parse(alone.to_toml()) == alone
    for old, new, words in (
        ('"1 + 0.1*t"', '"1 + s"', "line 6: varying"),
        ('"1 + 0.1*t"', "[1]", "kernel.terms[0].varying = [1]: must be a number or a formula in t"),
    ):
        with pytest.raises(InputError) as caught:
            cases.parse(CASE.replace(old, new))
        assert words in str(caught.value)


def test_plain_data_and_back():
    kernel = sx.kernels.Constant() * "1 + t" + 2 * (sx.kernels.formula("i*j") * "exp(-t)")
    assert from_dict(kernel.to_dict()) == kernel
    ds = sx.solve(sx.Model(kernel), [0.1])
    assert model_of(ds) == sx.Model(kernel)
    assert model_of(sx.solve(sx.Model(law()), [0.1])) is None  # a Python function
