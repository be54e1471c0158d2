"""Finite laws against tables, against the whole Markov chain, and against enumeration."""

from __future__ import annotations

import csv
import math
from collections import Counter, defaultdict
from itertools import combinations, product
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from smolux import exact
from smolux.errors import InputError
from smolux.exact import finite
from smolux.exact.finite.constant import death_pmf
from smolux.exact.finite.multiplicative import log_connected

DATA = Path(__file__).parent / "data"

KERNELS = {
    "const": lambda i, j: 1.0,
    "sum": lambda i, j: i + j,
    "product": lambda i, j: i * j,
    "ballistic": lambda i, j: (i ** (1 / 3) + j ** (1 / 3)) ** 2 * np.sqrt(1 / i + 1 / j),
    "brownian": lambda i, j: (i ** (1 / 3) + j ** (1 / 3)) * (i ** (-1 / 3) + j ** (-1 / 3)),
}
LAWS = {"const": "constant", "sum": "additive", "product": "multiplicative"}


def _pmf_table() -> dict[tuple[str, float, float], dict[tuple[int, ...], float]]:
    table: dict[tuple[str, float, float], dict[tuple[int, ...], float]] = defaultdict(dict)
    for row in csv.DictReader((DATA / "finiteN8_partition_pmf.csv").open()):
        key = row["kernel"], float(row["lambda"]), float(row["t"])
        table[key][tuple(map(int, row["partition"].split()))] = float(row["probability"])
    return table


TABLE = _pmf_table()


@pytest.mark.parametrize("key", TABLE, ids=str)
def test_partition_pmf_of_eight(key: tuple[str, float, float]) -> None:
    kernel, lam, t = key
    states, p = finite.partition_pmf(KERNELS[kernel], 8, t, shattering=lam)
    assert len(states) == 22
    assert dict(zip(states, p, strict=True)) == pytest.approx(TABLE[key], rel=1e-10, abs=5e-15)
    assert p.sum() == pytest.approx(1, abs=1e-14)


@pytest.mark.parametrize(
    "row",
    list(csv.DictReader((DATA / "finiteN_expected_counts.csv").open())),
    ids=lambda row: "-".join(row.values()),
)
def test_expected_counts(row: dict[str, str]) -> None:
    law = finite.law(LAWS[row["kernel"]], int(row["N"]))
    t, what = float(row["t"]), row["size"]
    if what == "total":
        value = law.number_mean(t)
    elif what.startswith("m2"):
        value = law.second_moment(t)
    else:
        value = float(law.counts(t, int(what)))
    assert value == pytest.approx(float(row["E_count"]), rel=3e-13)


@pytest.mark.parametrize("kernel", LAWS)
@pytest.mark.parametrize(
    ("n", "t", "volume"), [(1, 0.4, 2.0), (2, 0.7, 1.0), (7, 0.9, 3.5), (12, 0.8, 12.0)]
)
def test_closed_laws_against_the_chain(kernel: str, n: int, t: float, volume: float) -> None:
    law = finite.law(LAWS[kernel], n, volume=volume, scale=1.5)
    states, p = finite.partition_pmf(lambda i, j: 1.5 * KERNELS[kernel](i, j), n, t, volume)
    same, closed = law.partition_pmf(t)
    assert same == states
    np.testing.assert_allclose(closed, p, rtol=1e-10, atol=1e-14)
    number = np.bincount([len(s) for s in states], p, minlength=n + 1)
    np.testing.assert_allclose(law.number_pmf(t), number, rtol=0, atol=1e-13)
    k = np.arange(n + 1)
    mean = number @ k
    assert law.number_mean(t) == pytest.approx(mean, rel=1e-13)
    variance = number @ (k - mean) ** 2
    assert law.number_variance(t) == pytest.approx(variance, rel=1e-11, abs=1e-13)
    counts = [sum(q * s.count(size) for s, q in zip(states, p, strict=True)) for size in k[1:]]
    np.testing.assert_allclose(law.counts(t, k[1:]), counts, rtol=1e-11, atol=1e-14)
    second = sum(q * sum(x * x for x in s) for s, q in zip(states, p, strict=True)) / n
    assert law.second_moment(t) == pytest.approx(second, rel=1e-12)
    # without shattering each collision takes one cluster away
    events = finite.collision_moments(lambda i, j: 1.5 * KERNELS[kernel](i, j), n, t, volume)
    assert events == pytest.approx((n - mean, variance), rel=1e-11, abs=1e-13)


def test_pairs_of_equal_clusters() -> None:
    law = finite.Constant(9)
    states, p = law.partition_pmf(1.2)
    expected = [
        sum(q * s.count(k) * (s.count(k) - 1) for s, q in zip(states, p, strict=True))
        for k in range(1, 10)
    ]
    np.testing.assert_allclose(law.pairs(1.2, np.arange(1, 10)), expected, rtol=1e-12, atol=1e-14)


class TestLargeSystems:
    """N0 = 10**4, t = 0.6: the fluctuations of the exact jump process."""

    def test_constant(self) -> None:
        law = finite.Constant(10_000)
        p, k = law.number_pmf(0.6), np.arange(10_001)
        mean = float(p @ k)
        assert mean == pytest.approx(law.number_mean(0.6), rel=1e-13)
        assert float(p @ (k - mean) ** 2) == pytest.approx(law.number_variance(0.6), rel=1e-9)
        assert math.sqrt(law.number_variance(0.6)) == pytest.approx(37.3757976, rel=1e-8)
        # to leading order N (2 / 3) ((t + 2)**3 - 8) / (t + 2)**4
        leading = 1e4 * 2 / 3 * (2.6**3 - 8) / 2.6**4
        assert law.number_variance(0.6) == pytest.approx(leading, rel=1e-3)

    def test_additive(self) -> None:
        # binomial: 9999 exp(-0.6) (1 - exp(-0.6))
        assert math.sqrt(finite.number_variance("additive", 10_000, 0.6)) == pytest.approx(
            49.7586839, rel=1e-8
        )
        assert finite.number_mean("additive", 10_000, 0.6) == pytest.approx(
            1 + 9999 * math.exp(-0.6), rel=1e-14
        )

    def test_named_means(self) -> None:
        assert finite.number_mean("constant", 100, 1.0) == pytest.approx(66.9018854083, rel=1e-12)
        assert finite.number_mean("constant", 100, 5.0) == pytest.approx(28.8993161369, rel=1e-12)
        assert finite.number_mean("additive", 100, 1.0) == pytest.approx(37.4200646760, rel=1e-12)
        assert float(finite.Additive(100).counts(1.0, 1)) == pytest.approx(19.7613067992, rel=1e-11)
        m2 = finite.Multiplicative(100)
        assert m2.second_moment(1.0) == pytest.approx(7.26092663379, rel=1e-11)
        assert m2.second_moment(1.5) == pytest.approx(32.1504951492, rel=1e-11)
        # of infinitely many, after one unit of the time of a pair
        left = sum((2 * k - 1) * math.exp(-k * (k - 1) / 2) for k in range(1, 9))
        assert finite.number_mean("constant", 10**6, 1e6) == pytest.approx(left, rel=1e-5)

    @pytest.mark.parametrize(
        ("name", "t"), [("constant", 1.5), ("additive", 0.4), ("multiplicative", 0.4)]
    )
    def test_approach_the_rate_equations_like_one_over_n(self, name: str, t: float) -> None:
        solution = {
            "constant": exact.Constant(),
            "additive": exact.Additive(),
            "multiplicative": exact.Multiplicative(),
        }[name]
        k = np.array([1, 2, 4])
        limit = solution.densities(t, k)
        errors = [finite.law(name, n).counts(t, k) / n - limit for n in (200, 400)]
        np.testing.assert_allclose(errors[0] / errors[1], 2, rtol=0.05)

    def test_flory_gel(self) -> None:
        # the monomer of the largest component: m2 / N tends to the squared gel mass
        law = finite.Multiplicative(1000)
        gel = float(exact.Multiplicative().gel_mass(2.0))
        assert law.second_moment(2.0) / 1000 == pytest.approx(gel**2, rel=0.01)

    def test_bias_of_the_second_moment(self) -> None:
        law = finite.Constant(50)
        expected = 50 - 49 * math.exp(-2 / 50)
        assert law.second_moment(2.0) == pytest.approx(expected, rel=1e-14)
        assert finite.FiniteLaw.second_moment(law, 2.0) == pytest.approx(expected, rel=1e-12)


def test_connected_graphs_by_enumeration() -> None:
    q = 0.7
    for n in (1, 2, 3, 4, 5):
        edges = list(combinations(range(n), 2))
        total = 0.0
        for present in product((0, 1), repeat=len(edges)):
            reached = {0}
            for _ in range(n):
                for (a, b), there in zip(edges, present, strict=True):
                    if there and (a in reached or b in reached):
                        reached |= {a, b}
            if len(reached) == n:
                count = sum(present)
                total += (1 - q) ** count * q ** (len(edges) - count)
        assert math.exp(log_connected(n, -math.log(q))[n]) == pytest.approx(total, rel=1e-13)


def test_connected_graphs_where_edges_are_rare() -> None:
    # trees dominate: C_s ~ s**(s - 2) p**(s - 1), which the usual recursion loses in its rounding
    p = 1e-7
    log_c = log_connected(40, -math.log1p(-p))
    assert log_c[40] == pytest.approx(38 * math.log(40) + 39 * math.log(p), abs=1e-3)


def test_death_process_against_the_matrix_exponential() -> None:
    rates = np.array([0, 0, 0.5, 2.0, 2.0, 7.0, 30.0])
    matrix = np.diag(-rates) + np.diag(rates[1:], 1)
    for t in (0.0, 0.01, 1.0, 20.0):
        np.testing.assert_allclose(
            death_pmf(rates, 6, t), expm(matrix * t)[:, 6], rtol=0, atol=1e-14
        )


def test_shattering_of_three() -> None:
    # three monomers, K = 1, V = 1: states 111 (rate 3), 21 (rate 1), 3 (none)
    lam = 0.5
    q = np.array([[-3.0, lam, 0.0], [3.0, -(1 + lam), 0.0], [0.0, 1.0, 0.0]])
    start = np.array([1.0, 0, 0])
    p = expm(q * 0.8) @ start
    states, found = finite.partition_pmf(lambda i, j: 1.0, 3, 0.8, 1.0, lam)
    assert states == [(3,), (2, 1), (1, 1, 1)]
    np.testing.assert_allclose(found[::-1], p, atol=1e-15)
    # collisions per time: 3 (1 + lam) from 111, (1 + lam) from 21
    times = np.linspace(0, 0.8, 161)
    rate = [(3 * x[0] + x[1]) * (1 + lam) for x in (expm(q * s) @ start for s in times)]
    mean, variance = finite.collision_moments(lambda i, j: 1.0, 3, 0.8, 1.0, lam)
    assert mean == pytest.approx(np.trapezoid(rate, times), rel=1e-5)
    # and by brute force: a chain that counts
    most = 40
    big = np.zeros((3 * most, 3 * most))
    jumps = [(0, 1, 3.0), (0, 0, 3 * lam), (1, 2, 1.0), (1, 0, lam)]
    for c in range(most - 1):
        for a, b, r in jumps:
            big[3 * c + a, 3 * c + a] -= r
            big[3 * (c + 1) + b, 3 * c + a] += r
    counted = (expm(big * 0.8)[:, 0]).reshape(most, 3).sum(1)
    c = np.arange(most)
    assert mean == pytest.approx(counted @ c, rel=1e-12)
    assert variance == pytest.approx(counted @ (c - mean) ** 2, rel=1e-11)


def test_partitions() -> None:
    assert finite.partitions(4) == [(4,), (3, 1), (2, 2), (2, 1, 1), (1, 1, 1, 1)]
    assert [len(finite.partitions(n)) for n in (1, 5, 10, 20, 30)] == [1, 7, 42, 627, 5604]
    assert all(Counter(p).total() <= 9 and sum(p) == 9 for p in finite.partitions(9))


def test_mistakes() -> None:
    with pytest.raises(InputError, match="did you mean 'additive'"):
        finite.law("aditive", 10)
    with pytest.raises(InputError) as caught:
        finite.Constant(0, volume=-1.0, scale=math.nan)
    assert len(caught.value.problems) == 3
    with pytest.raises(InputError, match="with the sum 5"):
        finite.Constant(5).partition_probability(1.0, (3, 1))
    with pytest.raises(InputError, match="t = -1"):
        finite.Constant(5).number_pmf(-1.0)
    with pytest.raises(InputError, match="symmetric"):
        finite.partition_pmf(lambda i, j: i + 0 * j, 4, 1.0)
    with pytest.raises(InputError, match="partitions of 1 to 40"):
        finite.partition_pmf(lambda i, j: 1.0, 41, 1.0)
    with pytest.raises(InputError, match="shattering"):
        finite.partition_pmf(lambda i, j: 1.0, 4, 1.0, shattering=-0.1)
