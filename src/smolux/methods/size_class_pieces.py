"""How the size-class method draws the next pair, compiled."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..core import rng
from ..core.alias import outcome
from ..core.burst import LAST, NOT_PLAIN, PLAIN, Burst, make_draw_one
from ..core.compile import at, cold_piece, piece
from ..core.loop import PATIENCE, Pieces, note_bad, repair
from ..core.prefetch import prefetch
from ..core.state import FIRST, MAJORANT, PARTICLES, SECOND, SINCE, VOLUME
from .size_class_store import (
    AHEAD,
    BLOCK,
    FREE,
    NEXT,
    PAIRS,
    STALE,
    chunks_for,
    double,
    insert,
    make_visit,
    place,
    remove,
    size_at,
    view,
)
from .size_class_table import prepare

#: a chosen particle is a number of this many bits within its class, and the class above them
_SLOT_BITS = 44
_SLOT = (1 << _SLOT_BITS) - 1


@piece
def _pair(s, w):
    a, b = s.count[FIRST], s.count[SECOND]
    return (
        size_at(w, a >> _SLOT_BITS, a & _SLOT),
        size_at(w, b >> _SLOT_BITS, b & _SLOT),
    )


@cold_piece
def _lone(s, w, k):
    g = np.int64(1)
    while k >= w.number[g]:
        k -= w.number[g]
        g += 1
    return (g << _SLOT_BITS) | k, size_at(w, g, k)


@piece
def _seize(s, w, place):
    s.count[FIRST] = place


@piece
def _ask_for(w, one):
    """Have the memory of a particle fetched; without a branch, also for those only counted."""
    g = one >> _SLOT_BITS
    prefetch(w.pool, place(w, g, one & _SLOT & w.mask[at(g)]))


@cold_piece
def _draw_ahead(w, s, a, b, c, d):
    """Draw candidates: they depend on the table alone, not on the events in between.

    One kind of number after the other: short loops overlap their reads of memory.
    """
    pairs = w.meta[PAIRS]
    for k in range(AHEAD):
        x, a, b, c, d = rng.uniform_of(a, b, c, d)
        w.one[at(k)] = outcome(w.share, w.either, pairs, x)
    for k in range(AHEAD):
        g, h = w.one[at(k)] >> 16, w.one[at(k)] & 0xFFFF
        x, a, b, c, d = rng.uniform_of(a, b, c, d)
        y, a, b, c, d = rng.uniform_of(a, b, c, d)
        x, y = x * w.room[at(g)], y * w.room[at(h)]
        w.one[at(k)] = (g << _SLOT_BITS) | np.int64(x)
        w.two[at(k)] = (h << _SLOT_BITS) | np.int64(y)
    for k in range(AHEAD):
        _ask_for(w, w.one[at(k)])
        _ask_for(w, w.two[at(k)])
        g, h = w.one[at(k)] >> _SLOT_BITS, w.two[at(k)] >> _SLOT_BITS
        x, a, b, c, d = rng.uniform_of(a, b, c, d)
        w.mark[at(k)] = -1.0 if x < w.low[at(g), at(h)] else x
        w.wait[at(k)], a, b, c, d = rng.exponential_of(s, a, b, c, d)
    w.meta[NEXT] = 0
    return a, b, c, d


@cold_piece
def _raise_bound(s, w, g, h, i, j, value):
    """Take in a rate above its bound."""
    repair(s, i, j, value)
    w.high[g, h] = w.high[h, g] = 1.1 * value
    w.low[g, h] = w.low[h, g] = 0.0
    w.meta[STALE] = 1


def _make_find(rate: Any) -> Any:
    @piece
    def accepts(s, w, g, h, i, j, u, p):
        """Whether the rate accepts a candidate: 1 or 0; -1 if there is no rate."""
        if u < 0.0:
            return 1
        value = rate(float(i), float(j), *p)
        if not 0.0 <= value <= w.high[at(g), at(h)]:
            if not 0.0 <= value < math.inf:
                note_bad(s, i, j, value)
                return -1
            _raise_bound(s, w, g, h, i, j, value)
            return 1
        return 1 if u * w.high[at(g), at(h)] < value else 0

    @piece
    def find(s, w, p, factor, held, n, trials, c0, c1, c2, c3):
        """See `smolux.core.burst.Burst`; NaN for a rate that is none, which has been noted."""
        unit = s.clock[VOLUME] / (s.clock[MAJORANT] * factor)
        waited, last = 0.0, trials + PATIENCE
        while trials < last:
            if w.meta[NEXT] == AHEAD:
                c0, c1, c2, c3 = _draw_ahead(w, s.rng, c0, c1, c2, c3)
            k = w.meta[NEXT]
            w.meta[NEXT] = k + 1
            trials += 1
            waited += w.wait[at(k)]
            one, two = w.one[at(k)], w.two[at(k)]
            g, a, h, b = one >> _SLOT_BITS, one & _SLOT, two >> _SLOT_BITS, two & _SLOT
            if a >= w.number[at(g)] or b >= w.number[at(h)] or one == two:
                continue
            i, j = size_at(w, g, a), size_at(w, h, b)
            taken = accepts(s, w, g, h, i, j, w.mark[at(k)], p)
            if taken < 0:
                return math.nan, one, two, i, j, trials, c0, c1, c2, c3
            if taken == 1:
                return waited * unit, one, two, i, j, trials, c0, c1, c2, c3
        return waited * unit, -1, -1, 0, 0, trials, c0, c1, c2, c3

    return find


def _make_draw(find: Any) -> Any:
    draw_one = make_draw_one(find)

    @piece
    def draw(s, w, p, factor):
        s.count[FIRST] = -1
        if s.count[PARTICLES] < 2 or s.clock[MAJORANT] <= 0.0:
            return math.inf
        return draw_one(s, w, p, factor, _hold(s, w))

    return draw


@piece
def _remove(w, a, b, gone):
    """Take one of a pair out, or both."""
    if gone != 3:
        one = a if gone == 1 else b
        remove(w, one >> _SLOT_BITS, one & _SLOT)
        return
    # the later place of a class goes first: then the other stays where it is
    remove(w, max(a, b) >> _SLOT_BITS, max(a, b) & _SLOT)
    remove(w, min(a, b) >> _SLOT_BITS, min(a, b) & _SLOT)


@piece
def _update(s, w, gone, entries, p):
    chunks = np.int64(0)
    for e in range(entries):
        chunks += chunks_for(w, s.sizes[e], s.counts[e])
    if chunks > w.meta[FREE]:
        return False
    if gone > 0:
        _remove(w, s.count[FIRST], s.count[SECOND], gone)
        s.count[PARTICLES] -= 2 if gone == 3 else 1
    for e in range(entries):
        insert(w, s.sizes[e], s.counts[e])
        s.count[PARTICLES] += s.counts[e]
    return True


@piece
def _row(s, w):
    return w.meta[BLOCK] - s.count[SINCE] if s.clock[MAJORANT] > 0.0 else np.int64(0)


@piece
def _hold(s, w):
    return ()


@piece
def _replace(w, held, a, b, gone, size, count):
    if chunks_for(w, size, count) > w.meta[FREE]:
        return NOT_PLAIN, held
    _remove(w, a, b, gone)
    insert(w, size, count)
    return (PLAIN if w.meta[STALE] == 0 else LAST), held


@piece
def _release(s, held):
    pass


def bind(rate: Any, tally: Any) -> Pieces:
    """Bind the pieces to a rate and a way to count."""
    find = _make_find(rate)
    return Pieces(
        view,
        _make_draw(find),
        _pair,
        _update,
        prepare,
        double,
        _lone,
        _seize,
        make_visit(tally),
        Burst(_row, _hold, find, _replace, _release),
    )
