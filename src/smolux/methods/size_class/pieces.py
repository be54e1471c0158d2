"""How the size-class method draws the next pair, compiled."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from smolux.core import rng
from smolux.core.bounds import ROUNDING, note_bad, repair
from smolux.core.burst import LAST, NOT_PLAIN, PLAIN, Burst, make_draw_one
from smolux.core.loop import PATIENCE, Pieces
from smolux.core.pick import largest_rate, slots_with, takes
from smolux.core.state import FIRST, MAJORANT, PARTICLES, SINCE, TRIALS, VOLUME
from smolux.core.store import Store, pieces_of
from smolux.jit.compile import at, cold_piece, piece
from smolux.jit.prefetch import prefetch
from smolux.jit.wide import upper_half

from . import alias
from .lists import place_in, place_of_particle, size_at, size_of_particle
from .state import AHEAD, BITS, BLOCK, FREE, NEXT, PAIRS, SLOT, SLOT_BITS, STALE, view
from .store import chunks_for, double, insert, listed, make_visit, remove
from .table import prepare


@piece
def size(s, w, place):
    """Size of a particle."""
    return size_of_particle(w, place)


@piece
def pick(s, w, r, c):
    """See `smolux.core.loop.Pieces`."""
    first, last, low, high = slots_with(c, w.meta[BITS])
    total, largest = np.int64(0), largest_rate(s, r, low, high)
    for g in range(first, min(last + 1, w.number.shape[0])):
        total += w.number[g]
    while True:
        k, g = rng.below(s.rng, total), first
        while k >= w.number[g]:
            k -= w.number[g]
            g += 1
        one = (g << SLOT_BITS) | k
        size = size_of_particle(w, one)
        if low == high or takes(s, r, size, largest):
            return one, size
        s.count[TRIALS] += 1


@piece
def _aim(w, g, slot):
    """Place of a slot, of which the memory is asked for."""
    there = place_in(w, g, slot)
    prefetch(w.pool, there)
    return there


@piece
def _aim_at_row(w, g, slot):
    """Place of a slot, of which the memory is asked for, and that of its row."""
    there = _aim(w, g, slot)
    prefetch(w.rows, there * w.mixed.shape[0])
    return there


@lru_cache(maxsize=2)
def _make_draw_ahead(rows: bool) -> Any:
    aim = _aim_at_row if rows else _aim

    @cold_piece
    def draw_ahead(w, s, a, b, c, d):
        """Draw candidates: they depend on the table alone, not on the events in between.

        One kind of number after the other: short loops overlap their reads of memory.
        """
        pairs = np.uint64(w.meta[PAIRS])
        for k in range(AHEAD):
            word, a, b, c, d = rng.step(a, b, c, d)
            code, column, rest, sure = alias.draw(w.table, pairs, word)
            w.one[at(k)] = code
            w.rest[at(k)] = rest
            w.column[at(k)] = -1 if sure else np.int64(column)
        for k in range(AHEAD):
            g, h = w.one[at(k)] >> 16, w.one[at(k)] & 0xFFFF
            x, a, b, c, d = rng.step(a, b, c, d)
            y, a, b, c, d = rng.step(a, b, c, d)
            x = np.int64(upper_half(x, np.uint64(w.room[at(g)])))
            y = np.int64(upper_half(y, np.uint64(w.room[at(h)])))
            w.one[at(k)] = (g << SLOT_BITS) | x
            w.two[at(k)] = (h << SLOT_BITS) | y
            w.place_one[at(k)] = aim(w, g, x)
            w.place_two[at(k)] = aim(w, h, y)
        for k in range(AHEAD):
            w.wait[at(k)], a, b, c, d = rng.exponential_of(s, a, b, c, d)
        w.meta[NEXT] = 0
        return a, b, c, d

    return draw_ahead


@piece
def _raise_bound(w, g, h, value):
    w.high[g, h] = w.high[h, g] = 1.1 * value
    w.low[g, h] = w.low[h, g] = 0.0
    w.meta[STALE] = 1


def make_find(rate: Any, rows: bool = False) -> Any:
    """Bind the search for the next pair, see `smolux.core.burst.Burst`; with `rows` or without."""
    draw_ahead = _make_draw_ahead(rows)

    @cold_piece
    def look_beside(w, g, size, p):
        """Try a size that broke one bound with one particle of each class: it may break more."""
        for h in range(w.number.shape[0]):
            if w.number[h] > 0:
                other = size_of_particle(w, np.int64(h) << SLOT_BITS)
                value = rate(float(size), float(other), *p)
                if w.high[g, h] * ROUNDING < value < math.inf:
                    _raise_bound(w, g, h, value)

    @cold_piece
    def broken(s, w, g, h, i, j, value, p):
        """Take in a rate above its bound, and others that may be, before they are missed."""
        repair(s, i, j, value, w.high[g, h])
        _raise_bound(w, g, h, value)
        look_beside(w, g, i, p)
        look_beside(w, h, j, p)

    @piece
    def accepts(s, w, g, h, i, j, k, p):
        """Whether the rate accepts candidate `k`: 1 or 0; -1 if there is no rate."""
        column = w.column[at(k)]
        if column < 0:
            return 1
        value = rate(float(i), float(j), *p)
        if not 0.0 <= value <= w.high[at(g), at(h)]:
            if not 0.0 <= value < math.inf:
                note_bad(s, i, j, value)
                return -1
            if value > w.high[at(g), at(h)] * ROUNDING:
                broken(s, w, g, h, i, j, value, p)
            return 1
        u = alias.remainder(w.table, np.uint64(column), w.rest[at(k)])
        return 1 if u * w.high[at(g), at(h)] < value else 0

    @piece
    def find(s, w, p, factor, limit, held, n, trials, c0, c1, c2, c3):
        """See `smolux.core.burst.Burst`; NaN for a rate that is none, which has been noted."""
        waited, last = 0.0, trials + PATIENCE
        while trials < last:
            if w.meta[NEXT] == AHEAD:
                c0, c1, c2, c3 = draw_ahead(w, s.rng, c0, c1, c2, c3)
            k = w.meta[NEXT]
            w.meta[NEXT] = k + 1
            waited += w.wait[at(k)]
            if limit < math.inf and waited * held[0] >= limit:
                return limit, -1, -1, 0, 0, trials, c0, c1, c2, c3
            trials += 1
            one, two = w.one[at(k)], w.two[at(k)]
            g, a, h, b = one >> SLOT_BITS, one & SLOT, two >> SLOT_BITS, two & SLOT
            if a >= w.number[at(g)] or b >= w.number[at(h)] or one == two:
                continue
            i = size_at(w, g, w.place_one[at(k)])
            j = size_at(w, h, w.place_two[at(k)])
            taken = accepts(s, w, g, h, i, j, k, p)
            if taken < 0:
                return math.nan, one, two, i, j, trials, c0, c1, c2, c3
            if taken == 1:
                return waited * held[0], one, two, i, j, trials, c0, c1, c2, c3
        # if nearly all are in vain, candidates are for places that are empty by now
        w.meta[STALE] = 1
        return waited * held[0], -1, -1, 0, 0, trials, c0, c1, c2, c3

    return find


def make_draw(find: Any) -> Any:
    """Bind the drawing of a pair, see `smolux.core.loop.Pieces`."""
    draw_one = make_draw_one(find)

    @piece
    def draw(s, w, p, factor, limit):
        s.count[FIRST] = -1
        if s.count[PARTICLES] < 2 or s.clock[MAJORANT] <= 0.0:
            return math.inf
        return draw_one(s, w, p, factor, limit, hold(s, w, factor))

    return draw


@lru_cache(maxsize=2)
def make_remove(remove: Any) -> Any:
    """Bind taking one of a pair out, or both, to taking out one particle."""

    @piece
    def remove_of_pair(w, gone, a, place_a, b, place_b):
        g, h = a >> SLOT_BITS, b >> SLOT_BITS
        if gone != 3:
            if gone == 1:
                remove(w, g, place_a)
            else:
                remove(w, h, place_b)
            return
        # the later slot of a class goes first: then the other stays where it is
        if g == h and a > b:
            place_a, place_b = place_b, place_a
        remove(w, h, place_b)
        remove(w, g, place_a)

    return remove_of_pair


_remove = make_remove(remove)


@piece
def room(s, w, gone, entries, p):
    """See `smolux.core.store.Store`."""
    chunks = together = np.int64(0)
    for e in range(entries):
        together += listed(w, s.sizes[e], s.counts[e])
    for e in range(entries):
        chunks += chunks_for(w, s.sizes[e], s.counts[e], together)
    return chunks <= w.meta[FREE]


@piece
def _take(s, w, place):
    remove(w, place >> SLOT_BITS, place_of_particle(w, place))


@piece
def _put(s, w, size, count, i, j, p):
    insert(w, size, count)


@piece
def row(s, w):
    """See `smolux.core.burst.Burst`."""
    return w.meta[BLOCK] - s.count[SINCE] if s.clock[MAJORANT] > 0.0 else np.int64(0)


@piece
def hold(s, w, factor):
    """See `smolux.core.burst.Burst`."""
    # the unit of waiting times; a division at each event would take as long as drawing one
    return (s.clock[VOLUME] / s.clock[MAJORANT] / factor,)


@piece
def _replace(w, held, a, b, gone, size, count):
    if chunks_for(w, size, count, count) > w.meta[FREE]:
        return NOT_PLAIN, held
    k = at(w.meta[NEXT] - 1)  # the candidate that was accepted
    _remove(w, gone, a, w.place_one[k], b, w.place_two[k])
    insert(w, size, count)
    return (PLAIN if w.meta[STALE] == 0 else LAST), held


@piece
def release(s, held):
    """See `smolux.core.burst.Burst`."""


def bind(rate: Any, tally: Any) -> Pieces:
    """Bind the pieces to a rate and a way to count."""
    find = make_find(rate)
    store = Store(view, size, pick, room, _take, _put, double, make_visit(tally))
    return pieces_of(store, make_draw(find), prepare, Burst(row, hold, find, _replace, release))
