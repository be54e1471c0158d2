"""Laws from starts in which nothing is one: densities, sizes, volumes and masses, in all methods.

Where a unit is one, a factor that is missing is not missed. The loops are those of `test_laws`.
"""

from __future__ import annotations

from collections import Counter
from functools import lru_cache
from typing import Any

import chains
import laws
import numpy as np
import pytest
from scipy import linalg, stats

import smolux as sx
from shared import EVERY, QUICK, VARYING, extinction, laborious, repaired
from smolux import exact

# a bound that is too low is to be seen by the law, not by the warning
pytestmark = [extinction, laborious, repaired]

#: particles for a unit of volume
DENSITY = 2.5
METHODS = [method.name for method in sx.methods.METHODS]
every_method = pytest.mark.parametrize("method", EVERY)


def start(*sizes: int, density: float = DENSITY) -> sx.initial.Sizes:
    """Return the start of which as many particles as are named have these sizes."""
    shares = {k: density * sizes.count(k) / len(sizes) for k in sizes}
    return sx.initial.from_sizes(shares)


def fixed(model: sx.Model, time: float, method: Any, particles: int, **settings: Any) -> Any:
    """Simulate particles in their fixed volume until a time."""
    return sx.simulate(
        model, [time], method=method, particles=particles, population="fixed-volume",
        bins_per_octave=1, **settings,
    )  # fmt: skip


# --- small systems -------------------------------------------------------------------------------

#: sizes, law, rate of shattering, end
FEW = [((3, 3, 7), "bilinear", 0.3, 0.08), ((3, 5), "ballistic", 0.4, 0.2)]


@lru_cache
def probabilities(case: int) -> laws.Float:
    """Probabilities of all partitions of the mass, in the order of `exact.finite.partitions`."""
    sizes, law, shattering, end = FEW[case]
    q = laws.generator(laws.kernel(law), sum(sizes), shattering)
    first = exact.finite.partitions(sum(sizes)).index(tuple(sorted(sizes, reverse=True)))
    # the generator is that of a volume as large as the mass
    volume = len(sizes) / DENSITY
    return np.asarray(linalg.expm(q * end * sum(sizes) / volume)[:, first])


#: the law of the second is that of `test_laws.test_whole_distribution`
FEW_QUICK = {*((m, 0) for m in METHODS if m != "fictitious-jumps"), ("acceptance-rejection", 1)}


@pytest.mark.parametrize(
    ("method", "case"),
    [
        pytest.param(m, case, marks=() if (m, case) in FEW_QUICK else pytest.mark.slow)
        for m in METHODS
        for case in range(len(FEW))
    ],
)
def test_few_particles(method: str, case: int) -> None:
    """All states of a few particles of two sizes against the master equation."""
    sizes, law, shattering, end = FEW[case]
    mass, replicas = sum(sizes), 4000
    model = laws.model(law, shattering, start(*sizes))
    ds = fixed(model, end, method, len(sizes), replicas=replicas, sizes=mass, seed=61)
    counts = laws.partition_counts(ds, mass, 0)
    assert laws.chi_square(counts, replicas * probabilities(case)) > laws.RARE


#: two sizes, the largest of their classes, levels and slots among them, and a law
PAIRS = {
    "31-31": ((31, 31), "multiplicative"),
    "6-7": ((6, 7), "multiplicative"),
    "3-7": ((3, 7), "ballistic"),
    "1-30000": ((1, 30_000), "multiplicative"),
}
#: a small and a large size meet in `test_wide_rates`, too, by each method
PAIRS_QUICK = {
    *((m, pair) for m in METHODS if m != "fictitious-jumps" for pair in ("31-31", "6-7", "3-7")),
    ("acceptance-rejection", "1-30000"),
    ("low-rank", "1-30000"),
}


@pytest.mark.parametrize(
    ("method", "sizes", "law"),
    [
        pytest.param(
            m, *PAIRS[pair], id=f"{m}-{pair}",
            marks=() if (m, pair) in PAIRS_QUICK else pytest.mark.slow,
        )
        for m in METHODS
        for pair in PAIRS
    ],
)  # fmt: skip
def test_time_until_two_merge(method: str, sizes: tuple[int, int], law: str) -> None:
    """Exponential, with the mean V/K: 2.7e-5 for the sizes 1 and 30000."""
    model = laws.model(law, 0.0, start(*sizes))
    replicas = 4000 if sizes[1] < 100 else 500  # of what is large, tables are
    ds = fixed(model, 1e6, method, 2, replicas=replicas, sizes=1, seed=62)
    mean = 2 / DENSITY / float(laws.kernel(law)(*sizes))
    assert stats.kstest(ds["extinction_time"], stats.expon(scale=mean).cdf).pvalue > laws.RARE


@every_method
def test_time_until_three_merge(method: str) -> None:
    """The product of the sizes: at 3/V, and at 2/V with a size that was not there before."""
    model = laws.model("multiplicative", 0.0, start(1, 1, 1))
    ds = fixed(model, 1e6, method, 3, replicas=4000, sizes=1, seed=69)
    clock = ds["extinction_time"] / (3 / DENSITY)
    found = stats.kstest(clock, lambda t: 1.0 - 3.0 * np.exp(-2.0 * t) + 2.0 * np.exp(-3.0 * t))
    assert found.pvalue > laws.RARE


@pytest.mark.parametrize("method", QUICK)
def test_two_monomers_do_not_mind_encounters_that_come_to_nothing(method: str) -> None:
    """They shatter into themselves, at a rate that varies and is thinned: the mean is 2 still."""
    model = laws.model("constant", VARYING)
    ds = fixed(model, 1e6, method, 2, replicas=4000, sizes=1, seed=63)
    assert stats.kstest(ds["extinction_time"], stats.expon(scale=2.0).cdf).pvalue > laws.RARE


#: stores in which small systems reach what they never do else
STRAINED = [sx.methods.LowRank(bits=0), sx.methods.Inverse(buckets=4)]


@pytest.mark.parametrize("method", [*EVERY, *STRAINED], ids=str)
def test_after_hundreds_of_events(method: Any) -> None:
    """Eight monomers that merge and shatter: bounds, sums and tables were renewed many times."""
    particles, replicas, clock = 8, 2000, 3.0
    model = laws.model("ballistic", 5.0, sx.initial.monodisperse(DENSITY))
    ds = fixed(
        model, clock / DENSITY, method, particles, replicas=replicas, sizes=particles, seed=64
    )
    assert ds["collisions"].mean() > 200
    _, p = exact.finite.partition_pmf(laws.kernel("ballistic"), particles, clock, shattering=5.0)
    found = laws.chi_square(laws.partition_counts(ds, particles, 0), replicas * p)
    assert found > laws.RARE


#: four particles whose clusters tell who has merged
DIFFERENT = (1, 5, 12, 30)


@lru_cache
def clusters(law: str, end: float) -> tuple[dict[tuple[int, ...], int], laws.Float]:
    """The fifteen states that `DIFFERENT` may reach, and their probabilities."""
    rate, volume = laws.kernel(law), len(DIFFERENT) / DENSITY
    moves = chains.pairs(lambda i, j: float(rate(i, j)), lambda k: 1.0, volume)
    place, p = chains.law(DIFFERENT, moves, (end,), len(DIFFERENT))
    return place, p[0, :-1]


@pytest.mark.parametrize(
    ("method", "law", "end"),
    [
        *(pytest.param(*m.values, "ballistic", 0.04, marks=m.marks, id=m.values[0]) for m in EVERY),
        *(pytest.param(m, "ballistic", 0.04, id=str(m)) for m in STRAINED),
        pytest.param(STRAINED[1], "multiplicative", 0.006, id=f"{STRAINED[1]}-multiplicative"),
    ],
)
def test_who_merges(method: Any, law: str, end: float) -> None:
    """Small and large, one after the other: what is left behind of the first is not lost."""
    replicas = 4000
    place, p = clusters(law, end)
    model = laws.model(law, 0.0, start(*DIFFERENT))
    ds = fixed(model, end, method, 4, replicas=replicas, sizes=sum(DIFFERENT), seed=71)
    counts = np.rint(ds["n"].values[:, 0] * ds["volume"].values[0, 0]).astype(int)
    sizes = np.arange(1, sum(DIFFERENT) + 1)
    found = Counter(tuple(np.repeat(sizes, row)) for row in counts)
    observed = [found[state] for state in place]
    assert sum(observed) == replicas
    assert laws.chi_square(observed, replicas * p) > laws.RARE


@every_method
def test_those_that_have_come_meet_others(method: str) -> None:
    """In the first events there are clusters of three, made of those that were not there before."""
    particles, clock = 400, 0.4
    model = laws.model("constant", 0.0, sx.initial.monodisperse(DENSITY))
    ds = fixed(model, clock / DENSITY, method, particles, replicas=100, sizes=4, seed=72)
    law = exact.finite.law("constant", particles)
    expected = law.counts(clock, np.arange(1, 5)) / ds["volume"].values[0, 0]
    laws.agree(ds["n"].values[:, 0], expected)


@pytest.mark.parametrize("method", QUICK)
def test_two_particles_that_are_doubled_never_end(method: str) -> None:
    """One that is left becomes two at once, and the number of clusters falls as that of many."""
    model = laws.model("constant", 0.0, start(3, 7))
    ds = sx.simulate(model, [0.0, 40.0], method=method, particles=2, replicas=200, seed=65)
    assert np.isnan(ds["extinction_time"]).all()
    assert (ds["particles"] >= 2).all()
    assert (ds["volume"].isel(time=-1) > 4 * ds["volume"].isel(time=0)).all()
    np.testing.assert_allclose(ds["moment"].sel(order=1), 5 * DENSITY, rtol=1e-12)


@every_method
def test_forty_particles(method: str) -> None:
    """The number of clusters of the constant law, which no size changes, in a volume of 16."""
    clock, particles = 1.7, 40
    model = laws.model("constant", 0.0, start(3, 3, 3, 7, 7))
    ds = fixed(model, clock / DENSITY, method, particles, replicas=1000, sizes=8, seed=66)
    assert (ds["volume"] == 16.0).all()
    mean = exact.finite.number_mean("constant", particles, clock)
    laws.agree(ds["number_density"].values[:, 0], mean / 16.0)


# --- large ones ----------------------------------------------------------------------------------


@lru_cache
def solved() -> Any:
    return sx.solve(laws.model("ballistic", 0.01, start(3, 3, 3, 7, 7)), [0.05, 1.0], sizes=300)


@every_method
def test_means(method: str) -> None:
    """Moments and densities against the rate equations, with doubling."""
    model, truth = laws.model("ballistic", 0.01, start(3, 3, 3, 7, 7)), solved()
    times = truth["time"].values
    ds = sx.simulate(model, times, method=method, particles=1000, replicas=24, seed=67, sizes=32)
    assert (ds["volume"].isel(time=-1) > 400.0).all()
    for order in (0, 2, 3):
        expected = truth["moment"].sel(order=order).values[0]
        laws.agree(ds["moment"].sel(order=order).values, expected, order)
    for size in (1, 3, 7, 10):
        expected = truth["n"].sel(size=size).values[0]
        laws.agree(ds["n"].sel(size=size).values, expected, size)


@pytest.mark.parametrize("method", QUICK)
def test_events_at_a_rate_that_varies(method: str) -> None:
    """Late, when windows of time are longer than a period: a fifth of the encounters is thinned."""
    model = laws.model("constant", VARYING, start(3, 3, 3, 7, 7))
    truth = sx.solve(model, [12.0])
    ds = sx.simulate(
        model, [12.0], method=method, particles=1000, replicas=16, seed=70, sizes=1,
        population="fixed-volume", bins_per_octave=1,
    )  # fmt: skip
    laws.agree(ds["number_density"].values, truth["number_density"].values[0])
    events = ds["events"].values[:, 0] / ds["volume"].values
    laws.agree(events, truth["events"].values[0, 0], "events")


@every_method
def test_bins(method: str) -> None:
    """Densities in bins, that of the size 7 alone among them, and moments of what is in them."""
    clock = 10.0
    model = laws.model("constant", 0.0, sx.initial.monodisperse(DENSITY))
    ds = sx.simulate(
        model, [clock / DENSITY], method=method, particles=4000, replicas=24, seed=68, sizes=4,
        orders=(0, 1, 2, 3),
    )  # fmt: skip
    truth = laws.solution("constant")
    sizes = np.arange(1, int(ds["bin_upper"][-1]))
    n = DENSITY * truth.densities(np.array([clock]), sizes)[0]
    laws.agree(ds["n"].values[:, 0], n[:4], "sizes")
    lower, upper = (ds[f"bin_{side}"].values.astype(int) for side in ("lower", "upper"))
    assert (lower[1], upper[1]) == (7, 8)
    expected = np.array([n[a - 1 : b - 1].sum() for a, b in zip(lower, upper, strict=True)])
    assert expected[1] == pytest.approx(0.0093 * DENSITY, rel=2e-3)
    common = expected * ds["volume"].values.sum() > 300
    laws.agree(ds["n_bin"].values[:, 0, common], expected[common], "bins")
    for order in (0, 2, 3):
        moment = DENSITY * truth.moment(np.array([clock]), order)
        laws.agree(ds["moment"].sel(order=order).values, moment, order)
