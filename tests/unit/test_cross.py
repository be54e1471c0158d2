"""Factors of kernels, and the sums over pairs that use them."""

from __future__ import annotations

import numpy as np
import pytest

import smolux as sx
from smolux.deterministic.cross import (
    MAX_RANK,
    cross_approximation,
    given_factors,
    interpolation,
)
from smolux.deterministic.operator import Direct, LowRank, OperatorFactory
from smolux.deterministic.trial import Sample
from smolux.errors import InputError

LAWS = [sx.kernels.by_name(name) for name in ("brownian", "ballistic", "shear")]


def matrix(kernel, m):
    k = np.arange(1.0, m + 1.0)
    return kernel(k[:, None], k[None, :])


def sums(kernel, n):
    """Loss, gain, and gain of the sizes up to twice the last one, by two plain loops."""
    m = len(n)
    values = matrix(kernel, m)
    gain = np.zeros(2 * m)
    for i in range(m):
        for j in range(m):
            gain[i + j + 1] += 0.5 * values[i, j] * n[i] * n[j]
    return values @ n, gain[:m], gain[m:]


def densities(m, count=3):
    rng = np.random.default_rng(1)
    return np.exp(-np.arange(m) / (m / 20)) * rng.random((count, m))


@pytest.mark.parametrize("tolerance", [1e-5, 1e-9])
@pytest.mark.parametrize("law", LAWS)
def test_every_entry_is_within_the_tolerance(law, tolerance):
    kernel = law()
    factors = cross_approximation(Sample(kernel, 700), tolerance)
    exact = matrix(kernel, 700)
    found = factors.rows.T @ factors.core @ factors.rows
    assert np.abs(found / exact - 1).max() < 10 * tolerance
    assert factors.rank <= MAX_RANK
    np.testing.assert_allclose(found, found.T, rtol=1e-13)


def test_exact_ranks_are_found():
    for text, rank in (
        ("1.0 + 0*i*j", 1),
        ("i + j", 2),
        ("i*j", 1),
        ("(i/j)**0.9 + (j/i)**0.9", 2),
        ("(cbrt(i) + cbrt(j)) * (1/cbrt(i) + 1/cbrt(j))", 3),
    ):
        factors = cross_approximation(Sample(sx.kernels.formula(text), 3000), 1e-9)
        assert factors.rank == rank, text
        assert factors.error < 1e-9


def test_function_of_the_sum_is_split_off():
    factors = cross_approximation(Sample(sx.kernels.Ballistic(), 2000), 1e-11, power=0.5)
    assert factors.rank == 3
    assert factors.error < 1e-12
    exact = matrix(sx.kernels.Ballistic(), 2000)
    np.testing.assert_allclose(factors.columns(5), exact[:, :5], rtol=1e-11)


def test_units_do_not_matter():
    factors = cross_approximation(Sample(sx.kernels.Ballistic(scale=1e-17), 1000), 1e-9)
    assert factors.error < 1e-8


def test_far_from_low_rank_is_told():
    assert cross_approximation(Sample(sx.kernels.Sedimentation(), 2000), 1e-6) is None
    with pytest.raises(InputError, match="far from low rank"):
        OperatorFactory(sx.kernels.Sedimentation(), "low-rank", 1e-9)(2000)
    assert isinstance(OperatorFactory(sx.kernels.Sedimentation(), "auto", 1e-9)(500), Direct)


def test_a_ridge_between_the_nodes_is_seen():
    def ridge(i, j):
        return 1.0 + 5.0 * np.exp(-((i - 613.0) ** 2)) + 5.0 * np.exp(-((j - 613.0) ** 2))

    kernel = sx.kernels.from_function(ridge)
    operator = OperatorFactory(kernel, "auto", 1e-9)(1000)
    np.testing.assert_allclose(operator.columns(1000), matrix(kernel, 1000), rtol=1e-8)


def test_kernel_that_vanishes_for_most_pairs():
    # monomers are added, nothing else happens: X1 of the theory of addition and shattering
    kernel = sx.kernels.from_function(lambda i, j: 1.0 * ((i == 1) | (j == 1)) + 1.0 * (i * j == 1))
    factors = cross_approximation(Sample(kernel, 300), 1e-9)
    found = factors.rows.T @ factors.core @ factors.rows
    np.testing.assert_allclose(found, matrix(kernel, 300), atol=1e-9)


def test_interpolation_is_nearly_exact():
    for kernel in (sx.kernels.Ballistic(), sx.kernels.Brownian()):
        factors = interpolation(Sample(kernel, 3000))
        assert Sample(kernel, 3000).errors(factors).max() < 1e-12
    assert interpolation(Sample(sx.kernels.Sedimentation(), 3000)) is None


def test_given_factors_hold_each_row_once():
    kernel = sx.kernels.GeneralizedBrownian(0.95)
    factors = given_factors(Sample(kernel, 500))
    assert factors.rank == 2
    np.testing.assert_allclose(
        factors.rows.T @ factors.core @ factors.rows, matrix(kernel, 500), rtol=1e-13
    )
    assert given_factors(Sample(sx.kernels.Ballistic(), 10)) is None


@pytest.mark.parametrize("law", [*LAWS, sx.kernels.by_name("sedimentation")])
@pytest.mark.parametrize("m", [4, 5, 37, 200])
def test_direct_sums(law, m):
    kernel, n = law(), densities(m)
    operator = Direct(kernel, m)
    for row in n:
        loss, gain, beyond = sums(kernel, row)
        np.testing.assert_allclose(operator.loss(row[None])[0], loss, rtol=1e-12)
        np.testing.assert_allclose(operator.gain(row[None])[0], gain, rtol=1e-11, atol=1e-300)
        np.testing.assert_allclose(operator.beyond(row), beyond, rtol=1e-11, atol=1e-300)
    operator._cache = None  # the same without a kept matrix
    np.testing.assert_allclose(operator.gain(n)[0], sums(kernel, n[0])[1], rtol=1e-11, atol=1e-300)


@pytest.mark.parametrize("law", [*LAWS, sx.kernels.by_name("multiplicative")])
def test_low_rank_sums_are_right_far_into_the_tail(law):
    kernel, n = law(), densities(300)
    operator = OperatorFactory(kernel, "low-rank", 1e-13)(300)
    assert isinstance(operator, LowRank)
    operator.prepare(n[0])
    loss, gain, _ = sums(kernel, n[0])
    np.testing.assert_allclose(operator.loss(n)[0], loss, rtol=1e-11)
    # densities span nine decades: without the tilt the end of the gain would be noise
    np.testing.assert_allclose(operator.gain(n)[0][1:], gain[1:], rtol=1e-9)
    operator.prepare(None)
    assert np.abs(operator.gain(n)[0] - gain).max() < 1e-13 * gain.max()
    np.testing.assert_allclose(operator.columns(7), matrix(kernel, 300)[:, :7], rtol=1e-11)


def test_mass_balance_of_the_sums():
    # what the loss takes and the gain gives differ by what passes the edge: next to nothing here
    k = np.arange(1.0, 2001.0)
    n = np.exp(-k / 20)[None, :]
    for kernel in (sx.kernels.Ballistic(), sx.kernels.formula("1 + sqrt(i*j)/(1 + sqrt(i + j))")):
        operator = OperatorFactory(kernel, "low-rank", 1e-9)(2000)
        operator.prepare(n[0])
        lost = (n * operator.loss(n)) @ k
        assert abs(lost - operator.gain(n) @ k) < 3e-12 * lost
