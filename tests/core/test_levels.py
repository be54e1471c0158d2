"""Levels of sizes, and sums over sizes, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smolux.core.state import LIMIT
from smolux.jit.compile import entry
from smolux.methods.acceptance_rejection.levels import level_edges, level_of
from smolux.methods.inverse.sums import BLOCK, find, find_large, shift, weigh

EDGES = level_edges()


def test_edges():
    assert EDGES[:17].tolist() == list(range(1, 18))  # one size each
    assert EDGES[-1] == LIMIT
    assert (np.diff(EDGES) >= 1).all()
    assert EDGES.dtype == np.int64
    # no wider than an eighth of an octave, but for whole numbers
    upper, lower = EDGES[1:].astype(float), EDGES[:-1].astype(float)
    assert (upper < (lower + 1) * 2 ** (1 / 8) * (1 + 1e-12)).all()
    assert set(2 ** np.arange(62)) <= set(EDGES.tolist())


def _levels(edges, sizes, out):
    for k in range(sizes.shape[0]):
        out[k] = level_of(edges, sizes[k])


levels = entry(_levels)


def test_level_of_every_small_size():
    sizes = np.concatenate([np.arange(1, 100_000), EDGES[:-1], EDGES[1:] - 1])
    found = np.empty(len(sizes), np.int64)
    levels(EDGES, sizes, found)
    np.testing.assert_array_equal(found, np.searchsorted(EDGES, sizes, side="right") - 1)


@given(st.integers(1, LIMIT - 1))
def test_level_of_any_size(size):
    level = level_of.py_func(EDGES, size)
    assert EDGES[level] <= size < EDGES[level + 1]


# --- sums ----------------------------------------------------------------------------------------


def _search(number, rates, row, block, top, x, out):
    total = weigh(number, rates, row, block, top)
    for k in range(x.shape[0]):
        out[k] = find(number, rates, row, block, top, x[k])
    return total


def _search_large(weights, stored, x, out):
    for k in range(x.shape[0]):
        out[k] = find_large(weights, stored, x[k])


def _shifted(rate, table, i, j, gone, new, count, top):
    shift(rate, table, i, j, gone, new, count, top)


search, search_large, shifted = entry(_search), entry(_search_large), entry(_shifted)


def searched(number, rates, row, top, x):
    block = np.full(-(-len(number) // BLOCK), np.nan)
    out = np.empty(len(x), np.int64)
    total = search(number, rates, row, block, top, np.asarray(x, float), out)
    return total, block, out


whole = st.integers(0, 3).map(float)


@settings(deadline=None)  # the first call compiles
@given(st.lists(st.tuples(whole, whole), min_size=1, max_size=5 * BLOCK), st.data())
def test_find_is_the_inverse_of_the_cumulative_sum(entries, data):
    number = np.array([n for n, _ in entries])
    rates = np.array([[7.0] * len(entries), [r for _, r in entries]])
    top = data.draw(st.integers(1, len(entries)))
    weights = (number * rates[1])[:top]
    sums = np.cumsum(weights)
    # whole weights: every sum is exact, and each whole number and half lies in one place
    x = np.arange(0, sums[-1] + 2, 0.5)
    total, block, found = searched(number, rates, 1, top, x)
    assert total == sums[-1]
    used = -(-top // BLOCK)
    np.testing.assert_array_equal(
        block[:used], [weights[b * BLOCK : (b + 1) * BLOCK].sum() for b in range(used)]
    )
    assert np.isnan(block[used:]).all()
    expected = np.searchsorted(sums, x, side="right")
    np.testing.assert_array_equal(found, np.where(x < total, expected, -1))


@settings(deadline=None)
@given(st.lists(whole, min_size=0, max_size=40), st.integers(0, 3))
def test_find_large(weights, unused):
    given_weights = np.array([*weights, *[5.0] * unused])
    sums = np.cumsum(weights)
    x = np.arange(0, (sums[-1] if len(sums) else 0) + 2, 0.5)
    out = np.empty(len(x), np.int64)
    search_large(given_weights, len(weights), x, out)
    positive = np.flatnonzero(weights)
    last = positive[-1] if len(positive) else -1
    expected = np.searchsorted(sums, x, side="right")
    np.testing.assert_array_equal(out, np.where(expected < len(weights), expected, last))


def test_rounding_never_finds_what_is_not_there():
    random = np.random.default_rng(1)
    number = random.integers(0, 2, 1000).astype(float)
    rates = random.random((1, 1000))
    weights = number * rates[0]
    total, block, _ = searched(number, rates, 0, 1000, [])
    assert total == pytest.approx(weights.sum(), rel=1e-12)
    sums = np.cumsum(block)
    near = np.concatenate([sums * (1 + s) for s in (-1e-15, 0, 1e-15)])
    x = np.concatenate([near, random.random(2000) * total])
    found = searched(number, rates, 0, 1000, x)[2]
    assert (found[x < total * (1 - 1e-12)] >= 0).all()
    inside = found[found >= 0]
    assert (weights[inside] > 0).all()
    exact = np.searchsorted(np.cumsum(weights), x[found >= 0], side="right")
    off = exact != inside
    np.testing.assert_allclose(  # only where the sums agree to rounding
        np.cumsum(weights)[np.minimum(exact, inside)][off], x[found >= 0][off], rtol=1e-12
    )


def test_frequencies_are_the_weights():
    random = np.random.default_rng(2)
    number = random.integers(0, 5, 200).astype(float)
    rates = random.random((3, 200))
    weights = number * rates[2]
    x = np.linspace(0, weights.sum(), 400_000, endpoint=False)
    found = searched(number, rates, 2, 200, x)[2]
    share = np.bincount(found, minlength=200) / len(x)
    np.testing.assert_allclose(share, weights / weights.sum(), atol=4 / len(x))


def test_shift_accounts_for_an_event():
    random = np.random.default_rng(3)
    table = random.random((40, 40))
    table += table.T
    number = random.integers(2, 6, 40).astype(float)
    rate = table @ number
    i, j, new, top = 3, 7, 11, 30
    after = number.copy()
    after[i] -= 1
    after[j] -= 1
    after[new] += 1
    changed = rate.copy()
    shifted(changed, table, i, j, 1.0, new, 1.0, top)
    np.testing.assert_allclose(changed[:top], (table @ after)[:top], rtol=1e-13)
    np.testing.assert_array_equal(changed[top:], rate[top:])
    # a shattering event makes many, and of two entries only the first counts the loss
    shifted(changed, table, i, j, 0.0, 0, 10.0, top)
    after[0] += 10
    np.testing.assert_allclose(changed[:top], (table @ after)[:top], rtol=1e-13)
