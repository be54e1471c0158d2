"""Means, intervals, deviations and the joint test: held against their definitions by trial."""

import numpy as np
import pytest
from scipy import stats

from smolux.analysis.statistics import (
    deviation,
    joint_test,
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


def trial(rng, root, replicas, other):
    """Compare two samples of the same correlated law; `other` 0 for an exact mean."""
    m = len(root)
    samples = [rng.standard_normal((r, m)) @ root.T for r in (replicas, other) if r]
    counts, means, errors = zip(*map(over_replicas, samples), strict=True)
    if not other:
        counts, means, errors = (*counts, 1), (*means, 0.0), (*errors, 0.0 * errors[0])
    error = np.hypot(*errors)
    z = deviation(means[0] - means[1], error, welch(errors[0], counts[0], errors[1], counts[1]), 1)
    scaled = [(s - s.mean(0)) / (error * np.sqrt(len(s) * (len(s) - 1))) for s in samples]
    return joint_test(z, np.concatenate(scaled))[0]


@pytest.mark.parametrize(("replicas", "other"), [(3, 0), (8, 0), (8, 8), (2, 2)])
@pytest.mark.parametrize("correlation", [0.0, 0.7, 0.97])
def test_joint_test_rarely_rejects_equal_laws(replicas, other, correlation):
    rng = np.random.default_rng(11)
    k = np.arange(25)
    root = np.linalg.cholesky(correlation ** np.abs(k[:, None] - k) + 1e-12 * np.eye(25))
    p = np.array([trial(rng, root, replicas, other) for _ in range(1000)])
    assert np.mean(p < 0.05) < 0.07
    assert np.mean(p < 0.001) < 0.007
    assert 0.3 < p.mean() < 0.6


def test_joint_test_counts_fully_correlated_entries_once():
    rng = np.random.default_rng(3)
    row = rng.standard_normal((8, 1)) @ np.ones((1, 40))
    rows = (row - row.mean(0)) / np.sqrt(((row - row.mean(0)) ** 2).sum(0))
    p, chi_square, dof = joint_test(np.full(40, 1.5), rows)
    assert (chi_square, dof) == pytest.approx((1.5**2, 1))
    assert p == pytest.approx(2 * stats.norm.sf(1.5))
