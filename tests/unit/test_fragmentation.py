"""Bins and bounds of the splits of a size."""

from __future__ import annotations

import math

import numba
import numpy as np
import pytest

import smolux as sx
from smolux.callables import Function
from smolux.core import splits
from smolux.core.slots import slot_edges
from smolux.core.state import LONE_BITS
from smolux.processes import Fragmentation

EDGES = slot_edges(LONE_BITS).astype(float)


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
    rng = np.random.default_rng(1)
    for s in range(len(low)):
        for k in (low[s], high[s], *rng.integers(low[s], high[s], 4)):
            for b, (first, count) in enumerate(_stretches(int(k))):
                assert count <= widths[s, b]
                i = first + np.arange(count, dtype=float)
                largest = process.pairs(i, k - i).max(initial=0.0)
                assert largest <= bounds[s, b]
                if isinstance(law, str) and count:  # and not far off, for smooth laws
                    assert largest > 0.3 * bounds[s, b]


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
