"""Means, intervals, deviations and the joint test: held against their definitions by trial."""

import numpy as np
import pytest
from scipy import stats

from smolux.analysis.joint import Rows, score_test, total_test
from smolux.analysis.statistics import (
    deviation,
    normal_equivalent,
    over_replicas,
    quantile,
    welch,
)


def test_mean_and_standard_error_leave_out_what_was_not_observed():
    values = np.array([[1.0, 2.0, np.nan], [3.0, np.nan, np.nan], [5.0, np.nan, np.nan]])
    count, mean, error = over_replicas(values)
    assert count.tolist() == [3, 1, 0]
    assert mean[:2].tolist() == [3, 2]
    assert error[0] == pytest.approx(2 / np.sqrt(3))
    assert np.isnan(mean[2])
    assert np.isnan(error[1:]).all()


def test_equal_values_have_no_spread_at_all():
    _, mean, error = over_replicas(np.full((8, 1), 0.1 + 0.2))
    assert mean[0] == 0.1 + 0.2
    assert error[0] == 0


def test_student_quantile():
    assert quantile(8) == pytest.approx(2.364624, rel=1e-6)
    assert quantile(2) == pytest.approx(12.7062, rel=1e-5)
    assert np.isnan(quantile([0, 1])).all()


def test_deviates_have_the_probability_of_student():
    assert normal_equivalent(2.364624, 7) == pytest.approx(1.959964, abs=1e-5)
    assert normal_equivalent(-12.7062, 1) == pytest.approx(-1.959964, abs=1e-5)
    assert normal_equivalent(3.0, np.inf) == 3
    assert np.isnan(normal_equivalent(3.0, 0))
    assert np.isfinite(normal_equivalent(1e9, 1e9))


@pytest.mark.parametrize("replicas", [2, 3, 8])
def test_deviates_of_small_samples_are_standard_normal(replicas):
    rng = np.random.default_rng(7)
    count, mean, error = over_replicas(rng.standard_normal((replicas, 4000)))
    z = deviation(mean, error, count - 1, 1.0)
    assert stats.kstest(z, "norm").pvalue > 1e-3


def test_deviation_without_spread():
    # rounding is no difference
    assert deviation(1e-16, 0.0, 7, 1.0) == 0
    # nothing is known of the error
    assert np.isnan(deviation(1e-3, 0.0, 7, 1.0))
    # but some differences no chance explains
    assert deviation(-1e-1, 0.0, 7, 1.0, certain=1e-2) == -np.inf
    assert np.isnan(deviation(0.1, np.nan, 0, 1.0))


def test_welch():
    # unequal variances, numbers of scipy.stats.ttest_ind(equal_var=False)
    a, b = np.array([1.0, 2, 4, 7]), np.array([3.0, 3.5, 3.1])
    (na, ma, ea), (nb, mb, eb) = over_replicas(a), over_replicas(b)
    known = stats.ttest_ind(a, b, equal_var=False)
    assert welch(ea, na, eb, nb) == pytest.approx(known.df)
    assert (ma - mb) / np.hypot(ea, eb) == pytest.approx(known.statistic)
    assert welch(ea, na, 0.0, 1) == pytest.approx(3)


def trial(rng, root, replicas, other, shift=0.0, volume=1.0):
    """Compare two samples of the same correlated law; `other` 0 for an exact mean."""
    m = len(root)
    first = shift + rng.standard_normal((replicas, m)) @ root.T
    if other:
        second = rng.standard_normal((other, m)) @ root.T / np.sqrt(volume)
        rows = Rows.of_two(first, second, (np.ones(replicas), np.full(other, volume)))
    else:
        rows = Rows.of_one(first, np.zeros(m), np.ones(replicas))
    assert rows.freedom == replicas + other - (2 if other else 1)
    scale = np.linspace(0.5, 2.0, m)
    return score_test(rows, scale), total_test(rows, scale)[0]


def root_of(correlation, m=25):
    k = np.arange(m)
    return np.linalg.cholesky(correlation ** np.abs(k[:, None] - k) + 1e-12 * np.eye(m))


@pytest.mark.parametrize(("replicas", "other"), [(3, 0), (8, 0), (8, 8), (3, 8)])
@pytest.mark.parametrize("correlation", [0.0, 0.9])
def test_joint_tests_have_their_level(replicas, other, correlation):
    rng = np.random.default_rng(11)
    root, trials = root_of(correlation), 2000
    volume = 4.0 if replicas != other else 1.0
    p, total = np.array([trial(rng, root, replicas, other, volume=volume) for _ in range(trials)]).T
    # one standard deviation of the share is 0.5 %
    assert abs(np.mean(p < 0.05) - 0.05) < 0.02
    assert stats.kstest(p, "uniform").pvalue > 1e-4
    assert np.mean(total < 0.05) < 0.07
    assert np.mean(total < 0.001) < 0.008


def test_the_score_finds_what_all_entries_share():
    """Two standard errors in each of 25 entries, which no entry shows by itself."""
    rng = np.random.default_rng(12)
    found = [trial(rng, root_of(0.3), 8, 0, shift=2 / np.sqrt(8))[0] for _ in range(200)]
    assert np.mean(np.array(found) < 0.005) > 0.5
    # with three replicas: a shift that all share by 20 standard errors
    found = [trial(rng, root_of(0.3), 3, 0, shift=20 / np.sqrt(3)) for _ in range(200)]
    assert np.mean(np.min(found, axis=1) < 0.0025) > 0.95


def test_the_scatter_of_fully_correlated_entries_counts_once():
    row = np.random.default_rng(3).standard_normal((8, 1)) + 0.5
    wide = Rows.of_one(np.repeat(row, 40, axis=1), np.zeros(40), np.ones(8))
    expected = stats.ttest_1samp(row[:, 0], 0.0).pvalue
    assert score_test(wide, np.ones(40)) == pytest.approx(expected, rel=1e-9)
    p, _, freedom = total_test(wide, np.ones(40))
    assert (p, freedom) == pytest.approx((expected, 1))
