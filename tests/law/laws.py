"""Exact laws of the jump process, as checks that every method must pass.

One formula kernel stands for all laws and a shattering rate of zero for pure aggregation:
coefficients are data, so all these share one compiled loop a method. Seeds are fixed. With another
seed, a right program fails a check about once in ten thousand times.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import integrate, stats

import smolux as sx
from shared import FORMULA
from smolux import exact
from smolux.kernels.base import Kernel

Float = NDArray[np.float64]

#: coefficients of 1, i + j, i j and the ballistic kernel
COEFFICIENTS = {
    "constant": (1.0, 0.0, 0.0, 0.0),
    "additive": (0.0, 1.0, 0.0, 0.0),
    "multiplicative": (0.0, 0.0, 1.0, 0.0),
    "bilinear": (1.0, 0.5, 0.25, 0.0),
    "ballistic": (0.0, 0.0, 0.0, 1.0),
}
#: the same laws by the names under which their solutions are known
KNOWN: dict[str, Kernel] = {
    "constant": sx.kernels.Constant(),
    "additive": sx.kernels.Additive(),
    "multiplicative": sx.kernels.Multiplicative(),
    "bilinear": sx.kernels.Bilinear(0.5, 0.25),
}
LAWS = ("constant", "additive", "multiplicative", "ballistic")

#: a check of one number fails beyond this many standard errors
SIGMAS = 4.5
#: a check of a whole law fails below this probability
RARE = 1e-4


def kernel(law: str) -> Kernel:
    c0, c1, c2, c3 = COEFFICIENTS[law]
    return sx.kernels.formula(FORMULA, c0=c0, c1=c1, c2=c2, c3=c3)


def model(law: str, shattering: Any = 0.0, initial: Any = None) -> sx.Model:
    processes = [sx.processes.Aggregation(), sx.processes.Shattering(shattering)]
    return sx.Model(kernel(law), processes, initial or sx.initial.monodisperse())


def finite(law: str, times: Any, method: Any, shattering: Any = 0.0, **settings: Any) -> Any:
    """Simulate the process of a finite number of particles in its fixed volume."""
    # few bins: of thousands of replicas they would be most of the work
    return sx.simulate(
        model(law, shattering), times, method=method, population="fixed-volume",
        bins_per_octave=1, **settings,
    )  # fmt: skip


def solution(law: str, shattering: float = 0.0) -> exact.base.Solution:
    processes = [sx.processes.Aggregation(), sx.processes.Shattering(shattering)]
    found = exact.solution(sx.Model(KNOWN[law], processes))
    assert found is not None
    return found


# --- statistics ----------------------------------------------------------------------------------


def sigmas(values: Any, expected: Any) -> Float:
    """Deviation of the mean over replicas (first axis), in standard errors."""
    values = np.asarray(values, float)
    error = values.std(axis=0, ddof=1) / np.sqrt(len(values))
    return np.asarray((values.mean(axis=0) - np.asarray(expected)) / error)


def agree(values: Any, expected: Any, what: Any = "") -> None:
    z = sigmas(values, expected)
    assert np.abs(z).max(initial=0.0) < SIGMAS, (what, z)


def chi_square(observed: Any, expected: Any) -> float:
    """Probability of Pearson's test; rare cells are put together until five are expected."""
    order = np.argsort(expected)
    observed, expected = np.asarray(observed)[order], np.asarray(expected)[order]
    rare = int(np.searchsorted(np.cumsum(expected), 5.0)) + 1
    observed = np.append(observed[rare:], observed[:rare].sum())
    expected = np.append(expected[rare:], expected[:rare].sum())
    return float(stats.chi2.sf(((observed - expected) ** 2 / expected).sum(), len(expected) - 1))


def partition_counts(ds: Any, particles: int, k: int) -> NDArray[np.int64]:
    """How many replicas have each partition at the time `k`, in the order of `exact.finite`."""
    counts = np.rint(ds["n"].values[:, k] * ds["volume"].values[:, k, None]).astype(int)
    assert (counts @ np.arange(1, particles + 1) == particles).all()
    partitions = exact.finite.partitions(particles)
    cell = {tuple(np.bincount(p, minlength=particles + 1)[1:]): m for m, p in enumerate(partitions)}
    rows, repeats = np.unique(counts, axis=0, return_counts=True)
    found = np.zeros(len(partitions), np.int64)
    for row, repeat in zip(rows, repeats, strict=True):
        found[cell[tuple(row)]] = repeat
    return found


# --- the finite process --------------------------------------------------------------------------


def generator(law: Kernel, particles: int, shattering: float) -> Float:
    """Matrix of jump rates (column to row) between the partitions, in the volume N."""
    states = [tuple(sorted(p)) for p in exact.finite.partitions(particles)]
    place = {state: k for k, state in enumerate(states)}
    q = np.zeros((len(states), len(states)))
    for source, state in enumerate(states):
        for a in range(len(state)):
            for b in range(a):
                left = [s for k, s in enumerate(state) if k not in (a, b)]
                both = state[a] + state[b]
                rate = float(law(state[a], state[b])) / particles
                for share, made in ((1.0, [both]), (shattering, [1] * both)):
                    q[place[tuple(sorted(left + made))], source] += share * rate
                    q[source, source] -= share * rate
    return q


def whole_distribution(method: Any, law: str, shattering: float, seed: int = 1) -> None:
    """All partitions of eight monomers against the master equation of the Markov chain."""
    particles, replicas, times = 8, 6000, (0.5, 1.5)
    ds = finite(
        law, times, method, shattering, particles=particles, replicas=replicas, sizes=8, seed=seed
    )
    for k, t in enumerate(times):
        _, p = exact.finite.partition_pmf(kernel(law), particles, t, shattering=shattering)
        found = chi_square(partition_counts(ds, particles, k), replicas * p)
        assert found > RARE, (law, shattering, t, found)
    mean, variance = exact.finite.collision_moments(
        kernel(law), particles, times[-1], shattering=shattering
    )
    collisions = ds["collisions"].values[:, -1]
    agree(collisions, mean, "mean collisions")
    agree((collisions - mean) ** 2, variance, "variance of collisions")


def distribution_in_time(
    method: Any, shattering: Any, rate: Callable[[float], float], seed: int = 2
) -> None:
    """The same with a shattering rate that depends on time, by exact thinning."""
    particles, replicas, times = 8, 10_000, (0.7, 1.5)
    ds = finite(
        "additive",
        times,
        method,
        shattering,
        particles=particles,
        replicas=replicas,
        sizes=8,
        seed=seed,
    )
    still, broken = (generator(kernel("additive"), particles, x) for x in (0.0, 1.0))
    start = np.zeros(len(still))
    start[exact.finite.partitions(particles).index((1,) * particles)] = 1.0
    found = integrate.solve_ivp(
        lambda t, p: (still + rate(t) * (broken - still)) @ p,
        (0.0, times[-1]),
        start,
        t_eval=times,
        rtol=1e-9,
        atol=1e-12,
        max_step=0.02,
    )
    for k, t in enumerate(times):
        p = chi_square(partition_counts(ds, particles, k), replicas * found.y[:, k])
        assert p > RARE, (shattering, t, p)


def aggregation_in_time(method: Any, seed: int = 6) -> None:
    """Aggregation at a rate that varies is aggregation in another time, here ``s = t + t**2/2``."""
    times, replicas = np.array([0.3, 0.8]), 8000
    processes = [sx.processes.Aggregation(varying="1 + t"), sx.processes.Shattering(0.0)]
    ds = sx.simulate(
        sx.Model(kernel("additive"), processes), times, method=method, population="fixed-volume",
        particles=8, replicas=replicas, sizes=8, seed=seed, bins_per_octave=1,
    )  # fmt: skip
    for k, s in enumerate(times + times**2 / 2):
        mean, variance = exact.finite.collision_moments(KNOWN["additive"], 8, s)
        collisions = ds["collisions"].values[:, k]
        agree(collisions, mean, ("mean collisions", k))
        agree((collisions - mean) ** 2, variance, ("variance of collisions", k))


def waiting_times(method: Any, seed: int = 3) -> None:
    """Times to the one cluster of two and of three particles, by Kolmogorov-Smirnov tests.

    Two merge at the rate 1/V, V = 2. Three merge at 3/V and then 1/V, V = 3. That two monomers
    may shatter, too, changes nothing.
    """
    settings = {"replicas": 4000, "sizes": 8}
    for shattering in (0.0, 0.5):
        two = finite(
            "constant", [1e6], method, shattering, particles=2, seed=seed, **settings
        )  # fmt: skip
        times = two["extinction_time"].values
        assert stats.kstest(times, stats.expon(scale=2.0).cdf).pvalue > RARE
    three = finite("constant", [1e6], method, particles=3, seed=seed + 1, **settings)
    assert (
        stats.kstest(
            three["extinction_time"].values,
            lambda t: 1 - 1.5 * np.exp(-t / 3) + 0.5 * np.exp(-t),
        ).pvalue
        > RARE
    )


def first_collision(method: Any, seed: int = 5) -> None:
    """The time of the first of many collisions, to within the output times, is exponential."""
    particles, replicas = 50, 3000
    times = np.linspace(0.004, 0.16, 40)
    ds = finite(
        "additive", times, method, particles=particles, replicas=replicas, sizes=8, seed=seed
    )
    # every pair of monomers at the rate 2 / V
    total = 2.0 * particles * (particles - 1) / 2 / particles
    none_yet = (ds["collisions"].values == 0).sum(axis=0)
    before = np.concatenate(([replicas], none_yet[:-1]))
    found = before - none_yet
    share = np.exp(-total * np.concatenate(([0.0], times)))
    expected = replicas * np.append(-np.diff(share), share[-1])
    assert chi_square(np.append(found, none_yet[-1]), expected) > RARE


def fluctuations(method: Any, law: str, seed: int = 6) -> None:
    """Mean and variance of the number of clusters, so of collisions, at N = 10,000 and t = 0.6.

    The exact standard deviations are 37 and 50. Programs that add mean waiting times get less than
    one, with the right mean.
    """
    particles, replicas, t = 10_000, 200, 0.6
    ds = finite(law, [t], method, particles=particles, replicas=replicas, sizes=16, seed=seed)
    number = ds["particles"].values[:, 0]
    mean, variance = exact.finite.law(law, particles).number_moments(t)
    assert round(np.sqrt(variance)) == {"constant": 37, "additive": 50}[law]
    z = (number.mean() - mean) / np.sqrt(variance / replicas)
    assert abs(z) < SIGMAS, z
    below = stats.chi2.cdf((replicas - 1) * number.var(ddof=1) / variance, replicas - 1)
    assert RARE < below < 1 - RARE, (number.std(ddof=1), np.sqrt(variance))
    np.testing.assert_array_equal(ds["collisions"].values[:, 0], particles - number)


# --- means: many particles against the rate equations --------------------------------------------


def _means(ds: Any, truth: Any, orders: Sequence[int], sizes: Sequence[int]) -> None:
    times = ds["time"].values
    for order in orders:
        agree(ds["moment"].sel(order=order).values, truth.moment(times, order), f"M{order}")
    for size in sizes:
        expected = truth.densities(times, np.array([size]))[:, 0]
        # standard errors are known where hundreds of clusters are counted in all
        known = expected * ds["volume"].values.sum(axis=0) > 300
        agree(ds["n"].sel(size=size).values[:, known], expected[known], f"n_{size}")


def aggregation(method: Any, law: str, times: Sequence[float], seed: int = 7) -> None:
    """Moments, densities and collisions of pure aggregation, the volume doubled again and again.

    The bias of finite systems is of order 1/N, here below a tenth of a standard error.
    """
    particles = 10_000
    ds = sx.simulate(
        model(law), times, method=method, particles=particles, replicas=32, seed=seed, sizes=32
    )
    truth = solution(law)
    _means(ds, truth, (0, 2, 3), (1, 2, 5, 20))
    agree(ds["collisions"].values, truth.simulated_collisions(np.array(times), particles), "events")


def shattering(method: Any, seed: int = 8) -> None:
    """The constant kernel with shattering, in full time dependence, with doubling."""
    ds = sx.simulate(
        model("constant", 0.1), [1.0, 10.0, 50.0], method=method, particles=10_000, replicas=32,
        seed=seed, sizes=32,
    )  # fmt: skip
    assert (np.diff(ds["volume"].values) >= 0).all()
    assert (ds["volume"].values[:, -1] > 10_000).all()
    _means(ds, solution("constant", 0.1), (0, 2, 3), (1, 2, 5, 20))


def against(method: Any, reference: dict[float, dict[int, float]], seed: int = 9) -> Any:
    """The ballistic kernel with shattering at 0.01 against moments from the rate equations."""
    times = sorted(reference)
    ds = sx.simulate(
        model("ballistic", 0.01), times, method=method, particles=10_000, replicas=32, seed=seed,
        sizes=32,
    )  # fmt: skip
    assert ds.attrs["warnings"] == "[]"
    for order in (0, 2, 3):
        expected = [reference[t][order] for t in times]
        agree(ds["moment"].sel(order=order).values, expected, f"M{order}")
    return ds


def gelation(method: Any, seed: int = 10) -> None:
    """The multiplicative kernel through its gel point, in a fixed volume: a random graph.

    Against the exact means of a finite system, where the gel is one giant cluster that reacts with
    the rest (Flory).
    """
    particles, replicas, times = 150, 600, (0.8, 1.5)
    ds = finite(
        "multiplicative", times, method, particles=particles, replicas=replicas, seed=seed,
        sizes=particles,
    )  # fmt: skip
    law = exact.finite.law("multiplicative", particles)
    agree(ds["particles"].values, [law.number_mean(t) for t in times], "clusters")
    agree(ds["moment"].sel(order=2).values, [law.second_moment(t) for t in times], "M2")
    for k, t in enumerate(times):
        for low, high in ((1, 2), (2, 3), (3, 10), (10, 50), (50, 100), (100, 151)):
            expected = law.counts(t, np.arange(low, high)).sum()
            found = ds["n"].values[:, k, low - 1 : high - 1].sum(axis=1) * particles
            if expected * replicas > 300:
                agree(found, expected, (t, low, high))
    # of clusters of more than half of the mass there is one at most: the gel
    sizes = np.arange(particles // 2 + 1, particles + 1)
    gel = np.where(ds["largest"].values > particles // 2, ds["largest"].values, 0.0)
    agree(gel[:, 1], law.counts(times[1], sizes) @ sizes, "gel")
    assert ds["largest"].values[:, 0].mean() < 0.3 * particles


# --- what has no exceptions ----------------------------------------------------------------------


def mass(method: Any, law: str, population: str, seed: int = 11) -> None:
    """Mass as an integer, for every replica and time."""
    particles, times = 500, np.linspace(0.5, 20, 8)
    ds = sx.simulate(
        model(law, 0.05), times, method=method, population=population, particles=particles,
        replicas=6, seed=seed, distribution=True,
    )  # fmt: skip
    for replica in range(6):
        for k, t in enumerate(times):
            sizes, counts = sx.results.population(ds, replica, float(t))
            doubled = ds["volume"].values[replica, k] / particles
            assert int(sizes @ counts) == particles * int(doubled)
            assert int(counts.sum()) == int(ds["particles"].values[replica, k])
    np.testing.assert_array_equal(ds["events"].sum("process"), ds["collisions"])
    np.testing.assert_allclose(ds["moment"].sel(order=1), 1.0, rtol=1e-12)


def agreement(methods: Sequence[Any], law: str, seed: int = 12) -> None:
    """Methods differ by chance alone, here with sizes beyond the buckets of the inverse method."""
    replicas = 48
    results = [
        sx.simulate(
            model(law, 0.01), [2.0, 10.0], method=method, particles=2000, replicas=replicas,
            seed=seed + k, sizes=32,
        )
        for k, method in enumerate(methods)
    ]  # fmt: skip
    for other in results[1:]:
        for name in ("moment", "collisions", "largest"):
            a, b = results[0][name].values, other[name].values
            error = np.sqrt((a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / replicas)
            # the mass has no spread
            z = (a.mean(axis=0) - b.mean(axis=0))[error > 0] / error[error > 0]
            assert np.abs(z).max() < SIGMAS, (name, z)
