"""How the size-class method draws the next pair, compiled."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..core import rng
from ..core.alias import outcome
from ..core.compile import cold_piece, piece
from ..core.loop import Pieces, note_bad, repair
from ..core.prefetch import prefetch
from ..core.state import FIRST, MAJORANT, PARTICLES, SECOND, TRIALS, VOLUME
from .size_class_store import (
    AHEAD,
    NEXT,
    PAIRS,
    STALE,
    double,
    fits,
    insert,
    make_visit,
    place,
    remove,
    size_at,
    view,
)
from .size_class_table import prepare

#: candidates looked at before the loop may return without an event
_PATIENCE = 4096
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
def _draw_ahead(s, w):
    """Draw candidates: they depend on the table alone, not on the events in between."""
    pairs = w.meta[PAIRS]
    for k in range(AHEAD):
        classes = w.classes[outcome(w.share, w.alias, pairs, rng.uniform(s.rng))]
        g, h = np.int64(classes >> 16), np.int64(classes & 0xFFFF)
        a, b = rng.below(s.rng, w.room[g]), rng.below(s.rng, w.room[h])
        w.one[k], w.two[k] = (g << _SLOT_BITS) | a, (h << _SLOT_BITS) | b
        if w.listed[g]:
            prefetch(w.pool, place(w, g, a))
        if w.listed[h]:
            prefetch(w.pool, place(w, h, b))
    w.meta[NEXT] = 0


def _make_draw(rate: Any) -> Any:
    @piece
    def accepts(s, w, g, h, a, b, p):
        """Whether the rate accepts a candidate: 1 or 0; -1 if there is no rate."""
        u = rng.uniform(s.rng)
        if u < w.low[g, h]:
            return 1
        i, j = size_at(w, g, a), size_at(w, h, b)
        value = rate(float(i), float(j), *p)
        if not 0.0 <= value <= w.high[g, h]:
            if not 0.0 <= value < math.inf:
                note_bad(s, i, j, value)
                return -1
            repair(s, i, j, value)
            w.high[g, h] = w.high[h, g] = 1.1 * value
            w.low[g, h] = w.low[h, g] = 0.0
            w.meta[STALE] = 1
            return 1
        return 1 if u * w.high[g, h] < value else 0

    @piece
    def draw(s, w, p, factor):
        s.count[FIRST] = -1
        if s.count[PARTICLES] < 2 or s.clock[MAJORANT] <= 0.0:
            return math.inf
        wait = 0.0
        for _ in range(_PATIENCE):
            if w.meta[NEXT] == AHEAD:
                _draw_ahead(s, w)
            k = w.meta[NEXT]
            w.meta[NEXT] = k + 1
            s.count[TRIALS] += 1
            wait += rng.exponential(s.rng)
            one, two = w.one[k], w.two[k]
            g, a, h, b = one >> _SLOT_BITS, one & _SLOT, two >> _SLOT_BITS, two & _SLOT
            if a >= w.number[g] or b >= w.number[h] or one == two:
                continue
            taken = accepts(s, w, g, h, a, b, p)
            if taken < 0:
                return math.nan
            if taken == 1:
                s.count[FIRST], s.count[SECOND] = one, two
                break
        return wait * s.clock[VOLUME] / (s.clock[MAJORANT] * factor)

    return draw


@piece
def _update(s, w, gone, entries, p):
    if not fits(s, w, entries):
        return False
    a, b = s.count[FIRST], s.count[SECOND]
    if gone == 3:
        # the later place of a class goes first: then the other stays where it is
        remove(s, w, max(a, b) >> _SLOT_BITS, max(a, b) & _SLOT)
        remove(s, w, min(a, b) >> _SLOT_BITS, min(a, b) & _SLOT)
        s.count[PARTICLES] -= 2
    elif gone > 0:
        one = a if gone == 1 else b
        remove(s, w, one >> _SLOT_BITS, one & _SLOT)
        s.count[PARTICLES] -= 1
    for e in range(entries):
        insert(s, w, s.sizes[e], s.counts[e])
    return True


def bind(rate: Any, tally: Any) -> Pieces:
    """Bind the pieces to a rate and a way to count."""
    visit = make_visit(tally)
    return Pieces(view, _make_draw(rate), _pair, _update, prepare, double, _lone, _seize, visit)
