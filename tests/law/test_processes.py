"""Processes beside encounters: against exact solutions, reference values and each other.

One model holds all processes, so that each method has one compiled loop for all powers of the size
as weight; what is not wanted has a rate of next to nothing. Small systems with evaporation are in
`test_weightings`.
"""

from __future__ import annotations

import csv
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import laws
import numpy as np
import pytest
from scipy import integrate, linalg, stats

import smolux as sx
from shared import FORMULA, extinction, laborious
from smolux import case as cases
from smolux.deterministic import steady_state
from smolux.errors import InputError
from smolux.model_dict import model_from_dict, model_to_dict
from smolux.processes.disruption import fragments

DATA = Path(__file__).parent.parent / "reference" / "data"
P = sx.processes
FREE_MOLECULAR = sx.kernels.Ballistic(scale=1 / (4 * np.sqrt(2)))


def everything(
    evaporation: Any = 0.0, fragmentation: float = 1e-300, by_size: float = 0.0,
    removal: Any = 0.0, above: int = 10**9, source: float = 1e-300, disruption: float = 0.0,
    initial: Any = None,
) -> sx.Model:  # fmt: skip
    """Make a model of all processes but shattering, those of which the rate varies among them.

    Rates by size are lists, and that of fragmentation is ``fragmentation + by_size * (i + j)``, so
    that all of them are data.
    """
    processes = [
        P.Source({1: source, 3: 0.2 * source}, varying="1 + 0.5 * sin(3 * t)"),
        P.Removal(_listed(removal), above=above),
        P.Fragmentation(sx.kernels.formula("f + g*(i + j)", f=fragmentation, g=by_size)),
        P.Evaporation(_listed(evaporation), varying="1 + sin(5 * t)"),
        P.Aggregation(),
        P.CollisionalFragmentation(disruption, 2.5, largest=12),
    ]
    return sx.Model(laws.kernel("constant"), processes, initial or sx.initial.monodisperse())


def _listed(rate: Any) -> list[float]:
    """Return the rates of the sizes 1, 2, ... by a number or a function."""
    sizes = np.arange(1.0, 401.0)
    return (rate(sizes) if callable(rate) else np.full(2, rate)).tolist()


def simulated(model: sx.Model, times: Any, seed: int, **settings: Any) -> Any:
    given = {"method": "acceptance-rejection", "particles": 1000, "replicas": 24} | settings
    return sx.simulate(model, times, seed=seed, sizes=8, **given)


def observed(ds: Any, t: float, sizes: slice) -> float:
    return float(ds["n"].sel(time=t).isel(replica=0, size=sizes).sum())


# --- simulation against the solver, and the balance of mass ---------------------------------------

TIMES = (0.7, 3.0)
CASES = {
    "evaporation": {"evaporation": 0.5},
    "fragmentation": {"fragmentation": 0.2},
    "removal": {"removal": 0.3},
    "source": {"source": 1.0, "initial": sx.initial.empty()},
    "source and sink": {"source": 1.0, "above": 20, "initial": sx.initial.empty()},
    "collisional fragmentation": {"disruption": 0.8},
    "source-and-doubling": {"source": 0.05, "removal": 0.2},
    "all": {
        "evaporation": 0.5, "fragmentation": 0.2, "removal": 0.1, "above": 50, "source": 1.0,
        "disruption": 0.1,
    },
}  # fmt: skip


@lru_cache
def solved(case: str) -> Any:
    return sx.solve(everything(**CASES[case]), TIMES)


def agree(ds: Any, truth: Any, case: str) -> None:
    """Moments, densities of some sizes, and the mass that comes and goes."""
    for order in (0, 1, 2):
        values, expected = (x["moment"].sel(order=order).values for x in (ds, truth))
        if order == 1 and values.std() < 1e-12:
            np.testing.assert_allclose(values, np.broadcast_to(expected, values.shape), rtol=1e-8)
            continue
        laws.agree(values, expected[0], (case, order))
    for size in (1, 2, 5):
        laws.agree(ds["n"].sel(size=size).values, truth["n"].sel(size=size).values[0], (case, size))
    for name in ("mass_in", "mass_out"):
        moved = (ds[name] / ds["volume"]).values[:, 1]
        if moved.std() > 0:
            laws.agree(moved, truth[name].values[0, 1], (case, name))
    assert ds.attrs["warnings"] == "[]"


@pytest.mark.parametrize("case", CASES)
def test_simulation_and_solver(case: str) -> None:
    model, truth = everything(**CASES[case]), solved(case)
    assert [p.name for p in model.processes] == [
        "aggregation", "collisional-fragmentation", "removal", "fragmentation", "evaporation",
        "source",
    ]  # fmt: skip
    ds = simulated(model, TIMES, 41)
    agree(ds, truth, case)
    # events of each process, where the volume stays the same
    if float(ds["volume"].max()) == float(ds["volume"].min()):
        found = ds["events"].values / ds["volume"].values[..., None]
        seen = found.std(axis=0).min(axis=0) > 0
        seen[2] &= "above" not in CASES[case]  # the solver does not count what passes the limit
        laws.agree(found[..., seen], truth["events"].values[0][:, seen], "events")
    total = ds["mass"] - ds["mass_in"] + ds["mass_out"]
    start = 0 if "initial" in CASES[case] else 1000
    np.testing.assert_array_equal(total, start * ds["volume"] / ds["volume"][0, 0].item())
    np.testing.assert_array_equal(ds["mass"], np.rint(ds["mass"]))
    balance = truth["mass"] - truth["mass_in"] + truth["mass_out"]
    np.testing.assert_allclose(balance, start / 1000, atol=1e-7)
    t, source = truth["time"].values, CASES[case].get("source", 0.0)
    come = 1.6 * source * (t + (1.0 - np.cos(3.0 * t)) / 6.0)  # sizes 1 and 3, at 1 : 0.2
    np.testing.assert_allclose(truth["mass_in"].values[0], come, rtol=1e-6, atol=1e-9)
    assert np.isnan(ds["extinction_time"]).all()


#: methods and weightings that are compiled and run always; the power one is mass flow
QUICK = {
    ("acceptance-rejection", "0.5"),
    ("acceptance-rejection", "1"),
    ("acceptance-rejection", "-0.3"),
}


def every_pair() -> list[Any]:
    """All methods with all weightings but the one of `test_simulation_and_solver`."""
    pairs = [(m.name, w) for m in sx.methods.METHODS for w in ("0.5", "1", "-0.3", "number",
                                                               "mass-flow")]  # fmt: skip
    return [
        pytest.param(*pair, marks=() if pair in QUICK else pytest.mark.slow)
        for pair in pairs
        if pair != ("acceptance-rejection", "number")
    ]


@pytest.mark.parametrize(("method", "weighting"), every_pair())
def test_every_method_and_weighting(method: str, weighting: str) -> None:
    """Each process alone and all together, against the solver."""
    named = weighting in ("number", "mass-flow")
    what: Any = weighting if named else sx.weighting.WeightFunction(float(weighting))
    for k, case in enumerate(CASES):
        ds = simulated(everything(**CASES[case]), TIMES, 60 + k, method=method, weighting=what)
        agree(ds, solved(case), case)
        if weighting in ("number", "1", "mass-flow"):  # mass is exact, with others on average
            total = (ds["mass"] - ds["mass_in"] + ds["mass_out"]) / ds["volume"]
            start = 0.0 if "initial" in CASES[case] else 1.0
            np.testing.assert_allclose(total, start, atol=1e-9)


# --- rates that depend on the size, starts in which nothing is one --------------------------------

#: second moments at t = 4 from monomers
BY_SIZE = {
    "removal": ({"removal": lambda k: 0.1 * k}, 1.157),
    "fragmentation": ({"by_size": 0.1}, 2.946),
}
QUICK_METHODS = [
    pytest.param(m.name, marks=() if m.name == "acceptance-rejection" else pytest.mark.slow)
    for m in sx.methods.METHODS
]
every_method = pytest.mark.parametrize("method", QUICK_METHODS)


@pytest.mark.parametrize("case", BY_SIZE)
@every_method
def test_rates_that_depend_on_the_size(method: str, case: str) -> None:
    given, second = BY_SIZE[case]
    model = everything(**given)
    truth = sx.solve(model, [1.0, 4.0])
    assert truth["moment"].sel(order=2, time=4.0).item() == pytest.approx(second, abs=5e-4)
    agree(simulated(model, [1.0, 4.0], 71, method=method), truth, case)


@every_method
def test_all_at_once_from_two_sizes(method: str) -> None:
    """Sizes 3 and 7, at a density of 2.5, as many simulated as fill a volume of 400."""
    model = everything(
        evaporation=lambda k: 0.2 * np.sqrt(k), fragmentation=0.02, by_size=0.01,
        removal=lambda k: 0.3 / k, above=40, source=0.7, disruption=0.1,
        initial=sx.initial.from_sizes({3: 1.5, 7: 1.0}),
    )  # fmt: skip
    truth = sx.solve(model, [0.3, 1.5])
    agree(simulated(model, [0.3, 1.5], 72, method=method), truth, method)
    if method == "acceptance-rejection":
        root = sx.weighting.WeightFunction(0.5)
        agree(simulated(model, [0.3, 1.5], 73, method=method, weighting=root), truth, root)


@laborious
@pytest.mark.parametrize("rates", [(5.0, 0.1), (0.1, 5.0)])
def test_rates_within_a_slot(rates: tuple[float, float]) -> None:
    """Sizes 300 and 301 are counted together, and leave at rates that differ by far."""
    alone = sx.kernels.formula(FORMULA, c0=0.0, c1=0.0, c2=0.0, c3=0.0)
    start = sx.initial.from_sizes({300: 1.5, 301: 1.0})
    model = everything(
        removal=lambda k: np.where(k == 301, rates[1], np.where(k == 300, rates[0], 1.0)),
        initial=start,
    )
    model = replace(model, kernel=alone)
    ds = sx.simulate(
        model, [0.3], method="acceptance-rejection", particles=500, replicas=24, seed=76,
        sizes=301, population="fixed-volume",
    )  # fmt: skip
    for size, density, rate in zip((300, 301), (1.5, 1.0), rates, strict=True):
        laws.agree(ds["n"].sel(size=size).values[:, 0], density * np.exp(-0.3 * rate), size)


@extinction
def test_three_particles_that_leave() -> None:
    """Each by itself: 3/e are left at t = 1, whatever the counts of the last ones are.

    The extinction is when the second has left, and stays that when the last one has, too.
    """
    alone = sx.kernels.formula(FORMULA, c0=0.0, c1=0.0, c2=0.0, c3=0.0)
    model = replace(everything(removal=1.0), kernel=alone)
    ds = simulated(model, [1.0], 73, particles=3, replicas=4000, population="fixed-volume")
    laws.agree(ds["particles"].values[:, 0], 3.0 / np.e)
    laws.agree(ds["mass_out"].values[:, 0], 3.0 - 3.0 / np.e)
    since = ds["extinction_time"].values
    np.testing.assert_array_equal(np.isfinite(since), ds["particles"][:, 0] <= 1)
    found = stats.kstest(since[np.isfinite(since)], lambda t: _second_left(t) / _second_left(1.0))
    assert found.pvalue > laws.RARE


@extinction
def test_what_two_of_different_size_become_leaves() -> None:
    """Sizes 3 and 300 merge at K/V, and 303, counted with 300, leaves at 1.5; they do not."""
    rate, times = 1.5, np.array([1.0, 4.0])
    model = everything(
        removal=lambda k: np.where(k == 303, rate, 0.0),
        initial=sx.initial.from_sizes({3: 0.5, 300: 0.5}),
    )
    given = {"particles": 2, "replicas": 4000, "population": "fixed-volume"}
    ds = simulated(model, times, 77, **given)
    merge = 1.0 / 2.0
    left = (rate * np.exp(-merge * times) - merge * np.exp(-rate * times)) / (rate - merge)
    laws.agree(ds["mass_out"].values, 303.0 * (1.0 - left))


def _second_left(t: Any) -> Any:
    """Probability that of three particles two at least have left, each at the rate 1."""
    left = np.exp(-t)
    return (1.0 - left) ** 2 * (1.0 + 2.0 * left)


@extinction
def test_since_when_one_cluster_is_left() -> None:
    """Two monomers merge at 1/V = 1/2 and the cluster breaks at c: the last time of many counts.

    At the time T there is one cluster since t or before with the probability
    ``(exp(c t) - exp(-t/2)) exp(-c T) / (1 + 2 c)``.
    """
    c, end = 0.25, 20.0
    ds = simulated(
        everything(fragmentation=2.0 * c), [end], 77, particles=2, replicas=4000,
        population="fixed-volume",
    )  # fmt: skip
    assert ds["collisions"].mean() > 2.0

    def one(t: Any) -> Any:
        return (np.exp(c * t) - np.exp(-0.5 * t)) * np.exp(-c * end) / (1.0 + 2.0 * c)

    since = ds["extinction_time"].values
    finite = np.isfinite(since)
    np.testing.assert_array_equal(finite, ds["particles"][:, 0] == 1)
    laws.agree(finite.astype(float), one(end))
    found = stats.kstest(since[finite], lambda t: one(t) / one(end))
    assert found.pvalue > laws.RARE


@extinction
def test_a_size_at_the_limit_stays() -> None:
    """Four monomers merge at 6/V, 3/V and 1/V; a three among them stays, and the four leaves."""
    ds = simulated(
        everything(above=3), [1.0, 80.0], 74, particles=4, replicas=4000,
        population="fixed-volume",
    )  # fmt: skip
    rates = np.array([6.0, 3.0, 1.0]) / 4.0
    others = rates[:, None] / (rates[:, None] - rates + np.diag(rates))
    gone = 1.0 - np.exp(-rates) @ others.prod(axis=0)
    laws.agree(ds["mass_out"].values[:, 0], 4.0 * gone)
    assert (ds["mass_out"].values[:, 1] == 4.0).all()
    assert (ds["particles"].values[:, 1] == 0).all()
    assert (ds["events"].sel(process="aggregation").values[:, 1] == 3).all()
    assert (ds["events"].sel(process="removal").values[:, 1] == 1).all()


def test_sub_volumes_keep_the_balance() -> None:
    """With doublings, and what comes and goes."""
    case = "source-and-doubling"
    model, truth = everything(**CASES[case]), solved(case)
    ds = simulated(model, TIMES, 75, particles=4000, replicas=8, subvolumes=2, remix=0.3)
    assert (ds["volume"].values[:, 1] > 4000.0).all()
    total = ds["mass"] - ds["mass_in"] + ds["mass_out"]
    np.testing.assert_array_equal(total, ds["volume"])
    agree(ds, truth, case)


@extinction
@every_method
def test_sub_volumes_end(method: str) -> None:
    """Of 2000 particles each leaves at the rate 1; one is left since the second to last has."""
    alone = sx.kernels.formula(FORMULA, c0=0.0, c1=0.0, c2=0.0, c3=0.0)
    ds = simulated(
        replace(everything(removal=1.0), kernel=alone), [30.0], 78, particles=2000, replicas=30,
        subvolumes=2, population="fixed-volume", method=method,
    )  # fmt: skip
    assert (ds["particles"] == 0).all()

    def one_left(t: Any) -> Any:
        gone = 1.0 - np.exp(-t)
        return gone**1999 * (gone + 2000.0 * np.exp(-t))

    assert stats.kstest(ds["extinction_time"], one_left).pvalue > laws.RARE


def test_trajectories_do_not_depend_on_the_output_times() -> None:
    model = everything(**CASES["all"])
    few, many = (simulated(model, times, 42, replicas=3, particles=200) for times in
                 ([2.0], [0.01, 0.5, 1.1, 2.0]))  # fmt: skip
    for name in ("n", "events", "mass", "mass_in", "mass_out", "volume"):
        np.testing.assert_array_equal(few[name].sel(time=2.0), many[name].sel(time=2.0))


@extinction
def test_nothing_is_left() -> None:
    """Removal alone: each of the particles vanishes by itself, and nothing comes after the last."""
    ds = simulated(
        everything(removal=1.0), [1.0, 40.0], 43, particles=50, replicas=200,
        population="fixed-volume",
    )  # fmt: skip
    assert (ds["particles"].values[:, 1] == 0).all()
    assert (ds["mass_out"].values[:, 1] == 50).all()
    assert (ds["largest"].values[:, 1] == 0).all()
    laws.agree(ds["mass"].values[:, 0], 50 * np.exp(-1.0))


def test_particles_collide_leave_or_stay() -> None:
    """With the density 2.5: ``M0 = 2.5 q / (1 + 2.5 (1 - q) / 2 r)``, ``q = exp(-r t)``."""
    rate, density = 0.3, 2.5
    model = everything(removal=rate, initial=sx.initial.monodisperse(density))
    given: dict[str, Any] = {"population": "fixed-volume", "orders": (0, 2)}
    ds, truth = simulated(model, TIMES, 44, **given), sx.solve(model, TIMES)
    left = np.exp(-rate * np.array(TIMES))
    number = density * left / (1 + density * (1 - left) / (2 * rate))
    np.testing.assert_allclose(truth["number_density"][0], number, rtol=1e-6)
    gone = density - number - truth["events"].sel(process="removal").values[0]
    np.testing.assert_allclose(truth["collisions"][0], gone, rtol=1e-5)
    volume = 1000 / density
    np.testing.assert_array_equal(ds["volume"], volume)
    removed = ds["events"].sel(process="removal")
    np.testing.assert_array_equal(ds["particles"] + ds["collisions"] + removed, 1000)
    np.testing.assert_array_equal(ds["mass"] + ds["mass_out"], 1000)
    laws.agree(ds["number_density"].values, number)
    laws.agree(ds["collisions"].values / volume, truth["collisions"].values[0])


def test_debris_of_monomers_is_shattering() -> None:
    kernel, times = laws.kernel("constant"), [1.0, 6.0]
    monomers, shattering = (
        sx.Model(kernel, [P.Aggregation(), process])
        for process in (P.CollisionalFragmentation(0.2, [1.0]), P.Shattering(0.2))
    )
    one, other = (sx.solve(m, times)["moment"].values for m in (monomers, shattering))
    np.testing.assert_allclose(one, other, rtol=1e-9)


def test_fragments() -> None:
    """Mean numbers of fragments against draws, and their mass."""
    process = P.CollisionalFragmentation(1.0, 2.5, largest=6)
    mean = fragments(tuple(process.shares), 20)
    np.testing.assert_allclose(mean @ np.arange(1, 7), np.arange(1, 21), rtol=1e-12)
    draw = type(process).outcome(lambda rng: rng.random())
    rng, sizes, counts = np.random.default_rng(5), *np.zeros((2, 6), np.int64)
    found = np.zeros((4000, 6))
    for row in found:
        made = draw(7, 4, sizes, counts, rng, *process.parameters)
        row[sizes[:made] - 1] = counts[:made]
    assert (found @ np.arange(1, 7) == 11).all()
    laws.agree(found, mean[10])


# --- the solver against exact solutions -----------------------------------------------------------


def test_random_scission() -> None:
    """Blatz and Tobolsky: geometric at all times, ``p' = (1 - p)^2/2 - F p/2``."""
    times, rate = [1.0, 5.0, 40.0], 0.2
    found = integrate.solve_ivp(
        lambda t, p: 0.5 * (1 - p) ** 2 - 0.5 * rate * p, (0, 40), [0.0], t_eval=times,
        rtol=1e-12, atol=1e-14,
    )  # fmt: skip
    p = found.y[0]
    for law in (f"{rate} + 0*i*j", rate):
        model = sx.Model(sx.kernels.Constant(), [P.Aggregation(), P.Fragmentation(law)])
        ds = sx.solve(model, times)
        np.testing.assert_allclose(ds["number_density"][0], 1 - p, rtol=1e-7)
        np.testing.assert_allclose(ds["n"].sel(size=5)[0], (1 - p) ** 2 * p**4, rtol=1e-6)
    state = steady_state(model)
    np.testing.assert_allclose(state.moment(0), 1 - p[-1], rtol=1e-3)


def test_monomer_source() -> None:
    model = sx.Model(sx.kernels.Constant(), [P.Aggregation(), P.Source(0.5)], sx.initial.empty())
    times = np.array([0.1, 1.0, 10.0])
    ds = sx.solve(model, times)
    np.testing.assert_allclose(ds["number_density"][0], np.tanh(0.5 * times), rtol=1e-7)
    np.testing.assert_allclose(ds["mass"][0], 0.5 * times, rtol=1e-8)


def test_becker_doering() -> None:
    """Monomers come and go one by one: ``c_k = z**k`` in equilibrium, ``z / (1 - z)^2 = 3``."""
    attach = sx.kernels.formula("max(0, 2 - min(i, j)) * (1 + max(0, 2 - max(i, j)))")
    model = sx.Model(attach, [P.Aggregation(), P.Evaporation(1.0)], sx.initial.monodisperse(3.0))
    ds = sx.solve(model, [400.0], window=128)
    z = (7 - np.sqrt(13)) / 6
    np.testing.assert_allclose(ds["n"].values[0, 0, :20], z ** np.arange(1, 21), rtol=1e-6)
    assert z**10 == pytest.approx(3.35876812947e-3, rel=1e-10)


@pytest.mark.parametrize("printed", [False, True])
def test_evaporation_in_the_free_molecular_regime(printed: bool) -> None:
    """Reference values of ``c_j``, the density of the sizes from j on; errata, entry 19."""
    evaporation = P.Evaporation.free_molecular(1.0, 1.0, printed=printed)
    ds = sx.solve(sx.Model(FREE_MOLECULAR, [P.Aggregation(), evaporation]), [1.0, 5.0])
    for row in csv.DictReader((DATA / "evaporation_c_jstar.csv").open()):
        if (row["variant"] == "P") == printed:
            for j in (2, 5, 10):
                found = observed(ds, float(row["tau"]), slice(j - 1, None))
                assert found == pytest.approx(float(row[f"c_{j}"]), rel=1e-7)


def test_source_and_sink_oscillate() -> None:
    """Ball et al.: sizes beyond 400 leave, and the number of clusters goes on swinging."""
    kernel = sx.kernels.formula("0.5 * ((i/j)**a + (j/i)**a)", a=0.95)
    processes = [P.Aggregation(), P.Source(1.0), P.Removal(above=400)]
    model = sx.Model(kernel, processes, sx.initial.empty())
    times = np.arange(0.0, 200.5, 0.5)
    ds = sx.solve(model, times, tolerance=1e-5)
    number = ds["number_density"].values[0, times > 120]
    assert number.max() == pytest.approx(0.9747, abs=3e-3)
    assert number.min() == pytest.approx(0.33118, abs=2e-3)
    crossings = np.flatnonzero(np.diff(np.sign(number - 0.6)) > 0)
    assert np.diff(crossings).mean() * 0.5 == pytest.approx(26.294, abs=0.3)
    np.testing.assert_allclose(ds["mass"] - ds["mass_in"] + ds["mass_out"], 0.0, atol=1e-6)


# --- mistakes, files ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: P.Evaporation(-1.0), "the evaporation rate = -1.0: is -1 for the size 1"),
        (lambda: P.Evaporation("q"), "unknown name 'q'"),
        (lambda: P.Evaporation([]), "must be a number, a formula in k"),
        (lambda: P.Evaporation([0.0, 1.0, -2.0]), "is -2 for the size 3"),
        (lambda: P.Evaporation.free_molecular(-1.0, np.nan), "steepness = nan"),
        (lambda: P.Fragmentation(0.0), "a finite number above zero"),
        (lambda: P.Fragmentation("i - j"), "the fragmentation rate"),
        (lambda: P.CollisionalFragmentation(0.1, [0.0, 1.0]), "above zero for k = 1"),
        (lambda: P.CollisionalFragmentation(0.1, 2.0, largest=0.5), "largest fragment must be"),
        (lambda: P.Removal(), "nothing would be removed"),
        (lambda: P.Removal(above=0.5), "above = 0.5: must be a whole number"),
        (lambda: P.Source({}), "at least one size"),
        (lambda: P.Source({0: 1.0}), "the size 0"),
        (lambda: P.Source(-1.0), "the rate -1.0"),
        (lambda: sx.Model(sx.kernels.Constant(), initial=sx.initial.empty()), "give a source"),
        (
            lambda: sx.Model(sx.kernels.Constant(), [P.Source({9: 1.0}), P.Removal(above=5)]),
            "sizes reach 9",
        ),
        (
            lambda: steady_state(sx.Model(sx.kernels.Constant(), [P.Aggregation(), P.Source()])),
            "no mass is given",
        ),
    ],
)
def test_mistakes(make: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        make()


def test_models_as_data() -> None:
    processes = [
        P.Aggregation(), P.Evaporation([0.0, 1.0, 0.5], varying="1 + t"),
        P.Fragmentation(sx.kernels.Additive(0.1)), P.Removal("k/100", above=50),
        P.Source({1: 1.0, 3: 0.5}),
    ]  # fmt: skip
    model = sx.Model(sx.kernels.Constant(), processes, sx.initial.empty())
    data = model_to_dict(model)
    back = model_from_dict(data)
    assert model_to_dict(back) == data
    one, other = (sx.solve(m, [1.0], window=50)["moment"].values for m in (model, back))
    np.testing.assert_array_equal(one, other)


def test_case_file() -> None:
    text = """
        [kernel]
        name = "constant"
        [[processes]]
        name = "source"
        rates = { 1 = 1.0, 3 = 0.5 }
        [[processes]]
        name = "evaporation"
        rate = [0, 1, 0.5]
        [[processes]]
        name = "removal"
        above = 50
        [initial]
        name = "empty"
        [run]
        times = [1]
    """
    case = cases.parse(text)
    assert case.model.cut == 50
    assert cases.parse(case.to_toml()) == case
    with pytest.raises(InputError, match="formula in k"):
        cases.parse(text.replace("[0, 1, 0.5]", "{ a = 1 }"))


# --- without encounters --------------------------------------------------------------------------

ZEROS = {
    "constant": sx.kernels.Constant(0),
    "formula": sx.kernels.formula("0"),
    "parameter": sx.kernels.formula("a*(i + j)", a=0.0),
    "function": sx.kernels.from_function(lambda i, j: 0.0 * i * j),
}


@laborious
@pytest.mark.parametrize(
    "method",
    [
        pytest.param(m.name, marks=() if m.name == "acceptance-rejection" else pytest.mark.slow)
        for m in sx.methods.METHODS
    ],
)
def test_particles_that_never_meet(method: str) -> None:
    """Each is there at t with the probability exp(-r t), and what a source brings is J t."""
    laws_of_all = sx.kernels.formula(FORMULA, c0=0.0, c1=0.0, c2=0.0, c3=0.0)
    model = replace(everything(removal=0.3), kernel=laws_of_all)
    ds = simulated(model, TIMES, 51, method=method)
    laws.agree(ds["number_density"].values, np.exp(-0.3 * np.array(TIMES)), method)
    assert (ds["collisions"] == 0).all()
    _in_few_candidates(ds)
    model = replace(everything(source=1.0, initial=sx.initial.empty()), kernel=laws_of_all)
    ds = simulated(model, [3.0], 52, method=method)
    brought = 3.0 + 0.5 * (1 - np.cos(9.0)) / 3
    laws.agree(ds["number_density"].values[:, 0], 1.2 * brought, method)


def _in_few_candidates(ds: Any) -> None:
    """Where the others took thousands for each event, as they waited for an encounter."""
    others = ds["events"].isel(time=-1, process=slice(1, None)).sum("process")
    assert (others > 100).all()
    assert (ds["attempts"].isel(process=0) < 8 * 4096).all()


@laborious
def test_encounters_that_are_seldom_hold_nothing_up() -> None:
    """One in a thousand candidates has the giant in it, and few come in the time of the others."""
    giant = sx.initial.from_sizes({1: 0.999, 10**6: 0.001})
    kernel = sx.kernels.formula(FORMULA, c0=0.0, c1=1e-6, c2=0.0, c3=0.0)
    model = replace(everything(removal=0.3, initial=giant), kernel=kernel)
    ds = simulated(model, [1.0], 53, population="fixed-volume")
    particles = ds["particles"].values[:, 0] + ds["collisions"].values[:, 0]
    laws.agree(particles, 1000 * np.exp(-0.3), "removal")
    laws.agree(ds["collisions"].values[:, 0], (1 - np.exp(-0.6)) / 0.6, "by the giant, while it is")
    _in_few_candidates(ds)


@pytest.mark.parametrize("kernel", ZEROS.values(), ids=ZEROS)
def test_a_kernel_that_is_zero(kernel: Any) -> None:
    assert kernel.vanishes
    with pytest.raises(InputError, match="nothing would ever happen, as aggregation take"):
        sx.Model(kernel)
    with pytest.raises(InputError, match="aggregation and shattering take two particles"):
        sx.Model(kernel, [P.Aggregation(), P.Shattering(0.1)])
    model = sx.Model(kernel, [P.Aggregation(), P.Removal(0.5)])
    ds = sx.solve(model, [1.0, 2.0])
    np.testing.assert_allclose(ds["number_density"][0], np.exp([-0.5, -1.0]), rtol=1e-6)


def test_a_case_without_encounters() -> None:
    case = cases.parse(
        '[kernel]\nname = "constant"\nscale = 0\n[[processes]]\nname = "removal"\nrate = 0.5\n'
        "[run]\ntimes = [1]\n"
    )
    assert case.model == sx.Model(sx.kernels.Constant(0), [P.Removal(0.5)])
    assert cases.parse(case.to_toml()) == case


def test_other_kernels_do_not_vanish() -> None:
    for law in (sx.kernels.Constant(1e-300), sx.kernels.Ballistic(), sx.kernels.formula("1/i/j")):
        assert not law.vanishes
    assert not sx.kernels.from_function(lambda i, j: 1.0 if i + j == 7 else 0.0).vanishes


# --- several of a kind ---------------------------------------------------------------------------

DILUTION, WALL = 0.3, 0.9


@extinction
def test_two_removals_are_one_with_their_rates_together() -> None:
    """The number of particles of a small system by its master equation, and who took them."""
    particles, replicas, end = 12, 4000, 0.7
    processes = [P.Aggregation(), P.Removal(DILUTION), P.Removal(WALL, label="wall")]
    ds = sx.simulate(
        sx.Model(laws.kernel("constant"), processes), [end], method="acceptance-rejection",
        particles=particles, replicas=replicas, seed=11, sizes=particles,
        population="fixed-volume",
    )  # fmt: skip
    n = np.arange(particles + 1.0)
    rate = float(laws.kernel("constant")(1, 1))
    down = rate * n * (n - 1) / (2 * particles) + (DILUTION + WALL) * n
    chain = np.diag(-down) + np.diag(down[1:], 1)
    law = linalg.expm(end * chain)[:, -1]
    seen = np.bincount(ds["particles"].values[:, 0].astype(int), minlength=particles + 1)
    often = replicas * law > 10
    found = np.append(seen[often], seen[~often].sum())
    expected = replicas * np.append(law[often], law[~often].sum())
    # fewer than 7e-5 of right programs are beyond
    assert stats.chisquare(found, expected).pvalue > 7e-5
    assert ds["process"].values.tolist() == ["aggregation", "removal", "wall"]
    mine, walls = (float(ds["events"].sel(process=p).sum()) for p in ("removal", "wall"))
    share, taken = WALL / (DILUTION + WALL), mine + walls
    assert abs(walls - share * taken) < 4 * np.sqrt(taken * share * (1 - share))
    assert taken > replicas


def test_two_of_a_kind_in_the_solver() -> None:
    kernel, times = sx.kernels.Additive(0.2), [0.5, 2.0]

    def solved(*processes: Any) -> Any:
        return sx.solve(sx.Model(kernel, [P.Aggregation(), *processes]), times, tolerance=1e-9)

    one = solved(P.Removal("1.2 + 0.1*k"))
    two = solved(P.Removal("0.3 + 0.025*k"), P.Removal("0.9 + 0.075*k", label="wall"))
    np.testing.assert_allclose(two["moment"], one["moment"], rtol=1e-8)
    events = two["events"]
    np.testing.assert_allclose(events.sel(process="wall"), 3 * events.sel(process="removal"))
    np.testing.assert_allclose(
        events.sel(process=["removal", "wall"]).sum("process"),
        one["events"].sel(process="removal"), rtol=1e-8,
    )  # fmt: skip


@pytest.mark.filterwarnings("ignore:.*beyond the 200 sizes:smolux.errors.SmoluxWarning")
def test_several_aggregations_are_one_with_their_rates_together() -> None:
    """For exact solutions, a gel, and whatever asks whether there is aggregation alone."""
    kernel = sx.kernels.Multiplicative()
    one = sx.Model(kernel)
    two = sx.Model(kernel, [P.Aggregation(0.25), P.Aggregation(0.75, label="sticky")])
    assert two.plain_aggregation
    assert not sx.Model(kernel, [P.Aggregation(), P.Aggregation(label="more")]).plain_aggregation
    found, known = (sx.exact.solution(m) for m in (two, one))
    assert found == known
    assert found is not None
    a, b = (sx.solve(m, [0.5, 2.0], gel="reacts", window=200, tolerance=1e-7) for m in (two, one))
    np.testing.assert_allclose(a["moment"], b["moment"], rtol=1e-6)
    events = a["events"]
    np.testing.assert_allclose(
        events.sel(process="sticky"), 3 * events.sel(process="aggregation"), rtol=1e-9
    )
    np.testing.assert_allclose(events.sum("process"), b["events"].sum("process"), rtol=1e-6)


def test_labels_are_kept() -> None:
    model = sx.Model(sx.kernels.Constant(), [P.Aggregation(), P.Removal(0.1),
                                             P.Removal("k**(-1/3)", label="wall")])  # fmt: skip
    assert model_from_dict(model_to_dict(model)) == model
    assert "label" not in model_to_dict(model)["processes"][1]
    text = """
        kernel = { name = "constant" }
        run = { times = [1.0], particles = 100, replicas = 2 }
        [[processes]]
        name = "aggregation"
        [[processes]]
        name = "removal"
        rate = 0.1
        [[processes]]
        name = "removal"
        label = "wall"
        rate = "k**(-1/3)"
        """
    case = cases.parse(text)
    assert case.model == model
    assert cases.parse(case.to_toml()).model == model
    for key, which in (("wall", 2), ("removal", 1)):
        processes: Any = cases.parse(text, sets=[f"processes.{key}.rate=0.5"]).model.processes
        assert [k for k in (1, 2) if processes[k].of_size.constant == 0.5] == [which]


@pytest.mark.parametrize(
    ("processes", "message"),
    [
        (
            [P.Removal(0.1), P.Removal(0.2)],
            "process 'removal' is given 2 times: tell them apart by labels, .*"
            r"as in Removal\(\.\.\., label=\"removal 2\"\)",
        ),
        ([P.Removal(0.1, label="source"), P.Source(1.0)], "process 'source' is given 2 times"),
        ([P.Removal(0.1, label=" ")], "removal: label = ' ': must be a text such as 'wall'"),
        ([P.Aggregation(label=3)], "aggregation: label = 3: must be a text"),
    ],
)
def test_mistakes_in_labels(processes: list[Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        sx.Model(sx.kernels.Constant(), processes)
