"""The inverse method, compiled: how a pair is drawn and the rates are kept."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from smolux.core import rng
from smolux.core.bounds import note_bad, note_largest
from smolux.core.loop import Pieces
from smolux.core.state import (
    FIRST,
    LARGEST,
    PARTICLES,
    SECOND,
    SINCE,
    STORED,
    TRIALS,
    VALUE,
    VOLUME,
)
from smolux.core.store import Store, pieces_of
from smolux.jit.compile import cold_piece, piece

from .store import double, make_visit, pick, size_at, take, top_of, view
from .sums import find, find_large, shift, weigh

#: events after which the sums are computed afresh, so that rounding does not pile up
_REFRESH = 1 << 16
#: the same, when the sum of all has fallen to this share of what it was: what rounding has left of
#: what was subtracted is then no longer small
_FALL = 1e-8


@cold_piece
def _first(s, w, small, x):
    """Slot of the first particle, by its rate with all others."""
    top, buckets = top_of(s, w), w.table.shape[1]
    if x < small:
        k = find(w.number, w.rate, 0, w.block, top, x)
        if k >= 0:
            return k
    d = find_large(w.large_rate, s.count[STORED], x - small)
    return buckets + d if d >= 0 else -1


def _make_rates(rate: Any) -> tuple[Any, Any, Any, Any]:
    @piece
    def pair_rate(s, w, i, j, met, p):
        """Rate of two sizes; 0 where the kernel gives none, which is noted if they have `met`."""
        if i <= w.table.shape[1] and j <= w.table.shape[1]:
            return w.table[i - 1, j - 1]
        value = rate(float(i), float(j), *p)
        if 0.0 <= value < math.inf:
            return value
        if met:
            note_bad(s, i, j, value)
        return 0.0

    @cold_piece
    def row_of(s, w, scratch, size, top, p):
        """Row of the table with the rates of `size` with the sizes ``1 .. top``."""
        buckets = w.table.shape[1]
        if size <= buckets:
            return size - 1
        row = buckets + scratch
        for k in range(top):
            w.table[row, k] = pair_rate(s, w, np.int64(k + 1), size, w.number[k] > 0.0, p)
        return np.int64(row)

    @cold_piece
    def own_rate(s, w, size, d, p):
        """Rate of a particle with all others: a large one in place `d`, or one of a bucket (-1)."""
        top = top_of(s, w)
        met = d >= 0 or w.number[size - 1] > 0.0
        row = row_of(s, w, 0, size, top, p)
        if d < 0:  # left out, not subtracted: its rate with itself may exceed all others
            w.number[size - 1] -= 1.0
        total = weigh(w.number, w.table, row, w.block, top)
        if d < 0:
            w.number[size - 1] += 1.0
        for k in range(s.count[STORED]):
            if k != d:
                total += pair_rate(s, w, size, w.large[k], met, p)
        return total

    @cold_piece
    def look(s, w, size):
        """Note a pair of buckets that are present for which the kernel gives no rate."""
        row = w.table.shape[1] + 2 + size
        if w.number[size - 1] > 0.0:
            for k in range(top_of(s, w)):
                others = w.number[k] - (1.0 if k == size - 1 else 0.0)
                if others > 0.0 and not 0.0 <= w.table[row, k] < math.inf:
                    note_bad(s, size, np.int64(k + 1), w.table[row, k])

    return pair_rate, row_of, own_rate, look


def _make_total(renew: Any) -> Any:
    @piece
    def summed(s, w):
        """Sum of all rates: of the buckets, and of the large particles."""
        small = weigh(w.number, w.rate, 0, w.block, top_of(s, w))
        large = 0.0
        for d in range(s.count[STORED]):
            large += w.large_rate[d]
        return small, large

    @piece
    def total_of(s, w, p):
        """Sum the rates, which are computed afresh if the sum has fallen far."""
        small, large = summed(s, w)
        if small + large < _FALL * w.peak[0]:
            renew(s, w, p)
            small, large = summed(s, w)
        w.peak[0] = max(w.peak[0], small + large)
        return small, large

    return total_of


def _make_draw(pair_rate: Any, row_of: Any, total_of: Any) -> Any:
    @cold_piece
    def second(s, w, a, p):
        """Slot of the second particle, by its rate with the first, which is left out."""
        top, buckets, stored = top_of(s, w), w.table.shape[1], s.count[STORED]
        size = size_at(s, w, a)
        row = row_of(s, w, 0, size, top, p)
        if a < buckets:
            w.number[a] -= 1.0
        small = weigh(w.number, w.table, row, w.block, top)
        large = 0.0
        for d in range(stored):
            if buckets + d != a:
                large += pair_rate(s, w, size, w.large[d], True, p)
        x = rng.uniform(s.rng) * (small + large)
        slot = find(w.number, w.table, row, w.block, top, x) if x < small else -1
        if slot < 0:
            x -= small
            for d in range(stored):
                weight = pair_rate(s, w, size, w.large[d], False, p)
                if buckets + d != a and weight > 0.0:
                    slot = buckets + d
                    if x < weight:
                        break
                    x -= weight
        if a < buckets:
            w.number[a] += 1.0
        return slot

    @cold_piece
    def draw(s, w, p, factor, limit):
        s.count[FIRST] = -1
        s.count[TRIALS] += 1
        if not 0.0 <= s.clock[VALUE] < math.inf:
            return math.nan
        small, large = total_of(s, w, p)
        total = small + large
        if not total < math.inf:
            note_bad(s, 0, 0, total)
            return math.nan
        if s.count[PARTICLES] < 2 or total <= 0.0:
            return math.inf
        wait = rng.exponential(s.rng) * 2.0 * s.clock[VOLUME] / (total * factor)
        a = _first(s, w, small, rng.uniform(s.rng) * total)
        if a >= 0:
            b = second(s, w, a, p)
            if b >= 0:
                s.count[FIRST], s.count[SECOND] = a, b
        return wait

    return draw


def _make_room(own_rate: Any) -> Any:
    @cold_piece
    def reach(s, w, size, p):
        """Raise the largest size to which rates are kept."""
        old = top_of(s, w)
        note_largest(s, size)
        for k in range(old, top_of(s, w)):
            w.rate[0, k] = 0.0
        for k in range(old, top_of(s, w)):
            w.rate[0, k] = own_rate(s, w, np.int64(k + 1), -1, p)

    @piece
    def room(s, w, gone, entries, p):
        buckets = w.table.shape[1]
        needed = 0
        for e in range(entries):
            if s.sizes[e] > buckets:
                needed += s.counts[e]
        if s.count[STORED] + needed > w.large.shape[0]:
            return False
        for e in range(entries):
            reach(s, w, s.sizes[e], p)
        return True

    return room


def _make_put(pair_rate: Any, row_of: Any, own_rate: Any, look: Any) -> Any:
    @cold_piece
    def account(s, w, i, j, gone, size, count, p):
        """Account in all rates for `gone` of `i` and `j` each and `count` new ones of `size`."""
        top = top_of(s, w)
        shift(
            w.rate[0],
            w.table,
            row_of(s, w, 0, i, top, p),
            row_of(s, w, 1, j, top, p),
            gone,
            row_of(s, w, 2, size, top, p),
            float(count),
            top,
        )
        for d in range(s.count[STORED]):
            large = w.large[d]
            w.large_rate[d] += count * pair_rate(s, w, size, large, True, p) - gone * (
                pair_rate(s, w, i, large, False, p) + pair_rate(s, w, j, large, False, p)
            )

    @cold_piece
    def arrive(s, w, size, count, p):
        """Put `count` particles of `size` in, the rates of all others being up to date."""
        buckets = w.table.shape[1]
        if size <= buckets:
            w.number[size - 1] += count
            if w.number[size - 1] == count:  # the first: its rate with itself was subtracted
                w.rate[0, size - 1] = own_rate(s, w, size, -1, p)
            if w.table.shape[0] > buckets + 3:
                look(s, w, size)
            return
        first = s.count[STORED]
        for d in range(first, first + count):
            w.large[d] = size
        s.count[STORED] += count
        own = own_rate(s, w, size, first, p)
        for d in range(first, first + count):
            w.large_rate[d] = own

    @piece
    def put(s, w, size, count, i, j, p):
        # of both; half of either if it is one
        share = 1.0 if j > 0 else 0.5 if i > 0 else 0.0
        i = max(i, np.int64(1))
        account(s, w, i, j if j > 0 else i, share, size, count, p)
        arrive(s, w, size, count, p)

    return put


def _make_renew(own_rate: Any, look: Any) -> Any:
    @cold_piece
    def renew(s, w, p):
        """Compute every rate afresh, and the largest size."""
        largest = np.int64(0)
        for k in range(w.table.shape[1]):
            if w.number[k] > 0.0:
                largest = np.int64(k + 1)
        for d in range(s.count[STORED]):
            largest = max(largest, w.large[d])
        s.count[LARGEST] = largest
        for k in range(top_of(s, w)):
            w.rate[0, k] = own_rate(s, w, np.int64(k + 1), -1, p)
            if w.table.shape[0] > w.table.shape[1] + 3:
                look(s, w, np.int64(k + 1))
        for d in range(s.count[STORED]):
            w.large_rate[d] = own_rate(s, w, w.large[d], d, p)
        s.count[SINCE] = 1
        w.peak[0] = 0.0

    return renew


def _make_prepare(renew: Any) -> Any:
    @piece
    def prepare(s, w, p):
        if s.count[SINCE] == 0 or s.count[SINCE] > _REFRESH:
            renew(s, w, p)
        return 0

    return prepare


def bind(rate: Any, tally: Any) -> Pieces:
    """Bind the pieces to a rate and a way to count."""
    pair_rate, row_of, own_rate, look = _make_rates(rate)
    renew = _make_renew(own_rate, look)
    put = _make_put(pair_rate, row_of, own_rate, look)
    store = Store(view, size_at, pick, _make_room(own_rate), take, put, double, make_visit(tally))
    draw = _make_draw(pair_rate, row_of, _make_total(renew))
    return pieces_of(store, draw, _make_prepare(renew), cold=True)
