"""Intervals of few samples, held against what they promise by trial."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import smolux as sx
from shared import FORMULA
from smolux.confidence import (
    Sample,
    count_interval,
    enlarged,
    freedom,
    mean_interval,
    quantile,
    skewed,
    vague,
    variance_interval,
    variance_vague,
)

#: trials of each coverage: one standard deviation is 0.34 %
TRIALS = 4000


def lognormal(sigma: float) -> stats.rv_continuous:
    return stats.lognorm(sigma)


#: laws like those of moments: skewness 0, 2, 1.75, 3.3, and one to the left
LAWS = {
    "normal": stats.norm(100),
    "exponential": stats.expon(),
    "third moment": lognormal(0.5),
    "near a gel": lognormal(0.75),
    "to the left": stats.beta(8, 1),
}


def drawn(law: str, count: int, seed: int = 4) -> np.ndarray:
    return LAWS[law].rvs((count, TRIALS), random_state=np.random.default_rng(seed))


def covered(ends: tuple[np.ndarray, np.ndarray], value: float) -> float:
    return float(np.mean((ends[0] <= value) & (value <= ends[1])))


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("count", [8, 16, 32])
def test_the_interval_of_a_mean_holds_for_skewed_laws(law: str, count: int) -> None:
    """93 to 97 % where 95 are promised, and 0.9 % for chance; Student's holds in 86 to 95 %."""
    sample = Sample.of(drawn(law, count))
    held = covered(mean_interval(sample), float(LAWS[law].mean()))
    assert 0.92 < held < 0.979
    if law == "near a gel" and count == 8:
        half = quantile(count) * sample.error
        assert covered((sample.mean - half, sample.mean + half), LAWS[law].mean()) < 0.90


def test_the_third_moment_of_an_additive_kernel() -> None:
    """Groups of 8 of 8000 replicas; one standard deviation of a share is 0.7 %."""
    kernel = sx.kernels.formula(FORMULA, c0=0.0, c1=1.0, c2=0.0, c3=0.0)
    model = sx.Model(kernel, [sx.processes.Aggregation(), sx.processes.Shattering(0.0)])
    ds = sx.simulate(
        model, [1.0], method="acceptance-rejection", particles=200, replicas=8000, seed=1, sizes=8,
        population="fixed-volume",
    )  # fmt: skip
    values = ds["moment"].sel(order=3).values[:, 0]
    sample = Sample.of(values.reshape(-1, 8).T)
    half = quantile(8) * sample.error
    assert covered((sample.mean - half, sample.mean + half), values.mean()) < 0.87
    held = covered(mean_interval(sample), values.mean())
    doubtful = vague(sample).mean()
    assert held > 0.95 - 4 * 0.007 or (held > 0.9 and doubtful > 0.2)


def test_samples_of_a_normal_law_have_no_kurtosis_on_average() -> None:
    """And their variance follows a chi-square law with one degree of freedom less than samples."""
    sample = Sample.of(drawn("normal", 8))
    for known in (sample.skewness, sample.excess):
        assert abs(known.mean()) < 4 * known.std() / np.sqrt(TRIALS)
    assert float(freedom(Sample.from_sums(8, *np.array([3.0, 7.0, 0.0, 1.0])))) == pytest.approx(7)


def test_a_normal_law_costs_little() -> None:
    sample = Sample.of(drawn("normal", 8))
    lower, upper = mean_interval(sample)
    assert np.median((upper - lower) / (2 * quantile(8) * sample.error)) < 1.1


def test_the_same_allowance_in_deviations_and_intervals() -> None:
    sample = Sample.of(drawn("third moment", 8))
    value = float(LAWS["third moment"].mean())
    t = skewed((sample.mean - value) / sample.error, sample)
    lower, upper = mean_interval(sample)
    inside = (lower <= value) & (value <= upper)
    assert np.array_equal(np.abs(t) <= quantile(8), inside)


@pytest.mark.parametrize(("law", "count"), [("normal", 8), ("normal", 32), ("exponential", 400)])
def test_the_interval_of_a_variance_holds(law: str, count: int) -> None:
    held = covered(variance_interval(Sample.of(drawn(law, count))), float(LAWS[law].var()))
    assert 0.93 < held < 0.98


def test_a_variance_of_a_law_with_a_tail_holds_or_is_called_doubtful() -> None:
    sample = Sample.of(drawn("exponential", 8))
    lower, upper = variance_interval(sample)
    assert covered((lower, upper), 1.0) > 0.87  # without kurtosis 0.78, without skewness 0.85
    assert variance_vague(sample).mean() > 0.3
    assert variance_vague(Sample.of(drawn("normal", 8))).mean() < 0.05


def test_what_cannot_be_known_is_said() -> None:
    heavy = np.exp(1.5 * np.random.default_rng(3).standard_normal((8, TRIALS)))
    held = covered(mean_interval(Sample.of(heavy)), np.exp(1.5**2 / 2))
    assert held < 0.93
    assert vague(Sample.of(heavy)).mean() > 0.8
    assert not vague(Sample.of(drawn("normal", 8))).any()
    assert vague(Sample.of(drawn("normal", 3))).all()
    assert not vague(Sample.of(np.ones((8, 3)))).any()


@pytest.mark.parametrize("expected", [1.1, 5.0, 20.0])
def test_the_interval_of_a_count_holds(expected: float) -> None:
    lower, upper = count_interval(np.arange(200.0))
    share = stats.poisson(expected).pmf(np.arange(200))
    assert 0.92 < share[(lower <= expected) & (expected <= upper)].sum() < 0.985


def test_few_samples_have_intervals_too() -> None:
    for count in (1, 2, 3):
        sample = Sample.of(drawn("normal", count))
        lower, upper = mean_interval(sample)
        assert np.isnan(lower).all() if count == 1 else np.isfinite(lower).all()
        if count > 1:
            assert covered((lower, upper), 100.0) > 0.93
    assert np.isnan(variance_interval(Sample.of(drawn("normal", 1)))[0]).all()


@pytest.mark.parametrize("law", ["normal", "third moment"])
def test_the_number_of_samples_is_enough_four_times_in_five(law: str) -> None:
    """From a first batch of 8: the half width that so many give is as wanted, or shorter."""
    true = LAWS[law]
    needed = enlarged(Sample.of(drawn(law, 8)), 0.2 * true.std())
    really = (1.96 / 0.2) ** 2
    assert 0.75 < np.mean(needed >= really) < 0.97
