"""Initial populations: every size class has its share, and the same seed gives the same."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import runs
from scipy import stats

import smolux as sx
from shared import QUICK
from smolux.case import parse
from smolux.cli.cautions import physics_warnings
from smolux.initial import base
from smolux.stochastic.replicas import initial_populations

INITIALS = {
    "monomers": sx.initial.monodisperse(density=2.0),
    "one size": sx.initial.monodisperse(density=0.5, size=7),
    "sizes": sx.initial.from_sizes({1: 0.1, 2: 0.25, 5: 0.15, 2000: 0.001}),
    "unordered": sx.initial.from_sizes({9: 0.3, 4: 0.0, 2: 0.7}),
    "exponential": sx.initial.exponential(4.0, density=3.0),
    "exponential of monomers": sx.initial.exponential(1.0),
    "lognormal": sx.initial.lognormal(6.0, 1.6, density=0.2),
    "far": sx.initial.exponential(1e7),  # sampled particle by particle
    "huge": sx.initial.from_sizes({10**12: 0.4, 3 * 10**15: 0.6}),
}
every_initial = pytest.mark.parametrize("initial", INITIALS.values(), ids=INITIALS.keys())
PARTICLES = 1001


def populations(initial: Any, replicas: int, seed: int = 3) -> list[tuple[Any, Any]]:
    model = runs.model(initial=initial, c1=0.0)
    plan = runs.plan(model, [1.0], runs.METHODS[0], particles=PARTICLES, seed=seed)
    return initial_populations(plan, range(replicas))


@every_initial
def test_a_population_is_well_formed(initial: Any) -> None:
    for sizes, counts in populations(initial, 20):
        assert counts.sum() == PARTICLES
        assert (counts > 0).all()
        assert (np.diff(sizes) > 0).all()
        assert sizes[0] >= 1
        assert sizes[-1] <= initial.largest
        assert sizes.dtype == counts.dtype == np.int64


@every_initial
def test_every_size_is_met_to_within_one_particle(initial: Any) -> None:
    for sizes, counts in populations(initial, 20):
        # sizes up to each one: systematic sampling errs by less than a particle
        expected = PARTICLES * initial.cumulative(sizes.astype(float))
        assert (np.abs(np.cumsum(counts) - expected) < 1 + 1e-9).all()


@every_initial
def test_mean_counts_are_the_densities(initial: Any) -> None:
    replicas, top = 2000, 60
    found = np.zeros((replicas, top + 1))
    for r, (sizes, counts) in enumerate(populations(initial, replicas)):
        small = sizes <= top
        found[r, sizes[small]] = counts[small]
    expected = PARTICLES * initial.densities(top) / initial.total
    error = found[:, 1:].std(axis=0) / np.sqrt(replicas)
    # a count is one of two neighbours: with the spread that this gives, if none was seen
    rest = expected % 1
    error = np.maximum(error, np.sqrt(rest * (1 - rest) / replicas) + 1e-6)
    assert (np.abs(found[:, 1:].mean(axis=0) - expected) < 4.5 * error).all()


@every_initial
def test_mean_mass(initial: Any) -> None:
    mass = [float((s * c.astype(float)).sum()) for s, c in populations(initial, 400)]
    if hasattr(initial, "sizes"):
        expected = np.dot(initial.sizes, initial.densities_) / initial.total
    elif hasattr(initial, "mean"):
        expected = initial.mean
    else:
        top = int(initial.largest)
        expected = np.arange(1, top + 1) @ initial.densities(top) / initial.total
    error = np.std(mass) / np.sqrt(len(mass)) + 1e-9 * np.mean(mass)
    assert abs(np.mean(mass) - PARTICLES * expected) < 4.5 * error


@every_initial
def test_quantiles_are_the_sizes_at_which_a_share_is_passed(initial: Any) -> None:
    shares = np.random.default_rng(1).random(500)
    sizes = initial.quantile(shares)
    below, upto = (initial.cumulative(sizes - float(k)) for k in (1, 0))
    assert (below <= shares + 1e-12).all()
    assert (shares <= upto + 1e-12).all()


def test_populations_drawn_in_batches_are_those_drawn_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    whole = INITIALS["far"].sample(PARTICLES, 0.3)
    monkeypatch.setattr(base, "_BATCH", 100)
    for one, other in zip(whole, INITIALS["far"].sample(PARTICLES, 0.3), strict=True):
        np.testing.assert_array_equal(one, other)


def test_exponential_densities_are_geometric() -> None:
    n = INITIALS["exponential"].densities(400)
    k = np.arange(1, 401)
    assert n.sum() == pytest.approx(3.0)
    assert (k * n).sum() == pytest.approx(12.0)
    np.testing.assert_allclose(n[1:] / n[:-1], 0.75)


def test_lognormal_median_and_width() -> None:
    law = sx.initial.lognormal(1000.0, 1.5)
    n = law.densities(law.largest)
    assert n.sum() == pytest.approx(1.0)
    k = np.log(np.arange(1, law.largest + 1))
    assert np.exp((k * n).sum()) == pytest.approx(1000.0, rel=1e-4)
    width = np.sqrt((k**2 * n).sum() - (k * n).sum() ** 2)
    assert np.exp(width) == pytest.approx(1.5, rel=1e-4)


def test_tails_of_the_lognormal_law() -> None:
    """Nine standard deviations above the median, and as far below, no digit is lost."""
    for median, sigma, k in ((6.0, 1.6, 420.0), (1e4, 2.0, 20.0)):
        law = stats.lognorm(s=np.log(sigma), scale=median)
        upper = law.sf(k - 0.5) - law.sf(k + 0.5)
        expected = upper if k > median else law.cdf(k + 0.5) - law.cdf(k - 0.5)
        found = sx.initial.lognormal(median, sigma, density=0.2).densities(int(k))[-1]
        assert found == pytest.approx(0.2 * expected, rel=1e-9, abs=0.0)


@pytest.mark.parametrize(
    ("median", "sigma", "change"),
    [(0.1, 2.0, True), (1.3, 1.05, True), (2.0, 2.0, True), (3.0, 1.5, False), (50.0, 3.0, False)],
)
def test_mass_that_rounding_changes_is_told(median: float, sigma: float, change: bool) -> None:
    law = sx.initial.lognormal(median, sigma, density=3.0)
    meant, found = law.mass
    assert meant == pytest.approx(3.0 * median * np.exp(np.log(sigma) ** 2 / 2), rel=1e-12)
    drawn = law.densities(law.largest) @ np.arange(1.0, law.largest + 1)
    assert found == pytest.approx(drawn, rel=1e-6)
    assert (abs(drawn / meant - 1) > 0.01) == change
    assert len(law.remarks) == change
    if change:
        assert f"{meant:.4g}, and {found:.4g}" in law.remarks[0]


def test_the_result_and_the_check_tell_of_mass_that_rounding_changes() -> None:
    model = runs.model(initial=sx.initial.lognormal(0.5, 1.5))
    text = r"M1 of the lognormal law is 0\.542.*, and 1\.0.*choose a smaller monomer"
    with pytest.warns(sx.SmoluxWarning, match=text):
        ds = sx.simulate(model, [0.1], method=QUICK[0], particles=100, replicas=2, seed=1)
    with pytest.warns(sx.SmoluxWarning, match=text):
        solved = sx.solve(model, [0.1], tolerance=1e-3)
    assert sx.results.warnings(ds) == sx.results.warnings(solved) == model.initial.remarks
    case = parse(
        '[kernel]\nname = "constant"\n[run]\ntimes = [1]\n'
        '[initial]\nname = "lognormal"\nmedian = 0.5\nsigma = 1.5\n'
    )
    assert physics_warnings(case) == model.initial.remarks


@every_initial
def test_the_seed_decides(initial: Any) -> None:
    first, again = populations(initial, 4), populations(initial, 8)
    for (a, b), (c, d) in zip(first, again, strict=False):
        np.testing.assert_array_equal(a, c)
        np.testing.assert_array_equal(b, d)
    if initial.largest > 1 and len(getattr(initial, "sizes", (1, 2))) > 1:
        other = populations(initial, 8, seed=4)
        assert any(
            not (np.array_equal(a, c) and np.array_equal(b, d))
            for (a, b), (c, d) in zip(again, other, strict=True)
        )


@pytest.mark.parametrize("method", runs.METHODS)
def test_at_time_zero(method: str) -> None:
    initial = sx.initial.from_sizes({1: 0.8, 3: 0.2})
    ds = sx.simulate(
        runs.model(initial=initial), [0.0, 0.1], method=method, particles=1000, replicas=2, seed=5,
        sizes=8,
    )  # fmt: skip
    start = ds.isel(time=0)
    np.testing.assert_allclose(start["n"].values, [[0.8, 0, 0.2, 0, 0, 0, 0, 0]] * 2)
    np.testing.assert_allclose(start["number_density"], 1.0)
    np.testing.assert_allclose(start["volume"], 1000.0)
    np.testing.assert_allclose(ds["moment"].sel(order=1), 1.4, rtol=1e-12)
    assert (start["largest"] == 3).all()
