"""Single particles: splits from their own law, rates of few sizes, a few large ones that break."""

from __future__ import annotations

from typing import Any

import laws
import numpy as np
import pytest
from scipy import stats

import smolux as sx

P = sx.processes
ALONE = sx.kernels.Constant(1e-30)
#: one model for nearly all tests, so that they share their loops: breakage of one size or into
#: halves, and removal by a list
FORMULA = (
    "c0*(i*j)**p*max(0, 1 - w*abs(i + j - k0)) + c1*max(0, 1 - max(0, abs(i - j) - 1)) + 1e-30"
)
#: a test fails once in 10^4 if all is right
LEAST = 1e-4
METHODS = [
    pytest.param(m.name, marks=() if m.name == "size-class" else pytest.mark.slow)
    for m in sx.methods.METHODS
]


def _model(
    start: Any, removal: Any = (0.0, 0.0), *, c0: float = 0.0, p: float = 0.0, k0: float = 2.0,
    c1: float = 0.0, w: float = 1.0,
) -> sx.Model:  # fmt: skip
    law = sx.kernels.formula(FORMULA, c0=c0, p=p, k0=k0, c1=c1, w=w)
    if isinstance(start, int):
        start = sx.initial.monodisperse(size=start)
    return sx.Model(ALONE, [P.Aggregation(), P.Removal(removal), P.Fragmentation(law)], start)


def _only(size: int, rate: float, others: float = 0.0) -> list[float]:
    """Rates by size: one size has another rate than all others."""
    return [others] * (size - 1) + [rate, others]


def _run(model: sx.Model, end: float, **settings: Any) -> Any:
    given = {"particles": 4000, "replicas": 4, "population": "fixed-volume", "bins_per_octave": 1}
    return sx.simulate(model, [end], seed=1, **given | settings)


@pytest.mark.parametrize("size", [24, 20_000])
@pytest.mark.parametrize("method", METHODS)
def test_splits_have_their_own_law(method: str, size: int) -> None:
    """Rates of all splits, of equal halves in particular; sizes with an exact rate and without."""
    i = np.arange(1.0, size // 2 + 1)
    rate = np.where(2 * i == size, 0.5, 1.0) * (i * (size - i)) ** -0.5
    model = _model(size, c0=1.0 / rate.sum(), p=-0.5, k0=size)
    ds = _run(model, 0.7, method=method, distribution=True)
    start = ds["particles"].sizes["replica"] * 4000
    broken = int(ds["events"].sel(process="fragmentation").sum())
    assert stats.binomtest(broken, start, 1.0 - np.exp(-0.7)).pvalue > LEAST
    found = np.zeros(size // 2)
    for replica in ds["replica"].values:
        sizes, counts = sx.results.population(ds, replica, 0.7)
        small = 2 * sizes <= size
        np.add.at(
            found, sizes[small] - 1, np.where(2 * sizes == size, 0.5, 1.0)[small] * counts[small]
        )
    assert found.sum() == broken
    # classes of at least fifty
    groups = np.minimum(np.cumsum(rate / rate.sum()) * 100, 99.0).astype(int)
    expected = np.bincount(groups, rate / rate.sum() * broken)
    held = expected > 0
    assert stats.chisquare(np.bincount(groups, found)[held], expected[held]).pvalue > LEAST
    if size <= 2**14:  # equal halves alone
        share = rate[-1] / rate.sum()
        assert stats.binomtest(int(found[-1]), broken, share).pvalue > LEAST


def test_halves_of_large_sizes_take_few_candidates() -> None:
    """Of 40960 there is one split of 20480; its bin and bounds know of far more."""
    ds = _run(_model(40_960, c1=2.0), 2.0, particles=500, replicas=20)
    laws.agree(ds["particles"].values[:, 0] / 500, np.exp(2.0), "particles")
    assert ds["attempts"].sel(process="fragmentation").sum() < 3 * ds["events"].sum()


@pytest.mark.parametrize("method", METHODS)
def test_random_scission(method: str) -> None:
    """Every bond breaks by itself: sizes above 1000 have bounds, and are known one by one below."""
    bonds, broken = 4999, 1.0 - np.exp(-2e-3)
    settings = {"replicas": 20, "particles": 100}
    ds = _run(_model(bonds + 1, c0=1.0, w=0.0), 4e-3, method=method, **settings)
    events = int(ds["events"].sel(process="fragmentation").sum())
    assert stats.binomtest(events, 2000 * bonds, broken).pvalue > LEAST
    # pairs of monomers are in one piece if no bond between them is broken
    apart = np.arange(1, bonds + 1)
    square = bonds + 1 + 2.0 * ((bonds + 1 - apart) * (1.0 - broken) ** apart).sum()
    found = ds["moment"].sel(order=2).values[:, 0] / ds["moment"].sel(order=1).values[:, 0]
    laws.agree(found, square / (bonds + 1), "square")


@pytest.mark.parametrize("method", METHODS)
def test_sizes_stored_together_have_their_own_rates(method: str) -> None:
    """Two to an octave in the store, eight in the counts; each leaves at its rate."""
    rates = {3: 0.5, 1030: 1.0, 1040: 0.3, 1300: 0.1, 1500: 2.0, 1501: 0.0}
    listed = [0.0] * 1501
    for size, rate in rates.items():
        listed[size - 1] = rate
    start = sx.initial.from_sizes(dict.fromkeys(rates, 1.0 / len(rates)))
    model = _model(start, listed)
    ds = _run(model, 0.7, method=method, particles=3000, sizes=1501)
    left = np.rint((ds["n"] * ds["volume"]).sum(["replica", "time"]))
    for size, rate in rates.items():
        number = int(left.sel(size=size))
        assert stats.binomtest(number, 2000, np.exp(-0.7 * rate)).pvalue > LEAST, size
    assert ds["attempts"].sel(process="removal").sum() < 5 * ds["events"].sum() + 2000


def _of_one_size(k: float) -> float:
    return 1.0 if k == 1030 else 0.0


def _splits_of_one_size(i: float, j: float) -> float:
    return 2.0 / 1029 if i + j == 1030 else 0.0


@pytest.mark.slow
def test_functions_of_one_size_are_not_overlooked() -> None:
    """Python functions known by their values, not zero for one size only."""
    processes = [
        P.Aggregation(), P.Removal(_of_one_size), P.Evaporation(_of_one_size),
        P.Fragmentation(_splits_of_one_size),
    ]  # fmt: skip
    model = sx.Model(ALONE, processes, sx.initial.monodisperse(size=1030))
    ds = _run(model, 0.4, method="size-class", sizes=1030)
    left = int(np.rint(ds["n"].sel(size=1030) * ds["volume"]).sum())
    assert stats.binomtest(left, 16_000, np.exp(-3 * 0.4)).pvalue > LEAST
    events = ds["events"].sum(["replica", "time"])
    for name in ("removal", "evaporation", "fragmentation"):
        share = (1.0 - np.exp(-3 * 0.4)) / 3
        assert stats.binomtest(int(events.sel(process=name)), 16_000, share).pvalue > LEAST


@pytest.mark.parametrize("method", METHODS)
def test_a_rate_that_left_is_forgotten(method: str) -> None:
    """One size of a slot leaves at once; the bound it leaves must not stand for its neighbours."""
    start = sx.initial.from_sizes({1030: 0.5, 1031: 0.5})
    model = _model(start, _only(1030, 1e9, 1e-3))
    ds = _run(model, 500.0, method=method, particles=1000)
    number = int(ds["particles"].sum())
    assert stats.binomtest(number, 2000, np.exp(-0.5)).pvalue > LEAST
    assert ds["attempts"].sel(process="removal").max() < 50_000


@pytest.mark.slow
def test_a_giant_does_not_slow_down_the_rest() -> None:
    """A rate that grows by e every hundred monomers; against the rate equations."""
    breakage = P.Fragmentation("0.2*exp(0.01*min(i + j, 2000))/(i + j - 1)")
    model = sx.Model(sx.kernels.Shear(1.0), [P.Aggregation(), breakage])
    ds = sx.simulate(model, [0.9], particles=2000, replicas=16, seed=1)
    exact = sx.solve(model, [0.9])
    for order in (0, 2):
        found = ds["moment"].sel(order=order).values[:, 0]
        laws.agree(found, float(exact["moment"].sel(order=order).squeeze()), order)
    assert ds["attempts"].sum() < 10 * ds["events"].sum()


@pytest.mark.slow
def test_few_accepted_candidates_are_warned_of() -> None:
    """Acceptance-rejection finds the one large particle by trying all."""
    start = sx.initial.from_sizes({2: 1 - 1e-4, 1030: 1e-4})
    model = _model(start, _only(1030, 1.0))
    with pytest.warns(sx.SmoluxWarning, match="fewer than 1 in 1000"):
        ds = _run(model, 50.0, method="acceptance-rejection", particles=20_000, replicas=16)
    assert ds["events"].sel(process="removal").sum() == 32
