"""Sums over pairs: what the moments need of them, from densities of every shape."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import smolux as sx
from smolux.deterministic.low_rank import LowRank
from smolux.deterministic.operator import Direct, OperatorFactory

M = 1500
K = np.arange(1.0, M + 1.0)
POWERS = K ** np.arange(4)[:, None]
LAWS = [sx.kernels.Constant(), sx.kernels.Additive(), sx.kernels.Brownian(), sx.kernels.Ballistic()]


def at(**densities):
    n = np.zeros(M)
    for size, density in densities.items():
        n[int(size[1:]) - 1] = density
    return n


SHAPES = {
    "monomers": at(k1=1.0),
    "one size": at(k300=1.0),
    "two sizes": at(k1=1.0, k60=1e-3),
    "few large ones": at(k1=1.0, k1000=1e-12),
    "multiples": np.where(K % 32 == 0, np.exp(-K / 50), 0.0),
    "exponential": np.exp(-K / 20),
    "two scales": np.exp(-K / 3) + np.exp(-K / 200) / 200,
    "power law": K**-1.5 * np.exp(-K / 300),
    "pedestal": np.exp(-K / 10) + 1e-17 * (K < 1000),
    "fall beyond doubles": np.exp(-np.minimum(K / 4, 700.0)),
    **{
        f"lognormal {median} {sigma}": sx.initial.lognormal(median, sigma).densities(M)
        for median, sigma in ((20, 2), (1, 2.5), (1, 3), (2, 4), (15, 2), (1000, 1.01))
    },
}


@pytest.mark.parametrize("kernel", LAWS, ids=lambda kernel: kernel.name)
@pytest.mark.parametrize("shape", SHAPES)
def test_gains_of_the_moments(shape, kernel):
    n = SHAPES[shape]
    operator = OperatorFactory(kernel, "low-rank", 1e-9)(M)
    assert isinstance(operator, LowRank)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        operator.prepare(n)
        gain = operator.gain(n[None])[0]
        lost = POWERS @ (n * operator.loss(n[None])[0])
    exact = _direct(kernel).gain(n[None])[0]
    error = POWERS @ np.abs(gain - exact)
    # 1e-13: the rounding of the factors themselves, and of the direct sum
    assert (error <= operator.noise + 1e-13 * lost).all(), (error, operator.noise, lost)
    assert (operator.noise <= 1e-9 * lost).all()
    assert (error <= 2e-11 * lost).all()


def _direct(kernel):
    if kernel not in _KEPT:
        _KEPT[kernel] = Direct(kernel, M)
    return _KEPT[kernel]


_KEPT: dict[sx.kernels.Kernel, Direct] = {}


def test_small_sizes_are_parted_where_one_tilt_cannot_do():
    operator = OperatorFactory(sx.kernels.Constant(), "low-rank", 1e-12)(M)
    for shape, parts in (("lognormal 1 3", 2), ("exponential", 1)):
        operator.prepare(SHAPES[shape])
        assert len(operator._parts) == parts


@pytest.mark.parametrize("kernel", LAWS[::3], ids=lambda kernel: kernel.name)
def test_densities_that_grow_where_they_are_amplified(kernel):
    # monomers alone allow any tilt; the largest size has e**300 of it
    operator = OperatorFactory(kernel, "low-rank", 1e-9)(M)
    operator.prepare(SHAPES["monomers"])
    for shape in ("exponential", "lognormal 1 3", "two scales"):
        n = SHAPES[shape]
        error = POWERS @ np.abs(operator.gain(n[None])[0] - _direct(kernel).gain(n[None])[0])
        lost = POWERS @ (n * operator.loss(n[None])[0])
        assert (error <= 1e-9 * lost).all()


def test_any_vector_may_follow():
    operator = OperatorFactory(sx.kernels.Constant(), "low-rank", 1e-9)(M)
    operator.prepare(SHAPES["exponential"])
    operator.prepare(None)
    n = np.cos(K)
    np.testing.assert_allclose(
        operator.gain(n[None])[0], _direct(sx.kernels.Constant()).gain(n[None])[0], atol=1e-11
    )


@pytest.mark.parametrize(("median", "sigma"), [(20, 2), (1, 2.5), (1, 3), (2, 2.5), (15, 2)])
def test_lognormal_starts(median, sigma):
    # K = 1: N = 2 N0 / (2 + N0 t) from any start, and M2 = M2(0) + M1**2 t
    law = sx.initial.lognormal(median, sigma)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sx.SmoluxWarning)  # of the mass by rounding to whole sizes
        ds = sx.solve(sx.Model(sx.kernels.Constant(), initial=law), [0.0, 1.0])
    moment = ds["moment"].values[0]
    assert moment[1, 0] == pytest.approx(2 / 3, rel=1e-8)
    assert moment[1, 1] == pytest.approx(moment[0, 1], rel=1e-8)
    assert moment[1, 2] == pytest.approx(moment[0, 2] + moment[0, 1] ** 2, rel=1e-8)
    assert ds.attrs["steps"] < 50


def test_one_size_that_is_not_one():
    ds = sx.solve(sx.Model(sx.kernels.Constant(), initial=sx.initial.monodisperse(size=32)), [2.9])
    assert ds["number_density"].item() == pytest.approx(2 / 4.9, rel=1e-8)
    assert ds["moment"].values[0, 0, 2] == pytest.approx(32**2 * 3.9, rel=1e-8)


def test_lognormal_densities_are_exact_in_the_tail():
    from scipy import integrate, stats

    law = sx.initial.lognormal(20, 2)
    n = law.densities(6000)
    assert (n > 0).all()
    for k in (1, 5, 20, 700, 5000):
        exact = integrate.quad(
            stats.lognorm(np.log(2), scale=20).pdf, 0 if k == 1 else k - 0.5, k + 0.5
        )[0]
        assert n[k - 1] == pytest.approx(exact, rel=1e-7)
    np.testing.assert_allclose(n, np.diff(law.cumulative(np.arange(6001.0))), atol=2e-16)


def antidiagonal(i, j):
    return 1e-9 + 1.0 * (i + j == 1001)


RARE = {
    "a sum that the function names": sx.kernels.from_function(antidiagonal),
    "a sum in a formula": sx.kernels.formula("max(1e-9, 1 - abs(i + j - 1001))"),
    "a pair in a formula": sx.kernels.formula(
        "1e-9 + max(0, 1 - abs(i - 300) - abs(j - 501)) + max(0, 1 - abs(j - 300) - abs(i - 501))"
    ),
    "a pair that the function names": sx.kernels.from_function(
        lambda i, j: 1e-9 + 1.0 * (i * j == 300 * 501) * (i + j == 801)
    ),
    "a sum of no name": sx.kernels.from_function(
        lambda i, j, at=700.0: 1.0 - np.exp(-((i + j - at - 1) ** 2))
    ),
    "one size": sx.kernels.formula("1 + 5*exp(-(i - 613)**2) + 5*exp(-(j - 613)**2)"),
}


@pytest.mark.parametrize("case", RARE)
def test_what_is_rare_is_not_missed(case):
    kernel = RARE[case]
    operator = OperatorFactory(kernel, "auto", 1e-9)(1100)
    k = np.arange(1.0, 1101.0)
    np.testing.assert_allclose(
        operator.columns(1100), kernel(k[:, None], k), rtol=1e-8, atol=2e-6 * kernel(1, 2)
    )


def test_factors_that_miss_pairs_are_refused_with_one():
    with pytest.raises(sx.InputError, match=r"factors found for the kernel miss K\(\d+, \d+\) = "):
        OperatorFactory(RARE["a sum that the function names"], "low-rank", 1e-9)(1100)


def test_solution_with_a_rare_pair():
    # 400 and 601 meet, nothing else does: dn/dt = -n**2 for both
    start = sx.initial.from_sizes({400: 0.5, 601: 0.5})
    model = sx.Model(RARE["a sum that the function names"], initial=start)
    with pytest.warns(sx.SmoluxWarning, match="all pairs are summed"):
        ds = sx.solve(model, [1.0], window=1100)
    assert ds["number_density"].item() == pytest.approx(0.5 + 1 / 3, abs=1e-8)


@pytest.mark.parametrize("method", ["direct", "auto", "low-rank"])
@pytest.mark.parametrize(
    ("text", "message"),
    [
        # zero or more at powers of two and their neighbours, where a model tries it
        ("1 - 40*max(0, 1 - abs(i - 41) - abs(j - 41))", r"K\(41, 41\) = -39: negative"),
        ("sqrt(abs(i - 100) + abs(j - 41) - 0.5)", "not a number"),
    ],
)
def test_values_that_are_no_rates_are_refused_with_the_pair(text, message, method):
    kernel = sx.kernels.formula(text)
    with pytest.raises(sx.InputError, match=message):
        OperatorFactory(kernel, method, 1e-9)(200)
