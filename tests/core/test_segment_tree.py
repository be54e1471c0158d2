"""Segment trees against cumulative sums, and the slots that they are over."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smolux.core.slots import octave, slot_edges, slot_of
from smolux.methods.low_rank.segment_tree import (
    FANOUT,
    add,
    build,
    find,
    find_mixed,
    levels_of,
)

_build = numba.njit(lambda tree, levels, row: build(tree, levels, row))
_add = numba.njit(lambda tree, levels, row, slots, weights: add(tree, levels, row, slots, weights))
_find = numba.njit(lambda tree, levels, row, x: find(tree, levels, row, x))
_find_mixed = numba.njit(lambda tree, levels, rows, c, x: find_mixed(tree, levels, rows, c, x))
_slot = numba.njit(lambda size, bits: slot_of(size, bits))
_octave = numba.njit(lambda size: octave(size))

weights = st.lists(st.integers(0, 1 << 40), min_size=1, max_size=300)


def planted(*rows: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Make a tree with these weights."""
    slots = -(-max(map(len, rows)) // FANOUT) * FANOUT
    levels = levels_of(slots)
    tree = np.zeros((len(rows), levels[-1] + 1), np.int64)
    for row, values in enumerate(rows):
        tree[row, : len(values)] = values
        _build(tree, levels, row)
    return tree, levels


@given(weights, st.data())
@settings(max_examples=200, deadline=None)
def test_a_slot_is_found_where_the_cumulative_sum_passes(values: list[int], data: st.DataObject):
    tree, levels = planted(values)
    total = sum(values)
    assert tree[0, -1] == total
    if total == 0:
        return
    ends = np.cumsum(values)
    chosen = data.draw(st.integers(0, total - 1))
    edges = [int(x) for x in ends if x < total][:20]
    for x in [chosen, 0, total - 1, *edges, *(x - 1 for x in edges if x)]:
        slot, rest = _find(tree, levels, 0, x)
        assert slot == np.searchsorted(ends, x, side="right")
        assert rest == x - (ends[slot] - values[slot])
        assert 0 <= rest < values[slot]


@given(weights, st.lists(st.tuples(*[st.integers(0, 299)] * 3), max_size=40))
@settings(max_examples=100, deadline=None)
def test_sums_do_not_depend_on_the_history(values: list[int], changes: list[tuple[int, int, int]]):
    tree, levels = planted([0] * len(values), values)
    now = np.array(values)
    for k, slots in enumerate(changes):
        a, b, c = (slot % len(values) for slot in slots)
        change = (k + 1, 7 * k, 1 << k)
        _add(tree, levels, 1, (a, b, c), change)
        np.add.at(now, [a, b, c], change)
    fresh, _ = planted([0] * len(values), now.tolist())
    np.testing.assert_array_equal(tree, fresh)


@given(weights)
@settings(max_examples=50, deadline=None)
def test_empty_slots_at_the_end_change_nothing(values: list[int]) -> None:
    tree, levels = planted(values)
    padded, more = planted(values + [0] * 1000)
    assert padded[0, -1] == tree[0, -1]
    for x in range(0, sum(values), 1 + sum(values) // 7):
        assert _find(tree, levels, 0, x) == _find(padded, more, 0, x)


def test_rows_of_mixed_sign() -> None:
    rng = np.random.default_rng(1)
    n = rng.integers(0, 1000, 200)
    # i**2 - 2 i j + j**2 at j = 70, times the particles of each size
    i = np.arange(200)
    rows = [(n * i * i).tolist(), (n * i).tolist(), n.tolist()]
    tree, levels = planted(*rows)
    coefficients = np.array([1.0, -140.0, 4900.0])
    combined = n * (i - 70.0) ** 2
    ends = np.cumsum(combined)
    for x in rng.random(200) * ends[-1]:
        slot, rest = _find_mixed(tree, levels, 3, coefficients, x)
        assert slot == np.searchsorted(ends, x, side="right")
        assert rest == pytest.approx(x - (ends[slot] - combined[slot]), abs=1e-6 * ends[-1])
    slot, rest = _find_mixed(tree, levels, 3, coefficients, 2.0 * ends[-1])
    assert combined[slot] > 0.0
    assert rest <= combined[slot]


def test_the_tree_follows_its_weights_in_distribution() -> None:
    values = np.array([0, 5, 0, 1, 20, 0, 0, 3, 0, 0, 0, 11])
    tree, levels = planted(values.tolist())
    found = [_find(tree, levels, 0, x)[0] for x in range(values.sum())]
    np.testing.assert_array_equal(np.bincount(found, minlength=len(values)), values)


@pytest.mark.parametrize("bits", [0, 1, 3, 6, 8])
def test_slots_cover_all_sizes_once(bits: int) -> None:
    edges = slot_edges(bits)
    assert (np.diff(edges) > 0).all()
    assert edges[-1] == 1 << 62
    sizes = np.unique(np.concatenate([edges[1:-1], edges[1:] - 1, np.arange(1, 3000)]))
    sizes = sizes[sizes >= 1]
    found = [_slot(np.int64(size), np.int64(bits)) for size in sizes]
    np.testing.assert_array_equal(found, np.searchsorted(edges, sizes, side="right") - 1)
    # no slot is wider than its share of its first size
    wide = np.diff(edges)[1:] - 1
    assert (wide * 2.0**bits <= edges[1:-1]).all()


def test_octaves() -> None:
    for size in (1, 2, 3, 4, 1023, 1024, (1 << 61) - 1, 1 << 61):
        assert _octave(np.int64(size)) == size.bit_length() - 1
