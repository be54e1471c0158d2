"""Whether every method obeys the exact laws, on the machine at hand: ``smolux verify``.

Each check compares a simulation with an exact law of the stochastic process or of the rate
equations, and ends in a probability p: how often a right program would differ as much by chance.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import smolux

from . import analysis, exact, initial, kernels, processes
from .errors import quiet
from .kernels.base import Kernel
from .methods import METHODS
from .model import Model
from .processes.base import PairProcess

Float = NDArray[np.float64]

#: a check fails below this probability; about twenty are made, so a right program fails one in 500
SIGNIFICANCE = 1e-4


@dataclass(frozen=True)
class Finding:
    """What a check has found.

    Attributes
    ----------
    method, check : str
        Names.
    measured, expected : str
        The quantity that says most, as text.
    p : float
        Probability of such a difference if all is right; 1 or 0 where a law has no exception.
    seconds : float
        Wall time, compilation included.
    """

    method: str
    check: str
    measured: str
    expected: str
    p: float
    seconds: float

    @property
    def passed(self) -> bool:
        """Whether chance explains the difference."""
        return self.p > SIGNIFICANCE


@dataclass(frozen=True)
class Verdict:
    """What a check measured and expected, and the probability of the difference."""

    measured: str
    expected: str
    p: float


@dataclass(frozen=True)
class Check:
    """A law and how it is tested.

    Attributes
    ----------
    name : str
        The law.
    test : callable
        ``test(method, seed) -> Verdict``.
    """

    name: str
    test: Callable[[str, int], Verdict]


def _model(kernel: Kernel, shattering: Any = None) -> Model:
    outcomes: list[PairProcess] = [processes.Aggregation()]
    if shattering is not None:
        outcomes.append(processes.Shattering(shattering))
    return Model(kernel, outcomes, initial.monodisperse())


def _finite(model: Model, times: Sequence[float], method: str, seed: int, **settings: Any) -> Any:
    """Simulate the process of a finite number of particles in its fixed volume."""
    return smolux.simulate(
        model, times, method=method, seed=seed, population="fixed-volume", **settings
    )


# --- probabilities -----------------------------------------------------------------------------


def two_sided(z: float) -> float:
    """Probability of a standard normal deviate beyond ``|z|``."""
    return math.erfc(abs(z) / math.sqrt(2))


def chi_square(observed: Float, expected: Float, least: float = 5.0) -> tuple[float, int, float]:
    """Pearson's test of counts; those expected below `least` are put together.

    Returns
    -------
    chi2, dof, p
    """
    from scipy import stats

    order = np.argsort(expected)
    observed, expected = observed[order], expected[order]
    rare = max(int(np.searchsorted(np.cumsum(expected), least)) + 1, 1)
    observed = np.append(observed[rare:], observed[:rare].sum())
    expected = np.append(expected[rare:], expected[:rare].sum())
    value = float(np.sum((observed - expected) ** 2 / expected))
    return value, len(expected) - 1, float(stats.chi2.sf(value, len(expected) - 1))


def variance_p(sample: Float, variance: float) -> float:
    """Two-sided probability of a sample variance, for a nearly normal quantity."""
    from scipy import stats

    dof = len(sample) - 1
    below = float(stats.chi2.cdf(dof * float(np.var(sample, ddof=1)) / variance, dof))
    return min(1.0, 2 * min(below, 1 - below))


# --- the laws ------------------------------------------------------------------------------------


def mean_field(model: Model, times: Sequence[float], seed_shift: int) -> Callable[..., Verdict]:
    """Return a test of M0 .. M3 and size densities against the exact solution, with doubling."""

    def test(method: str, seed: int) -> Verdict:
        ds = smolux.simulate(
            model, times, method=method, particles=50_000, replicas=32, sizes=256,
            seed=seed + seed_shift,
        )  # fmt: skip
        found = analysis.compare(ds, "exact")
        last = found["number_density"].isel(time=-1)
        first, second = (float(last.sel(statistic=s)) for s in ("first", "second"))
        p = min(found.attrs["p_value"], found.attrs["p_largest"])
        return Verdict(f"M0 = {first:.6g}", f"{second:.6g}", p)

    return test


def fluctuations(kernel: Kernel, name: str) -> Callable[..., Verdict]:
    """Return a test of mean and variance of the number of clusters at N = 10^4, t = 0.6."""

    def test(method: str, seed: int) -> Verdict:
        particles, replicas, t = 10_000, 400, 0.6
        law = exact.finite.law(name, particles)
        ds = _finite(
            _model(kernel), [t], method, seed, particles=particles, replicas=replicas, sizes=16
        )
        number = ds["particles"].values[:, 0]
        mean, variance = law.number_moments(t)
        z = float(number.mean() - mean) / math.sqrt(variance / replicas)
        # two tests in one: the smaller probability of two
        p = min(1.0, 2 * min(two_sided(z), variance_p(number, variance)))
        spread = f"{number.mean():.1f} ± {number.std(ddof=1):.1f}"
        return Verdict(spread, f"{mean:.1f} ± {math.sqrt(variance):.1f}", p)

    return test


def partitions(kernel: Kernel, shattering: float) -> Callable[..., Verdict]:
    """Return a test of all sizes present at once, against the Markov chain at N = 8."""

    def test(method: str, seed: int) -> Verdict:
        particles, replicas, t = 8, 20_000, 1.5
        model = _model(kernel, shattering or None)
        ds = _finite(model, [t], method, seed, particles=particles, replicas=replicas, sizes=8)
        volume = ds["volume"].values[:, 0, None]
        counts = np.rint(ds["n"].values[:, 0] * volume).astype(int)
        states, pmf = exact.finite.partition_pmf(kernel, particles, t, shattering=shattering)
        number = {state: k for k, state in enumerate(states)}
        sizes = np.arange(8, 0, -1)
        seen = np.zeros(len(states))
        patterns, times = np.unique(counts, axis=0, return_counts=True)
        for pattern, many in zip(patterns, times, strict=True):
            seen[number[tuple(np.repeat(sizes, pattern[::-1]).tolist())]] = many
        value, dof, p = chi_square(seen, pmf * replicas)
        return Verdict(f"χ² = {value:.1f}", f"{dof} ± {math.sqrt(2 * dof):.0f}", p)

    return test


def waiting(
    kernel: Kernel, particles: int, cdf: Callable[[Float], Float]
) -> Callable[..., Verdict]:
    """Return a test of the law of the time at which one cluster is left (Kolmogorov-Smirnov)."""

    def test(method: str, seed: int) -> Verdict:
        from scipy import stats

        replicas = 5000
        ds = _finite(
            _model(kernel), [500.0], method, seed, particles=particles, replicas=replicas, sizes=8
        )
        found = stats.kstest(ds["extinction_time"].values, cdf)
        usual = float(stats.kstwobign.median()) / math.sqrt(replicas)
        return Verdict(f"D = {found.statistic:.4f}", f"{usual:.4f}", float(found.pvalue))

    return test


def _pair(t: Float) -> Float:
    """Return the law of the one collision of two particles: the rate is 1/V = 1/2."""
    return -np.expm1(-t / 2)


def _five(t: Float) -> Float:
    """Return the law of the last merger of five, additive kernel: all four independent mergers."""
    return (-np.expm1(-t)) ** 4


def thinning() -> Callable[..., Verdict]:
    """Return a test of a rate that depends on time: shatterings of two monomers, λ = 1 + cos t.

    Two monomers in the volume 2 merge at the rate 1/2 and shatter, which changes nothing, at λ(t)
    times that rate, so the expected number of shatterings is the integral of
    ``λ(s) exp(-s/2) / 2`` up to t.
    """

    def test(method: str, seed: int) -> Verdict:
        replicas, t = 20_000, 3.0
        model = _model(kernels.Constant(), "1 + cos(t)")
        ds = _finite(model, [t], method, seed, particles=2, replicas=replicas, sizes=8)
        counted = ds["events"].sel(process="shattering").values[:, 0]
        s = np.linspace(0, t, 200_001)
        expected = float(np.trapezoid((1 + np.cos(s)) * np.exp(-s / 2) / 2, s))
        z = float(counted.mean() - expected) / (counted.std(ddof=1) / math.sqrt(replicas))
        return Verdict(f"{counted.mean():.4f}", f"{expected:.4f}", two_sided(z))

    return test


def mass(method: str, seed: int) -> Verdict:
    """Count the monomers of whole populations as integers, with shattering and doublings."""
    particles = 5000
    ds = smolux.simulate(
        _model(kernels.Ballistic(), 0.01), [0.5, 5.0, 20.0], method=method, particles=particles,
        replicas=4, seed=seed, distribution=True, sizes=64,
    )  # fmt: skip
    monomers = ds["sample_size"].values * ds["sample_count"].values
    rows = np.repeat(np.arange(ds.sizes["instance"]), ds["row_size"].values)
    totals = np.zeros(ds.sizes["instance"], np.int64)
    np.add.at(totals, rows, monomers)
    expected = np.rint(ds["volume"].values).astype(np.int64).ravel()
    wrong = int(np.count_nonzero(totals != expected))
    return Verdict(f"{wrong} of {totals.size} wrong", "0 wrong", float(wrong == 0))


def checks() -> tuple[Check, ...]:
    """Every check, in the order in which they run."""
    constant, additive, ballistic = kernels.Constant(), kernels.Additive(), kernels.Ballistic()
    return (
        Check("mean, K = 1", mean_field(_model(constant), (1, 10), 1)),
        Check("mean, K = i + j", mean_field(_model(additive), (0.5, 1), 2)),
        Check("mean, K = 1, shattering", mean_field(_model(constant, 0.1), (1, 10), 3)),
        Check("fluctuations, K = 1", fluctuations(constant, "constant")),
        Check("fluctuations, K = i + j", fluctuations(additive, "additive")),
        Check("N = 8, K = i + j", partitions(additive, 0.0)),
        Check("N = 8, shattering", partitions(ballistic, 0.1)),
        Check("waiting time, N = 2", waiting(constant, 2, _pair)),
        Check("time to one cluster, N = 5", waiting(additive, 5, _five)),
        Check("shattering rate λ(t)", thinning()),
        Check("mass, to the monomer", mass),
    )


def verify(
    methods: Iterable[str] | None = None, seed: int = 1, only: Sequence[Check] | None = None
) -> Iterator[Finding]:
    """Run the checks, one finding after another.

    Parameters
    ----------
    methods : iterable of str, optional
        Names of methods; all if left out.
    seed : int
        For all checks: the same seed gives the same findings.
    only : sequence of Check, optional
        Which checks; all if left out.

    Yields
    ------
    Finding
    """
    known = [m.name for m in METHODS]
    for name in known if methods is None else methods:
        for check in only or checks():
            begun = time.perf_counter()
            # other random numbers for each method
            with quiet():  # small systems end as one cluster, and laws say when
                verdict = check.test(name, seed + 1000 * known.index(name))
            yield Finding(
                name, check.name, verdict.measured, verdict.expected, verdict.p,
                time.perf_counter() - begun,
            )  # fmt: skip
