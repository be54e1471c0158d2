"""Shares of encounters that depend on the pair: exact chains, and the kernel times the share."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.linalg import expm
from tests.shared import FORMULA, QUICK, extinction

import smolux as sx
from smolux import case as cases
from smolux.analysis.reference import model_of
from smolux.deterministic.steady import steady_state
from smolux.errors import InputError
from smolux.exact.find import solution
from smolux.processes import base

P = sx.processes
SHARE = "1/(1 + c*(i + j))"
#: the choice by a share is the loop's and not the method's: one method is quick to compile
METHODS = [
    pytest.param(m.name, marks=[] if m.name == QUICK[1] else pytest.mark.slow)
    for m in sx.methods.METHODS
]


def share(c: float) -> sx.kernels.Kernel:
    return sx.kernels.formula(SHARE, c=c)


def kernel(c0: float, c1: float = 0.0) -> sx.kernels.Kernel:
    return sx.kernels.formula(FORMULA, c0=c0, c1=c1, c2=0.0, c3=0.0)


def both(stick: float, shatter: float, rate: float, law=None, initial=None) -> sx.Model:
    """Make a model in which two processes have shares of their own."""
    processes = [P.Aggregation(share=share(stick)), P.Shattering(rate, share=share(shatter))]
    return sx.Model(law or kernel(1.0, 0.5), processes, initial or sx.initial.monodisperse())


def deviation(ds, name, expected, **at):
    """Return by how many standard errors a mean differs."""
    values = ds[name].sel(**at) if at else ds[name]
    mean, error = values.mean("replica"), values.std("replica", ddof=1) / len(ds.replica) ** 0.5
    return np.abs((mean - expected) / error).values


@pytest.mark.parametrize("method", METHODS)
def test_two_processes_with_shares_follow_the_rate_equations(method):
    """Bias 1/particles, a tenth of a standard error."""
    model = both(0.3, 0.05, 0.4, initial=sx.initial.from_sizes({1: 1.5, 3: 0.5}))
    given = {"particles": 2000, "replicas": 40, "seed": 11, "sizes": 16}
    ds = sx.simulate(model, [0.5, 1.5], method=method, **given)
    exact = sx.solve(model, [0.5, 1.5], sizes=16)
    assert exact.attrs["operator"] in ("direct", "low-rank")
    for at in (0, 1):
        expected = exact.isel(time=at, replica=0)
        found = ds.isel(time=at)
        assert deviation(found, "number_density", expected["number_density"]) < 4
        assert deviation(found, "moment", expected["moment"].sel(order=2), order=2) < 4
        assert (deviation(found, "n", expected["n"].sel(size=[1, 3, 4]), size=[1, 3, 4]) < 4).all()
        # shattering without its share would be counted twice as often
        events = found["events"] / found["volume"]
        of = events.mean("replica") - expected["events"]
        assert (np.abs(of) < 4 * events.std("replica", ddof=1) / 40**0.5).all()
    np.testing.assert_array_equal(ds["moment"].sel(order=1), ds["moment"].sel(order=1)[0, 0])


@extinction
@pytest.mark.parametrize("method", METHODS)
def test_three_monomers(method):
    """The chain of 3, 2 and 1 particles, and back by shattering of a pair of sizes 1 and 2."""
    stick, shatter, rate, density, t = 0.7, 0.2, 1.5, 2.5, 1.1
    initial = sx.initial.monodisperse(density)
    ds = sx.simulate(
        both(stick, shatter, rate, kernel(1.0), initial), [t], method=method, particles=3,
        population="fixed-volume", replicas=6000, seed=3, sizes=3,
    )  # fmt: skip
    volume = 3 / density
    s, q = (lambda size, c=c: 1 / (1 + c * size) for c in (stick, shatter))
    chain = np.zeros((3, 3))  # from, to
    chain[0, 1] = 3 * s(2) / volume
    chain[1, 2] = s(3) / volume
    chain[1, 0] = rate * q(3) / volume
    chain -= np.diag(chain.sum(axis=1))
    expected = expm(chain * t)[0]
    found = np.array([float((ds["particles"] == n).mean()) for n in (3, 2, 1)])
    assert (np.abs(found - expected) < 4 * np.sqrt(expected * (1 - expected) / 6000)).all()


def test_one_process_is_the_kernel_times_its_share():
    times = [0.5, 3.0]
    model = sx.Model(kernel(1.0), P.Aggregation(share=SHARE.replace("c*", "0.5*")))
    other = sx.Model(sx.kernels.formula(SHARE, c=0.5))
    assert not model.plain_aggregation
    assert solution(model) is None
    one, two = (sx.solve(m, times, tolerance=1e-9) for m in (model, other))
    np.testing.assert_allclose(one["moment"], two["moment"], rtol=1e-8)
    given = {"method": "acceptance-rejection", "particles": 300, "replicas": 20, "seed": 5}
    ds = sx.simulate(model, times, **given)
    assert (deviation(ds, "number_density", one["number_density"][0]) < 4).all()
    assert json.loads(ds.attrs["model"])["processes"][0]["share"] == model.processes[0].share
    assert model_of(ds) == model


def test_a_share_that_is_a_number_leaves_the_exact_solution():
    model = sx.Model(sx.kernels.Constant(2.0), P.Aggregation(share=0.25))
    known = solution(model)
    assert known is not None
    assert known.moment([4.0], 0)[0] == pytest.approx(1 / (1 + 2.0 * 0.25 * 4.0 / 2))
    ds = sx.solve(model, [4.0])
    assert float(ds["number_density"][0, 0]) == pytest.approx(0.5, rel=1e-7)
    gel = sx.Model(sx.kernels.Multiplicative(), P.Aggregation(share=0.25))
    assert gel.reduced.kernel.gel_time() == 4.0
    with pytest.raises(InputError, match="nothing would ever happen"):
        sx.Model(sx.kernels.Constant(), P.Aggregation(share=0.0))


@pytest.mark.parametrize("method", ["direct", "low-rank"])
def test_the_rate_equations_have_a_sum_for_each_share(method):
    """Two shares that are the same in two ways of writing, which the solver cannot know."""
    one, two = P.Aggregation(share="1/(1 + 0.2*(i + j))"), P.Shattering(0.3, share="5/(5 + i + j)")
    initial = sx.initial.from_sizes({2: 0.8, 3: 0.4})
    model = sx.Model(sx.kernels.Additive(), [one, two], initial)
    law = sx.kernels.formula("(i + j)*5/(5 + i + j)")
    plain = sx.Model(law, [P.Aggregation(), P.Shattering(0.3)], initial)
    given = {"times": [1.0, 20.0], "method": method, "tolerance": 1e-9}
    found, expected = sx.solve(model, **given), sx.solve(plain, **given)
    np.testing.assert_allclose(found["moment"], expected["moment"], rtol=2e-8)
    np.testing.assert_allclose(found["events"], expected["events"], rtol=2e-8)


@pytest.mark.filterwarnings("default:from t = 3 on mass lies beyond:smolux.errors.SmoluxWarning")
def test_a_gel_reacts_by_every_share():
    """Two aggregations, a quarter and a half of the encounters: three quarters together."""
    two = [P.Aggregation(share=0.25), P.Aggregation(share="0.5 + 0*i*j", label="more")]
    model = sx.Model(sx.kernels.Multiplicative(), two)
    given = {"times": [0.5, 3.0], "gel": "reacts", "orders": [0, 1], "window": 500}
    ds = sx.solve(model, **given)
    expected = sx.solve(sx.Model(sx.kernels.Multiplicative(0.75)), **given)
    np.testing.assert_allclose(ds["moment"], expected["moment"], rtol=1e-6)
    events = ds["events"][0, 1].values
    assert events[0] == pytest.approx(events[1] / 2, rel=1e-6)


def test_steady_states_with_shares():
    share = P.Shattering(0.2, share="5/(5 + i + j)")
    one = steady_state(
        sx.Model(sx.kernels.Constant(), [P.Aggregation(share="1/(1 + 0.2*(i + j))"), share])
    )
    law = sx.kernels.formula("1/(1 + 0.2*(i + j))")
    two = steady_state(sx.Model(law, [P.Aggregation(), P.Shattering(0.2)]))
    assert one.moment(0.0) == pytest.approx(two.moment(0.0), rel=1e-8)
    assert one.moment(2.0) == pytest.approx(two.moment(2.0), rel=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("weighting", ["mass-flow", sx.weighting.WeightFunction(0.5)])
def test_shares_with_every_weighting(weighting):
    model = both(0.3, 0.05, 0.4)
    given = {"method": "size-class", "particles": 2000, "replicas": 40, "seed": 2}
    ds = sx.simulate(model, [1.5], weighting=weighting, **given)
    exact = sx.solve(model, [1.5])
    assert (deviation(ds, "moment", exact["moment"][0], order=[0, 2]) < 4).all()


def odd(i, j):
    """A share that is none for one pair only, which no sample holds."""
    return 2.0 if abs(i * j - 437.0) < 0.5 and i + j < 43.0 else 0.9


@pytest.mark.slow
def test_a_share_above_one_ends_a_run_with_the_pair():
    model = sx.Model(kernel(1.0), P.Aggregation(share=odd))
    for call, given in (
        (sx.simulate, {"particles": 3000, "replicas": 1, "seed": 1, "method": QUICK[1]}),
        (sx.solve, {}),
    ):
        with pytest.raises(InputError, match=r"sizes (19 and 23|23 and 19)|\((19, 23|23, 19)\)"):
            call(model, [40.0], **given)


def test_a_share_above_one_beside_others_ends_a_run_with_the_pair(monkeypatch):
    """What a sample would have found, had it been asked."""
    monkeypatch.setattr(base, "share_law", lambda given, what: given)
    model = both(-0.01, 0.05, 0.4)
    given = {"particles": 300, "replicas": 1, "seed": 1, "method": QUICK[1]}
    with pytest.raises(InputError, match=r"the share of aggregation, .* is 1.02041 for"):
        sx.simulate(model, [1.0], **given)
    with pytest.raises(InputError, match=r"K\(1, 1\)"):
        sx.solve(model, [1.0])


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("(i + j)/100", "is 1.28 for the sizes 64 and 64; a share is between 0 and 1"),
        (-0.1, "must be a finite number, zero or more"),
        (1.5, "is 1.5 for the sizes 1 and 1"),
        ("i - j", "negative"),
        ("1/i", "not symmetric"),
        ("k", "unknown name 'k'"),
        ([1.0], "must be a number, a formula in i and j, a function of two sizes or a kernel"),
    ],
)
@pytest.mark.parametrize("make", [P.Aggregation, lambda share: P.Shattering(0.1, share=share)])
def test_what_is_no_share(make, given, words):
    with pytest.raises(InputError) as caught:
        make(share=given)
    assert any(words in text for text in caught.value.problems), caught.value
    assert "the share of" in str(caught.value)
    assert {p.path for p in caught.value.problems} == {("share",)}


def test_shares_in_case_files():
    text = (
        '[kernel]\nname = "constant"\n[[processes]]\nname = "aggregation"\n'
        'share = "exp(-(i + j)/100)"\n[[processes]]\nname = "collisional-fragmentation"\n'
        "rate = 0.1\ndebris = 1.5\nshare = 0.5\n[run]\ntimes = [1]\n"
    )
    case = cases.parse(text)
    assert cases.parse(case.to_toml()) == case
    assert case.model.processes[0] == P.Aggregation(share="exp(-(i + j)/100)")
    with pytest.raises(InputError, match="line 5: the share of aggregation"):
        cases.parse(text.replace('"exp(-(i + j)/100)"', '"i + j"'))
