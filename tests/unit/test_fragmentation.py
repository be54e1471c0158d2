"""Bins and bounds of the splits of a size."""

from __future__ import annotations

import math

import numba
import numpy as np
import pytest
from scipy import stats

import smolux as sx
from smolux.core import seeds, splits
from smolux.core.slots import slot_edges
from smolux.core.state import UNARY_BITS, State, new_state
from smolux.functions.user_function import Function
from smolux.processes import Fragmentation
from smolux.stochastic import parameters as parameters_of

#: any power of the product, in one compiled function
LAW = "(i*j)**p"
TOTAL, _, PART = splits.bind_splits(sx.kernels.formula(LAW, p=0.0).rate)
EDGES = slot_edges(UNARY_BITS).astype(float)


@numba.njit
def _stretches(k):
    """First split and number of splits of each bin."""
    return [splits.stretch(k, b) for b in range(splits.bins_of(k))]


def halves(i, j):
    return 1.0 if abs(i - j) <= 1 else 0.0


def monomers(i, j):
    return 1.0 if min(i, j) == 1 else 0.0


@pytest.mark.parametrize("sizes", [range(2, 600), (4095, 4096, 4097, 16384, 16385, 123457)])
def test_every_split_is_in_one_bin(sizes: object) -> None:
    for k in sizes:
        found = np.concatenate([first + np.arange(count) for first, count in _stretches(k)])
        np.testing.assert_array_equal(np.sort(found), np.arange(1, k // 2 + 1))


@pytest.mark.parametrize(
    "law", [1.5, "2/(i+j-1)", "1/(i*j)", "i*j", sx.kernels.Shear(1.0), halves, monomers]
)
def test_bounds_hold_in_the_bins(law: object) -> None:
    process = Fragmentation(law)
    slots = splits.slots_beside(20_000)
    low, high = EDGES[slots], EDGES[1:][slots] - 1.0
    bounds, widths, _, _ = process.split_bounds(low, high, process.pairs.bounds)
    assert np.isfinite(bounds).all()
    random = np.random.default_rng(1)
    for s in range(len(low)):
        for k in (low[s], high[s], *random.integers(low[s], high[s], 4)):
            for b, (first, count) in enumerate(_stretches(int(k))):
                assert count <= widths[s, b]
                i = first + np.arange(count, dtype=float)
                largest = process.pairs(i, k - i).max(initial=0.0)
                assert largest <= bounds[s, b]
                if isinstance(law, str) and count:  # and not far off, for smooth laws
                    assert largest > 0.3 * bounds[s, b]


def test_bounds_of_a_slot_hold_for_its_largest_size() -> None:
    """A law that is 21 for the largest size of a slot, and 1 for all others."""
    slots = splits.slots_beside(20_000)
    for slot, top in zip(range(slots.start, slots.stop), EDGES[1:][slots] - 1.0, strict=True):
        law = sx.kernels.formula("1 + 20*max(0, 1 - abs(i + j - top))", top=top)
        processes = [sx.processes.Aggregation(), Fragmentation(law)]
        parameters = parameters_of.factor_parameters(processes)
        parameters_of.bound_splits(processes, parameters, 20_000)
        known = parameters.unary[0][1]
        assert known.bounds[slot - splits._FIRST].max() >= 21.0 * (top // 2)


@numba.njit
def _drawn(s, q, size, times, found):
    """Draw splits of a size, 0 for those that came to nothing; return the rate of all draws."""
    for _ in range(times):
        found[PART(size, s, q)] += 1
    return TOTAL(size, s, q)


@pytest.mark.parametrize("p", [0.0, -1.0, 1.0])
@pytest.mark.parametrize("size", [2, 3, 97, 1023, 1500, 5000, 16_384, 18_433])
def test_splits_are_drawn_by_their_rates(size: int, p: float) -> None:
    """From exact rates as from bounds, of which the remainder comes to nothing."""
    process = Fragmentation(sx.kernels.formula(LAW, p=p))
    known = splits.new_splits(True)
    sizes = splits.slots_beside(size)
    if size > 1024:
        low, high = EDGES[sizes], EDGES[1:][sizes] - 1.0
        splits.fill(known, sizes, *process.split_bounds(low, high, process.pairs.bounds))
        assert not known.narrow.any()
    states = new_state(seeds.streams(1, 0, 1), 1, 2, 1)
    found, n = np.zeros(size // 2 + 1, np.int64), 40_000
    total = _drawn(State(*(a[0] for a in states)), (process.parameters, known), size, n, found)
    i = np.arange(1.0, size // 2 + 1)
    rates = np.where(2 * i == size, 0.5, 1.0) * process.pairs(i, size - i)
    assert rates.sum() <= total * (1 + 1e-12)
    assert (found[0] == 0) == (size <= 1024)
    share = np.concatenate([[max(1.0 - rates.sum() / total, 0.0)], rates / total])
    # some sixty cells of about the same number
    cells = np.append(0, 1 + np.minimum(np.cumsum(share[1:]) * 60, 59.0).astype(int))
    expected = np.bincount(cells, share * n)
    held = expected > 1e-9
    observed = np.bincount(cells, found)[held]
    assert observed.sum() == n
    assert held.sum() == 1 or stats.chisquare(observed, expected[held]).pvalue > 1e-4


def test_narrow_laws_are_told_apart() -> None:
    slots = splits.slots_beside(20_000)
    low, high = EDGES[slots], EDGES[1:][slots] - 1.0
    for law, narrow in ((halves, True), ("2/(i+j-1)", False), ("1/(i*j)", False)):
        known = splits.new_splits(True)
        process = Fragmentation(law)
        splits.fill(known, slots, *process.split_bounds(low, high, process.pairs.bounds))
        rows = slice(slots.start - splits._FIRST, slots.stop - splits._FIRST)
        assert known.narrow[rows].tolist() == [narrow] * 8
        assert known.narrow.sum() == 8 * narrow
        assert (known.bounds[:, 0] == -1.0).sum() == len(known.bounds) - 8


def test_what_is_too_large_is_infinite() -> None:
    """As compiled code has it: no bare OverflowError, whatever sizes are tried."""
    law = Function.of(lambda k: math.exp(math.lgamma(k)), ("k",), "the law")
    assert law.scalar((1e3,), ()) == math.inf
