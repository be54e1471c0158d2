"""Every weighting with every method: exact laws of small systems, means of large ones, bias.

All weights are powers of the size, which are data: the power one is mass flow, the power zero
direct simulation. So each method has one compiled loop here, with single particles that evaporate.
"""

from __future__ import annotations

from typing import Any

import chains
import laws
import numpy as np
import pytest

import smolux as sx
from shared import QUICK, extinction
from smolux.errors import InputError
from smolux.stochastic.make_plan import make_plan
from smolux.stochastic.rates import rates_for

METHODS = [method.name for method in sx.methods.METHODS]
#: the law of `MassFlow`, which is compiled without a power; see `test_processes`
MASS_FLOW = sx.weighting.WeightFunction(1.0)


def power(q: float) -> Any:
    return sx.weighting.WeightFunction(q)


def model(
    law: str, shattering: float = 0.0, evaporation: float = 0.0, initial: Any = None
) -> sx.Model:
    """Make a model whose rates are data."""
    p = sx.processes
    processes = [p.Aggregation(), p.Shattering(shattering), p.Evaporation(evaporation)]
    return sx.Model(laws.kernel(law), processes, initial or sx.initial.monodisperse())


every_method = pytest.mark.parametrize(
    "method",
    [pytest.param(m, marks=() if m in QUICK else pytest.mark.slow) for m in METHODS],
)


# --- small systems -------------------------------------------------------------------------------

#: power, rates of shattering and of evaporation, events that are followed
CHAINS = [
    (0.0, 0.1, 0.7, 7),
    (0.5, 0.3, 0.0, 5),
    (1.0, 0.3, 0.7, 6),
    (1.25, 0.0, 0.0, 4),
    (-0.5, 0.1, 0.0, 4),
]


@pytest.fixture(scope="module")
def expected() -> dict[float, Any]:
    """States of three simulated particles and their probabilities, by the power."""

    def solved(q: float, shattering: float, evaporation: float, depth: int) -> Any:
        def kernel(i: int, j: int) -> float:
            return 1.0 + 0.5 * (i + j) + 0.25 * i * j

        def weight(size: int) -> float:
            return float(size) ** q

        moves = chains.pairs(kernel, weight, 3.0, shattering)
        moves = chains.both(moves, chains.evaporation(evaporation, weight))
        return chains.law((1, 1, 1), moves, (0.3,), depth)

    return {case[0]: solved(*case) for case in CHAINS}


def states(ds: Any, weighting: Any, sizes: int) -> list[tuple[int, ...]]:
    """Simulated sizes of each replica at the last time; sizes beyond are left out."""
    weight = weighting.weights(np.arange(1, sizes + 1))
    counts = np.rint(ds["n"].values[:, -1] * weight * ds["volume"].values[:, -1:]).astype(int)
    return [tuple(np.repeat(np.arange(1, sizes + 1), row).tolist()) for row in counts]


#: means are held to the law by every power and quick method below
QUICK_CHAINS = {
    *(("acceptance-rejection", chain) for chain in CHAINS),
    *(("size-class", chain) for chain in CHAINS[:2]),
}


@extinction
@pytest.mark.parametrize(
    ("method", "q", "shattering", "evaporation", "depth"),
    [
        pytest.param(m, *chain, marks=() if (m, chain) in QUICK_CHAINS else pytest.mark.slow)
        for m in METHODS
        for chain in CHAINS
    ],
)
def test_whole_distribution(
    method: str, q: float, shattering: float, evaporation: float, depth: int, expected: Any
) -> None:
    """Three monomers at the start: all states against the Markov chain."""
    replicas = 3000
    weighting = MASS_FLOW if q == 1.0 else power(q)
    ds = sx.simulate(
        model("bilinear", shattering, evaporation), [0.3], method=method, weighting=weighting,
        particles=3, population="fixed-volume", replicas=replicas, seed=31, sizes=40,
    )  # fmt: skip
    place, p = expected[q]
    observed = np.zeros(p.shape[1])
    for state in states(ds, weighting, 40):
        observed[place.get(state, -1)] += 1
    assert laws.chi_square(observed, replicas * p[0]) > laws.RARE


# --- large ones ----------------------------------------------------------------------------------


@pytest.mark.parametrize("weighting", [MASS_FLOW, power(0.5), power(-0.3)], ids=repr)
@every_method
def test_means(method: str, weighting: Any) -> None:
    """Moments and densities of the additive kernel, counted by themselves and in bins."""
    times, replicas = np.array([0.5, 1.5]), 24
    ds = sx.simulate(
        model("additive"), times, method=method, weighting=weighting, particles=1000,
        replicas=replicas, seed=32, sizes=8,
    )  # fmt: skip
    truth = laws.solution("additive")
    laws.agree(ds["moment"].sel(order=0).values, truth.moment(times, 0), 0)
    # with few large particles, a few of a hundred replicas hold most of the late moment
    sound = 1 if weighting == power(-0.3) else 2
    second = ds["moment"].sel(order=2).values[:, :sound]
    laws.agree(second, truth.moment(times, 2)[:sound], 2)
    laws.agree(ds["number_density"].values, truth.moment(times, 0), "number")
    for size in (1, 2, 5):
        laws.agree(ds["n"].sel(size=size).values, truth.densities(times, [size])[:, 0], size)
    beyond = truth.densities(times, np.arange(1, 9)).sum(axis=1)
    laws.agree(ds["n_bin"].sum("bin").values, truth.moment(times, 0) - beyond, "bins")


@every_method
def test_mass_flow_keeps_number_and_mass(method: str) -> None:
    ds = sx.simulate(
        model("bilinear", 0.05, 0.2), [0.5, 2.0], method=method, weighting=MASS_FLOW,
        particles=500, replicas=4, seed=33,
    )  # fmt: skip
    assert (ds["particles"] == 500).all()
    np.testing.assert_allclose(ds["moment"].sel(order=1), 1.0, rtol=1e-12)
    assert (ds["collisions"][:, -1] > 500).all()


@pytest.mark.parametrize("weighting", [MASS_FLOW, power(0.5)], ids=repr)
def test_start_with_many_sizes(weighting: Any) -> None:
    """Simulated particles are drawn by number times weight; a law with a tail, and listed sizes."""
    for initial in (sx.initial.exponential(5.0, 2.0), sx.initial.from_sizes({1: 0.5, 1000: 0.01})):
        ds = sx.simulate(
            model("additive", initial=initial), [0.0, 1e-9], method="acceptance-rejection",
            weighting=weighting, particles=20_000, replicas=4, seed=34,
        )  # fmt: skip
        k = np.arange(1.0, initial.largest + 1.0)
        n = initial.densities(initial.largest)
        for order in range(3):
            found = ds["moment"].sel(order=order, time=0.0).mean()
            assert float(found) == pytest.approx(n @ k**order, rel=2e-3)


# --- the bias of finite systems ------------------------------------------------------------------


def second_moment(q: float, particles: int, end: float, together: bool = True) -> float:
    """Mean of ``sum_k k^2 n_k`` for the constant kernel, to the order 1/N.

    One uniform number decides `together` which of a pair stays, or one for each. The chance mass
    ``M = sum x_l`` with ``x = l / w(l)`` is a martingale, and ``d E[m2]/dt`` is ``E[M^2]`` without
    the pairs of a particle with itself.
    """
    truth = laws.KNOWN["constant"]
    solution = sx.exact.solution(sx.Model(truth))
    assert solution is not None
    sizes = np.arange(1, 401)
    i, j = sizes[:, None] * 1.0, sizes[None, :] * 1.0
    x = sizes ** (1.0 - q)
    w = (i**q, j**q, (i + j) ** q)
    top = np.maximum(np.maximum(w[0], w[1]), w[2])
    stay = 1.0 - w[0] / top, 1.0 - w[1] / top
    both = np.maximum(stay[0] + stay[1] - 1.0, 0.0) if together else stay[0] * stay[1]
    made = (i + j) ** (1.0 - q)
    spread = (
        both * made**2
        + (stay[0] - both) * (made - x[None, :]) ** 2
        + (stay[1] - both) * (made - x[:, None]) ** 2
        + (1.0 - stay[0] - stay[1] + both) * (made - x[:, None] - x[None, :]) ** 2
    )
    rate = top / (w[0] * w[1])  # per pair of simulated particles
    times = np.linspace(0.0, end, 201)
    grown, itself = np.zeros(201), np.zeros(201)
    for k, t in enumerate(times):
        z = solution.densities(np.array([t]), sizes)[0] * sizes**q
        grown[k] = 0.5 * z @ (rate * spread) @ z
        itself[k] = z @ x**2
    variance = np.concatenate(([0.0], np.cumsum(0.5 * (grown[1:] + grown[:-1])))) * times[1]
    return float(1.0 + end + np.trapezoid(variance - itself, times) / particles)


@pytest.mark.parametrize(("q", "particles"), [(0.5, 190), (1.0, 64), (1.25, 110)])
def test_bias_of_the_second_moment(q: float, particles: int) -> None:
    """The constant kernel at t = 20 with the N of Kolodko and Sabelfeld, Table 4.10.

    With the factor ``W_max = 2**(q - 1)`` that the paper has in the rate they would be about -28 %
    and +18 %. The values known without it, -0.7 % and +0.6 %, are for one uniform number each.
    """
    mean = second_moment(q, particles, 20.0)
    known = {0.5: (-0.7, False), 1.0: (-1.488, True), 1.25: (0.6, False)}[q]
    assert 100 * (second_moment(q, particles, 20.0, known[1]) / 21 - 1) == pytest.approx(
        known[0], abs=0.15
    )
    weighting = MASS_FLOW if q == 1.0 else power(q)
    ds = sx.simulate(
        model("constant"), [20.0], method="acceptance-rejection", weighting=weighting,
        population="fixed-volume", particles=particles, replicas=1000, seed=35, orders=(2,),
        sizes=8,
    )  # fmt: skip
    laws.agree(ds["moment"].sel(order=2).values, mean)
    if q == 1.0:  # exactly, for any N
        assert mean == pytest.approx(1 + 20 * 63 / 64, rel=1e-4)


# --- bounds, majorants, functions, mistakes ------------------------------------------------------


def bent(size: float) -> float:
    """A weight that intervals do not follow."""
    return 1.0 if size < 10.0 else 0.1 * size


def smooth(size: float) -> float:
    return 2.0 + size**0.3


WEIGHTS = [0.5, 1.0, 1.25, -0.5, "1 + l/100", "1/(1 + l)", smooth, bent]


@pytest.mark.parametrize("weight", WEIGHTS, ids=lambda w: getattr(w, "__name__", str(w)))
def test_bounds_and_majorants(weight: Any) -> None:
    rng = np.random.default_rng(5)
    low = np.floor(2 ** rng.uniform(0, 12, (2, 60)))
    high = np.floor(low * 2 ** rng.uniform(0, 4, (2, 60)))
    box = low[0], high[0], low[1], high[1]
    i, j = np.linspace(*box[:2], 20)[:, None], np.linspace(*box[2:], 20)[None]
    for kernel in (sx.kernels.Additive(), sx.kernels.Ballistic(), laws.kernel("bilinear")):
        weighting = sx.weighting.WeightFunction(weight)
        rates = rates_for(sx.Model(kernel), weighting)
        w = [weighting.weights(x) for x in (i, j, i + j)]
        exact = kernel(i, j) * np.maximum(np.maximum(w[0], w[1]), w[2]) / (w[0] * w[1])
        np.testing.assert_allclose(rates.arrays(i, j), exact, rtol=1e-13)
        lower, upper = rates.bounds(*box)
        assert rates.rigorous == (weight is not bent)
        assert (lower <= exact).all()
        assert (exact <= upper).all()
        assert (upper <= (1.04 if rates.rigorous else 1.25) * exact.max(axis=(0, 1))).all()
        if rates.majorant is not None:
            share = exact / rates.majorant(i, j)
            assert share.max() <= 1 + 1e-12
            assert share.min() >= rates.majorant.least * (1 - 1e-12)


@pytest.mark.parametrize("weighting", sx.weighting.WEIGHTINGS, ids=lambda kind: kind.name)
def test_short_forms_are_the_definition(weighting: Any) -> None:
    """What each weighting says of its rate and bounds is what its weight says."""
    made = weighting()
    i, j = np.array([1.0, 3.0, 7.0, 250.0])[:, None], np.array([1.0, 2.0, 31.0, 4000.0])
    one, two, both = made.weights(i), made.weights(j), made.weights(i + j)
    exact = np.maximum(np.maximum(one, two), both) / (one * two)
    rates = rates_for(sx.Model(sx.kernels.Constant(3.0)), made)
    np.testing.assert_allclose(rates.arrays(i, j), 3.0 * exact, rtol=1e-13)
    lower, upper = rates.bounds(i, 2.0 * i, j, 2.0 * j)
    corners = [rates.arrays(a, b) for a in (i, 2.0 * i) for b in (j, 2.0 * j)]
    np.testing.assert_allclose(lower, np.min(corners, axis=0), rtol=1e-12)
    np.testing.assert_allclose(upper, np.max(corners, axis=0), rtol=1e-12)
    assert rates.majorant is not None
    share = rates.arrays(i, j) / rates.majorant(i, j)
    assert share.max() <= 1 + 1e-12
    assert share.min() >= rates.majorant.least * (1 - 1e-12)


def test_a_weight_that_falls() -> None:
    """It rises up to two merged particles, of sizes far above one, then falls: 1/(1 + t/2)."""
    start = sx.initial.monodisperse(size=3000)
    ds = sx.simulate(
        laws.model("constant", initial=start), [5.0], method="acceptance-rejection",
        weighting=sx.weighting.WeightFunction("(l/3000)**3 / (1 + (l/6500)**8)"), particles=1000,
        replicas=32, seed=37, sizes=1, bins_per_octave=1,
    )  # fmt: skip
    laws.agree(ds["number_density"].values[:, 0], 2.0 / 7.0)
    laws.agree(ds["moment"].sel(order=1).values, 3000.0)


@pytest.mark.slow
def test_a_function_as_weight() -> None:
    """One that is neither a power nor followed by intervals, in the loop."""
    ds = sx.simulate(
        laws.model("additive"), [1.0], method="acceptance-rejection",
        weighting=sx.weighting.WeightFunction(bent), particles=1000, replicas=24, seed=36,
    )  # fmt: skip
    truth = laws.solution("additive")
    for order in (0, 1, 2):
        laws.agree(ds["moment"].sel(order=order).values, truth.moment(np.array([1.0]), order))


def test_mistakes() -> None:
    for wrong in (None, "l -", "0*l", "l - 50", 9.0, np.nan, [1.0], lambda size: -1.0):
        with pytest.raises(InputError, match="weight function"):
            sx.weighting.WeightFunction(wrong)
    huge = sx.Model(sx.kernels.Constant(), initial=sx.initial.lognormal(1e7, 2.0))
    with pytest.raises(InputError, match="initial sizes go to"):
        sx.simulate(huge, [1.0], weighting="mass-flow", particles=100)


def test_choice_of_a_method() -> None:
    """The estimate of the cost is that of the weighted rates."""
    model = sx.Model(sx.kernels.Constant(), initial=sx.initial.monodisperse(2.0))
    found = {
        name: make_plan(
            model,
            [20.0],
            method="auto",
            weighting=name,
            particles=100_000,
            replicas=1,
            seed=1,
            orders=(0,),
            sizes=8,
        )
        for name in ("number", "mass-flow")
    }
    assert found["number"].method.name == "acceptance-rejection"
    assert found["mass-flow"].method.name != "acceptance-rejection"
