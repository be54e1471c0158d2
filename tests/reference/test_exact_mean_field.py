"""Every solution against the rate equations it solves, sums against moments, limits."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp

from smolux import exact
from smolux.errors import InputError

Float = NDArray[np.float64]


def kernel(solution: exact.Solution, i: Float, j: Float) -> Float:
    """The kernel of each solution, written here once more."""
    laws = {
        "constant kernel": lambda: 1 + 0 * i * j,
        "constant kernel with shattering": lambda: 1 + 0 * i * j,
        "additive kernel": lambda: i + j,
        "multiplicative kernel": lambda: i * j,
        "multiplicative kernel with shattering, steady state": lambda: i * j,
        "bilinear kernel": lambda: 1 + solution.A * (i + j) + solution.B * i * j,  # type: ignore[attr-defined]
    }
    return solution.scale * laws[solution.name]()


def rate_of_change(solution: exact.Solution, n: Float) -> Float:
    """Right side of the rate equations for the densities of the sizes 1, 2, ..."""
    k = np.arange(1.0, n.size + 1)
    rate = kernel(solution, k[:, None], k)
    lam = getattr(solution, "lam", 0.0)
    loss = n * (rate @ n)
    gain = np.zeros(n.size)
    for size in range(2, n.size + 1):
        i = np.arange(1, size)
        gain[size - 1] = 0.5 * (rate[i - 1, size - i - 1] * n[i - 1] * n[size - i - 1]).sum()
    change = gain - (1 + lam) * loss
    change[0] += lam * (k @ loss)
    return change


CASES = [
    (exact.Constant(), 1.5, 300),
    (exact.Constant(density=3.0, scale=0.2), 2.0, 300),
    (exact.Additive(), 0.4, 700),
    (exact.Additive(density=0.5, scale=0.7), 1.0, 700),
    (exact.Multiplicative(), 0.6, 500),
    (exact.Multiplicative(density=2.0, scale=0.5), 0.6, 500),
    (exact.Bilinear(A=0.5, B=0.25), 0.5, 500),
    (exact.Bilinear(A=0.3, B=0.2), 0.8, 500),
    (exact.Bilinear(A=1.0, B=0.0), 0.4, 700),
    (exact.Bilinear(density=2.0, scale=0.25, A=0.2, B=0.3), 1.0, 500),
    (exact.Bilinear(A=2.0, B=1e-9), 0.2, 700),
    (exact.ConstantShattering(lam=0.1), 3.0, 500),
    (exact.ConstantShattering(density=0.3, scale=2.0, lam=1e-3), 5.0, 500),
    (exact.ConstantShattering(lam=7.0), 0.2, 200),
]
IDS = [f"{s.name}-{t}" for s, t, _ in CASES]


@pytest.mark.parametrize(("solution", "t", "most"), CASES, ids=IDS)
def test_solves_the_rate_equations(solution: exact.Solution, t: float, most: int) -> None:
    sizes = np.arange(1, most + 1)
    h = 1e-3
    around = solution.densities(t + h * np.array([-2.0, -1.0, 1.0, 2.0]), sizes)
    slope = (8 * (around[2] - around[1]) - (around[3] - around[0])) / (12 * h)
    expected = rate_of_change(solution, solution.densities(t, sizes))
    np.testing.assert_allclose(slope[:100], expected[:100], rtol=3e-7, atol=3e-11)


@pytest.mark.parametrize(("solution", "t", "most"), CASES, ids=IDS)
def test_sums_are_the_moments(solution: exact.Solution, t: float, most: int) -> None:
    sizes = np.arange(1, 4097)
    n = solution.densities(t, sizes)
    for order in range(4):
        assert n @ (1.0 * sizes**order) == pytest.approx(
            float(solution.moment(t, order)), rel=3e-12
        )
    assert float(solution.moment(t, 1)) == pytest.approx(solution.density, rel=1e-15)


@pytest.mark.parametrize(("solution", "t", "most"), CASES, ids=IDS)
def test_starts_from_monomers(solution: exact.Solution, t: float, most: int) -> None:
    assert solution.densities(0.0, [1, 2, 3]).tolist() == [solution.density, 0, 0]
    assert [float(solution.moment(0.0, p)) for p in range(4)] == [solution.density] * 4
    assert float(solution.collisions(0.0)) == 0
    early = solution.densities(1e-9, [1, 2])
    pair_rate = 0.5 * float(kernel(solution, np.ones(1), np.ones(1))[0]) * solution.density**2
    assert early[1] == pytest.approx(1e-9 * pair_rate, rel=1e-6)


@pytest.mark.parametrize(
    "solution", [exact.ConstantShattering(lam=0.3), exact.MultiplicativeShattering(0.7, 1.3, 0.5)]
)
def test_steady_states_are_steady(solution: exact.Solution) -> None:
    sizes = np.arange(1, 601)
    n = solution.densities(math.inf, sizes)
    assert np.abs(rate_of_change(solution, n)[:300]).max() < 1e-15
    for order in range(4):
        expected = float(solution.moment(math.inf, order))
        assert n @ (1.0 * sizes**order) == pytest.approx(expected, rel=1e-12)


def test_product_with_shattering_is_known_in_the_steady_state_only() -> None:
    solution = exact.MultiplicativeShattering(lam=0.2)
    assert np.isnan(solution.densities(1.0, [1, 2])).all()
    assert np.isnan(solution.moment([1.0, 2.0], 2)).all()
    assert solution.gel_time == math.inf


def test_shapes() -> None:
    solution = exact.Constant()
    assert solution.densities(np.ones((2, 3)), np.ones((4, 5))).shape == (2, 3, 4, 5)
    assert solution.densities(1.0, 1).shape == ()
    assert solution.densities([], [1, 2]).shape == (0, 2)
    assert solution.moment(np.ones((2, 3)), 2).shape == (2, 3)
    assert solution.gel_mass(np.ones((2, 3))).tolist() == [[0.0] * 3] * 2
    assert np.isnan(solution.moment([1.0, 2.0], 0.5)).all()
    assert solution.simulated_collisions([[1.0, 9.0]], 100).shape == (1, 2)
    assert pickle.loads(pickle.dumps(solution)) == solution
    assert exact.ConstantShattering(lam=0.1).densities([1.0, 2.0], []).shape == (2, 0)


def test_scaling_of_density_and_prefactor() -> None:
    # n -> c n, t -> t / (c scale)
    for law, parameters in (
        (exact.Additive, {}),
        (exact.Bilinear, {"A": 0.3, "B": 0.1}),
        (exact.ConstantShattering, {"lam": 0.2}),
    ):
        plain, scaled = law(**parameters), law(density=4.0, scale=0.5, **parameters)
        k = [1, 2, 30]
        np.testing.assert_allclose(
            scaled.densities(0.35, k), 4 * plain.densities(0.7, k), rtol=1e-13
        )
        assert float(scaled.moment(0.35, 2)) == pytest.approx(4 * float(plain.moment(0.7, 2)))
        assert float(scaled.collisions(0.35)) == pytest.approx(4 * float(plain.collisions(0.7)))
    assert exact.Multiplicative(density=4.0, scale=0.5).gel_time == 0.5


# Values with 60 digits of the closed forms, far beyond the range of factorials.
@pytest.mark.parametrize("size", [1, 2, 3, 15, 16, 17, 170, 171, 10_000, 1_000_000])
def test_large_sizes(size: int) -> None:
    # at t = 1 the product kernel has k**(k - 2) exp(-k) / k!
    log = (size - 2) * math.log(size) - size - math.lgamma(size + 1)
    assert float(exact.Multiplicative().densities(1.0, size)) == pytest.approx(
        math.exp(log), rel=1e-14 + 2e-16 * size * math.log(size + 1)
    )


def test_a_million_sizes_of_each() -> None:
    sizes = np.array([10_000, 100_000, 1_000_000])
    for solution in (exact.Constant(), exact.Additive(), exact.Multiplicative()):
        n = solution.densities([0.5, 1.0, 8.0, 1e5], sizes)
        assert np.isfinite(n).all()
        assert (n >= 0).all()
    assert (exact.Constant().densities(1e5, sizes) > 0).all()
    assert (exact.Additive().densities(8.0, sizes) > 0).all()
    n = exact.Bilinear(A=0.3, B=0.2).densities(1.7, sizes[0])
    assert 0 < float(n) < 1e-8


def test_late_times_do_not_overflow() -> None:
    for solution in (exact.Constant(), exact.Additive(), exact.Bilinear(A=1.0), exact.Bilinear()):
        for t in (1e4, math.inf):
            values = [float(solution.moment(t, p)) for p in range(4)]
            assert not any(map(math.isnan, values))
            assert values[0] < 1e-3 < values[3]
            n = solution.densities(t, [1, 100])
            assert np.isfinite(n).all()
            assert n.max() < 1e-7
    assert float(exact.Multiplicative().moment(1e4, 0)) == 0


def _gelling(y: float, a: float, b: float) -> float:
    return 1 / (math.exp(-y) + 2 * a + b * math.exp(y))


class TestGelation:
    def test_bilinear_gel_time(self) -> None:
        assert exact.Bilinear(A=0.5, B=0.25).gel_time == pytest.approx(4 / 3, rel=1e-15)
        assert exact.Bilinear(A=0.5).gel_time == math.inf
        # the integral of 1 / (1 + 2 A m + B m**2) from 1 on, on both sides of A**2 = B
        # with m = exp(y)
        for a, b in ((0.3, 0.2), (1.0, 0.5), (0.0, 0.3), (2.0, 1e-6), (0.5, 0.25 + 1e-13)):
            integral = quad(_gelling, 0, 60, (a, b))[0]
            assert exact.Bilinear(A=a, B=b).gel_time == pytest.approx(integral, rel=1e-8)

    def test_bilinear_is_continuous_in_its_parameters(self) -> None:
        k = [1, 2, 50]
        for t in (0.3, 0.9):
            values = [
                exact.Bilinear(A=0.5, B=b).densities(t, k)
                for b in (0.25 - 1e-12, 0.25, 0.25 + 1e-12)
            ]
            np.testing.assert_allclose(values[0], values[1], rtol=1e-10)
            np.testing.assert_allclose(values[2], values[1], rtol=1e-10)

    def test_bilinear_holds_the_simple_kernels(self) -> None:
        k = np.arange(1, 200)
        np.testing.assert_allclose(
            exact.Bilinear().densities(3.0, k), exact.Constant().densities(3.0, k), rtol=1e-12
        )
        large = 1e9  # then 1 is nothing against A (i + j)
        np.testing.assert_allclose(
            exact.Bilinear(A=large, scale=1 / large).densities(1.0, k),
            exact.Additive().densities(1.0, k),
            rtol=1e-6,
        )
        np.testing.assert_allclose(
            exact.Bilinear(B=large, scale=1 / large).densities(0.7, k),
            exact.Multiplicative().densities(0.7, k),
            rtol=1e-6,
        )

    @pytest.mark.parametrize("parameters", [(0.0, 0.0), (0.5, 0.0), (0.5, 0.25), (1.0, 0.5)])
    def test_number_and_second_moment_at_twice_the_time(
        self, parameters: tuple[float, float]
    ) -> None:
        solution = exact.Bilinear(1.0, 1.0, *parameters)
        t = np.array([0.1, 0.4, 0.6])
        np.testing.assert_allclose(solution.moment(t, 0) * solution.moment(t / 2, 2), 1, rtol=1e-14)

    @pytest.mark.parametrize(
        ("a", "b", "t"), [(0.5, 0.25, 1.2), (0.3, 0.2, 1.5), (2.0, 1e-6, 2.5), (2.0, 0.1, 0.8)]
    )
    def test_bilinear_moments_by_their_equations(self, a: float, b: float, t: float) -> None:
        def change(_: float, m: list[float]) -> list[float]:
            m0, m2, m3 = m
            return [
                -0.5 * (m0 * m0 + 2 * a * m0 + b),
                1 + 2 * a * m2 + b * m2 * m2,
                3 * (m2 + a * (m3 + m2 * m2) + b * m2 * m3),
            ]

        end = solve_ivp(change, (0, t), [1.0, 1.0, 1.0], "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        solution = exact.Bilinear(A=a, B=b)
        found = [float(solution.moment(t, p)) for p in (0, 2, 3)]
        np.testing.assert_allclose(found, end, rtol=1e-9)

    def test_bilinear_is_unknown_after_the_gel_time(self) -> None:
        solution = exact.Bilinear(A=0.5, B=0.25)
        assert np.isnan(solution.densities(1.4, [1, 2])).all()
        assert np.isnan(solution.gel_mass(1.4)).all()
        assert float(solution.gel_mass(1.0)) == 0

    def test_flory(self) -> None:
        solution = exact.Multiplicative()
        t = np.array([1.0001, 1.2, 1.49, 1.51, 3.0, 40.0])
        sol = solution.moment(t, 1)
        np.testing.assert_allclose(sol, np.exp(-t * (1 - sol)), rtol=1e-13)
        np.testing.assert_allclose(solution.gel_mass(t), 1 - sol, rtol=1e-15)
        k = np.arange(1, 4001)
        n = solution.densities([1.2, 1.49, 3.0], k)
        for order in range(4):
            np.testing.assert_allclose(
                n @ (1.0 * k**order), solution.moment([1.2, 1.49, 3.0], order), rtol=1e-12
            )
        # as a simulation counts: the gel is one cluster more
        assert solution.moment([0.5, 2.0], 1, gel=True).tolist() == [1.0, 1.0]
        assert solution.moment([0.5, 2.0], 2, gel=True).tolist() == [2.0, math.inf]
        # each event takes one cluster away, the gel's too
        np.testing.assert_allclose(solution.collisions(t), 1 - solution.moment(t, 0), rtol=1e-15)
        # twice as dense, all is twice as much after half the time
        dense = exact.Multiplicative(2.0)
        assert dense.gel_time == 0.5
        np.testing.assert_allclose(dense.gel_mass(t / 2), 2 * (1 - sol), rtol=1e-14)
        np.testing.assert_allclose(dense.collisions(t / 2), 2 - dense.moment(t / 2, 0), rtol=1e-14)
        assert dense.moment([0.25, 1.0], 1, gel=True).tolist() == [2.0, 2.0]

    def test_stockmayer(self) -> None:
        solution = exact.Multiplicative(gel="inert")
        t, k = 2.5, np.arange(1, 101)
        n = solution.densities(t, k)
        np.testing.assert_allclose(n, exact.Multiplicative().densities(1.0, k) / t, rtol=1e-14)
        # the loss is to the finite clusters only: dn_k/dt = gain - k n_k M1
        gain = np.array([0.5 * (n[: j - 1] * k[: j - 1]) @ (n * k)[: j - 1][::-1] for j in k])
        loss = k * n * float(solution.moment(t, 1))
        np.testing.assert_allclose(gain - loss, -n / t, rtol=1e-11)
        assert solution.moment([2.0], 2).tolist() == [math.inf]
        assert float(solution.gel_mass(4.0)) == 0.75


class TestCollisions:
    def test_doubling(self) -> None:
        # h doublings so far: h N0 / 2 + N0 (1 - 2**h M0)
        for solution in (exact.Constant(scale=2.0), exact.Additive(density=3.0)):
            t = np.array([0.01, 0.3, 1.0, 2.0])
            m0 = solution.moment(t, 0) / solution.density
            h = np.floor(-np.log2(m0))
            expected = 1000 * (h / 2 + 1 - 2**h * m0)
            np.testing.assert_allclose(solution.simulated_collisions(t, 1000), expected, rtol=1e-12)
            np.testing.assert_allclose(
                solution.simulated_collisions(t, 1000, doubling=False), 1000 * (1 - m0), rtol=1e-12
            )

    def test_doubling_with_shattering(self) -> None:
        solution = exact.ConstantShattering(lam=0.1)
        t = np.linspace(0, 20, 200_001)
        m0 = solution.moment(t[::100], 0)
        fine = np.interp(t, t[::100], m0)
        volume = 2.0 ** np.floor(-np.log2(np.minimum(fine, 1)))
        rate = 0.5 * 1.1 * fine**2 * volume
        expected = 1e4 * np.concatenate(([0], np.cumsum((rate[1:] + rate[:-1]) / 2))) * t[1]
        np.testing.assert_allclose(
            solution.simulated_collisions([1.0, 5.0, 20.0], 10_000),
            np.interp([1.0, 5.0, 20.0], t, expected),
            rtol=1e-4,
        )

    def test_bilinear_up_to_the_gel_time(self) -> None:
        solution = exact.Bilinear(A=0.5, B=0.25)
        counts = solution.simulated_collisions([0.5, 1.0, 1.5], 100)
        m0 = solution.moment([0.5, 1.0], 0)  # 0.59 and 0.36: one doubling between
        np.testing.assert_allclose(counts[:2], [100 * (1 - m0[0]), 50 + 100 * (1 - 2 * m0[1])])
        assert math.isnan(counts[2])


def test_mistakes_are_all_named() -> None:
    with pytest.raises(InputError, match="density") as caught:
        exact.Bilinear(density=-1.0, scale=math.nan, A=-0.5, B=math.inf)
    assert len(caught.value.problems) == 4
    with pytest.raises(InputError, match="did you mean 'inert'"):
        exact.Multiplicative(gel="inerte")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="lam = 0"):
        exact.ConstantShattering(lam=0.0)
    with pytest.raises(InputError, match="lam"):
        exact.MultiplicativeShattering(lam=-1.0)
    with pytest.raises(InputError, match="times"):
        exact.Constant().densities(-1.0, 1)
    for sizes in (0, 1.5, math.inf, math.nan):
        with pytest.raises(InputError, match="sizes"):
            exact.Constant().densities(1.0, sizes)
    with pytest.raises(InputError, match="300000"):
        exact.Bilinear(A=1.0).densities(1.0, 300_000)
    with pytest.raises(InputError, match="2000000"):
        exact.ConstantShattering().densities(1.0, 2_000_000)
