"""The constant kernel with shattering: independent computations over the whole range served."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.special import gamma, hyp2f1

from smolux import exact
from smolux.exact.generating import generating_function

LAMBDAS = [1e-3, 0.1, 1.0, 10.0]


@pytest.mark.parametrize("lam", LAMBDAS)
@pytest.mark.parametrize("t", [1e-3, 0.3, 20.0, 1e3, 1e4])
def test_moments_by_closed_form_and_quadrature(lam: float, t: float) -> None:
    solution = exact.ConstantShattering(lam=lam)
    q = 2 * lam / (1 + 2 * lam)

    # M2 - 1 = (h(v) - (v0 / v)**q h(v0)) / lam, with v = (1 + 2 lam) exp(lam t) - 1 and
    # h(v) = v / (1 + q) 2F1(1, 1 + q; 2 + q; -v); x = 1 / (1 + v)
    def h(x: float) -> float:
        if x > 0.3:
            return (1 - x) / (1 + q) * float(hyp2f1(1, 1, 2 + q, 1 - x))
        regular = (1 - x) / q * float(hyp2f1(1, 1, 1 - q, x))
        return regular + gamma(1 + q) * gamma(-q) * (x / (1 - x)) ** q

    x0 = 1 / (1 + 2 * lam)
    x = x0 * math.exp(-lam * t)
    factor = 0.0 if x == 0 else (2 * lam * x / (1 - x)) ** q
    second = 1 + (h(x) - factor * h(x0)) / lam
    assert float(solution.moment(t, 2)) == pytest.approx(second, rel=2e-12 + 1e-15 / lam)

    def decay(s: float) -> float:
        a = math.log1p(-math.expm1(-lam * s) / (2 * lam)) + lam * s
        b = math.log1p(-math.expm1(-lam * t) / (2 * lam)) + lam * t
        return math.exp(q * (a - b)) * (t - s)

    cuts = [0.0, *(t - t * 0.1**p for p in range(1, 9)), t]
    last = sum(quad(decay, a, b, limit=200)[0] for a, b in pairwise(cuts))
    third = 1 + 3 * (second - 1) + 3 * last
    assert float(solution.moment(t, 3)) == pytest.approx(third, rel=1e-7)


@pytest.mark.parametrize(("lam", "t"), [(1e-3, 40.0), (0.1, 30.0), (10.0, 2.0)])
def test_rate_equations_of_the_first_sizes(lam: float, t: float) -> None:
    # The equations of the first M sizes are closed once M0(t) is known.
    most = 60

    def change(s: float, n: np.ndarray) -> np.ndarray:
        total = 2 * lam / (2 * lam - math.expm1(-lam * s))
        dn = -(1 + lam) * total * n
        dn[1:] += 0.5 * np.convolve(n, n)[: most - 1]
        dn[0] += lam * total
        return dn

    start = np.zeros(most)
    start[0] = 1
    n = solve_ivp(change, (0, t), start, "DOP853", rtol=1e-12, atol=1e-30).y[:, -1]
    k = np.arange(1, most + 1)
    np.testing.assert_allclose(
        exact.ConstantShattering(lam=lam).densities(t, k), n, rtol=1e-9, atol=1e-25
    )


@pytest.mark.parametrize(
    ("lam", "t", "most"),
    [(1e-3, 100.0, 8192), (0.1, 1e4, 8192), (1.0, 3.0, 512), (10.0, 1e4, 512)],
)
def test_sums(lam: float, t: float, most: int) -> None:
    solution = exact.ConstantShattering(lam=lam)
    k = np.arange(1, most + 1)
    n = solution.densities(t, k)
    assert (n >= 0).all()
    for order in range(4):
        expected = float(solution.moment(t, order))
        assert n @ (1.0 * k**order) == pytest.approx(expected, rel=3e-12)


@pytest.mark.parametrize("lam", LAMBDAS)
def test_late_is_steady(lam: float) -> None:
    solution = exact.ConstantShattering(lam=lam)
    late = 60 * (0.5 + lam) / lam**2
    k = np.array([1, 2, 5, 10])  # larger ones take longer
    steady = solution.densities(math.inf, k)
    np.testing.assert_allclose(solution.densities(late, k), steady, rtol=1e-10, atol=1e-300)
    for order in range(4):
        assert float(solution.moment(late, order)) == pytest.approx(
            float(solution.moment(math.inf, order)), rel=1e-11
        )
    assert float(solution.collisions(math.inf)) == math.inf


def test_without_shattering_it_is_the_constant_kernel() -> None:
    k = np.arange(1, 200)
    for t in (1e-12, 0.5, 30.0):
        np.testing.assert_allclose(
            exact.ConstantShattering(lam=1e-8).densities(t, k),
            exact.Constant().densities(t, k),
            rtol=1e-5 * (1 + t),
            atol=1e-300,
        )
    for p in range(4):
        assert float(exact.ConstantShattering(lam=1e-8).moment(3.0, p)) == pytest.approx(
            float(exact.Constant().moment(3.0, p)), rel=1e-6
        )


def test_early_times() -> None:
    # n_2 = t / 2 (1 - (3/2 + lam / 2) t + ...): a pair has not yet met a third
    for lam in (1e-3, 0.5, 10.0, 1e3):
        for t in (1e-6, 1e-9, 1e-13, 1e-16, 1e-30):
            n = exact.ConstantShattering(lam=lam).densities(t, [1, 2, 3])
            assert n[0] == pytest.approx(1, rel=3e-6)
            assert n[1] == pytest.approx(t / 2, rel=3e-6 + lam * t)
            assert n[2] == pytest.approx(t * t / 4, rel=6e-6 + 2 * lam * t)


def test_tail_follows_the_pole() -> None:
    # n_k R**k tends to a constant: the residue at the pole at z = R
    solution = exact.ConstantShattering(lam=0.1)
    n = solution.densities(10.0, [400, 500, 600])
    function = generating_function(0.1, 10.0)
    pole = function.radius
    np.testing.assert_allclose(n[1:] / n[:-1] * pole**100, 1, rtol=1e-6)
    just_below, just_above = pole * (1 - 1e-6), pole * (1 + 1e-6)
    g = function(np.array([just_below, just_above], complex)).real
    assert g[0] > 1e4
    assert g[1] < -1e4


@pytest.mark.parametrize("lam", np.geomspace(1e-8, 1e3, 12).tolist())
def test_the_transform_finds_the_monomers_over_the_whole_range(lam: float) -> None:
    # n_1 is known in closed form and not used by the generating function
    for t in np.geomspace(1e-13 / (1 + lam), 1e4, 9).tolist():
        closed = float(exact.ConstantShattering(lam=lam).densities(t, 1))
        found = generating_function(lam, t).coefficients(64)
        assert found[1] == pytest.approx(closed, rel=2e-14)
        assert (found[2:] > -1e-300).all()


def test_bands_join_smoothly() -> None:
    # sizes up to 64, 128, ... come from different contours
    n = exact.ConstantShattering(lam=0.02).densities(60.0, np.arange(1, 1025))
    for high in (128, 256, 512, 1024, 2048):
        wider = generating_function(0.02, 60.0).coefficients(high)[high // 4 : high // 2 + 1]
        np.testing.assert_allclose(n[high // 4 - 1 : high // 2], wider, rtol=1e-11)
