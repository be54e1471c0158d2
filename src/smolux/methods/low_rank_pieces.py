"""The low-rank method, compiled: how a pair is drawn and the trees are kept."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..core import rng
from ..core.compile import cold_piece, piece
from ..core.loop import note_bad, repair
from ..core.prefetch import prefetch
from ..core.segment_tree import build, find, find_mixed, refresh
from ..core.slots import octave
from ..core.state import BOUND, FIRST, FLOOR, LARGEST, PARTICLES, SINCE, TRIALS, VALUE, VOLUME
from .low_rank_store import (
    POOL_NEEDED,
    SLOTS_NEEDED,
    STAGE,
    WANTED,
    counted,
    has_room,
    insert,
    make_room,
    remove,
    rescan,
    size_at,
    slot_for,
)

#: candidates looked at before the loop may return without an event
_PATIENCE = 4096
#: a rate above its majorant by no more than rounding breaks no bound
_ROUNDING = 1.0 + 1e-12


@piece
def _root(w, row):
    return w.tree[row, w.levels[w.levels.shape[0] - 1]]


@piece
def _term_total(w, stage, k):
    """Sum of one term of the majorant over all ordered pairs."""
    return w.weight[stage, k] * _root(w, w.term[stage, k, 0]) * _root(w, w.term[stage, k, 1])


@piece
def _majorant(w, stage, a, b):
    """``A(a, b) + A(b, a)`` of two slots."""
    total = 0.0
    for k in range(w.rank[stage, 1]):
        left, right = w.term[stage, k, 0], w.term[stage, k, 1]
        total += w.weight[stage, k] * (
            w.factor[stage, a, left] * w.factor[stage, b, right]
            + w.factor[stage, b, left] * w.factor[stage, a, right]
        )
    return total


@piece
def _place(w, slot, x, weight):
    """Particle of a slot at which the cumulative weight passes `x`, every one having `weight`."""
    place = min(np.int64(x / weight), np.int64(w.number[slot]) - 1)
    if slot >= counted(w):
        prefetch(w.pool, w.start[slot] + place)
    return place


@piece
def _choose(w, stage, row, x):
    """Slot and place of a particle, by one factor."""
    slot, rest = find(w.tree, w.levels, row, x)
    return slot, _place(w, slot, rest, w.factor[stage, slot, row])


@cold_piece
def _choose_mixed(w, stage, x):
    """Do the same by the sum of the factors times the coefficients in ``w.mix``."""
    slot, rest = find_mixed(w.tree, w.levels, w.rank[stage, 0], w.mix, x)
    weight = 0.0
    for row in range(w.rank[stage, 0]):
        weight += w.mix[row] * w.factor[stage, slot, row]
    return slot, _place(w, slot, rest, weight)


@cold_piece
def _pair_mixed(s, w, stage, total):
    """Choose a pair by all terms together, which may be of mixed sign: Osinsky, eq. (26)."""
    terms = w.rank[stage, 1]
    w.mix[:] = 0.0
    for k in range(terms):
        right = _root(w, w.term[stage, k, 1])
        w.mix[w.term[stage, k, 0]] += w.weight[stage, k] * right
    a, place = _choose_mixed(w, stage, rng.uniform(s.rng) * total)
    w.chosen[0], w.chosen[1] = a, place
    w.mix[:] = 0.0
    sum_b = 0.0
    for k in range(terms):
        right, share = w.term[stage, k, 1], w.factor[stage, a, w.term[stage, k, 0]]
        w.mix[right] += w.weight[stage, k] * share
        sum_b += w.weight[stage, k] * share * _root(w, right)
    w.chosen[2], w.chosen[3] = _choose_mixed(w, stage, rng.uniform(s.rng) * sum_b)


@piece
def _pair_by_term(s, w, stage, total):
    """Choose a term by its weight, then both particles by its two factors."""
    x = rng.uniform(s.rng) * total
    k, weight = 0, 0.0
    for m in range(w.rank[stage, 1]):
        own = _term_total(w, stage, m)
        if own > 0.0:
            k, weight = m, own
            if x < own:
                break
            x -= own
    left, right = w.term[stage, k, 0], w.term[stage, k, 1]
    # what is left of x is uniform below the weight of the term, and serves again
    x = min(x / weight, 1.0 - 1e-16) * _root(w, left)
    w.chosen[0], w.chosen[1] = _choose(w, stage, left, x)
    x = rng.uniform(s.rng) * _root(w, right)
    w.chosen[2], w.chosen[3] = _choose(w, stage, right, x)


@piece
def pair(s, w):
    """Sizes of the chosen pair."""
    return size_at(w, w.chosen[0], w.chosen[1]), size_at(w, w.chosen[2], w.chosen[3])


def make_draw(rate: Any) -> Any:
    """Bind the drawing of the next pair."""

    @piece
    def accepted(s, w, p, stage, raised):
        """Whether the chosen pair collides: 1 or 0; -1 if its rate is none."""
        x = rng.uniform(s.rng)
        a, b = w.chosen[0], w.chosen[2]
        if x * raised < w.share[stage, a] * w.share[stage, b]:
            return 1
        i, j = pair(s, w)
        value = rate(float(i), float(j), *p)
        majorant = raised * _majorant(w, stage, a, b)
        if not 0.0 <= value <= majorant * _ROUNDING:
            if not 0.0 <= value < math.inf:
                note_bad(s, i, j, value)
                return -1
            repair(s, i, j, value / majorant * raised)
        return 1 if x * majorant < value else 0

    @piece
    def draw(s, w, p, factor):
        s.count[FIRST] = -1
        stage = w.meta[STAGE]
        total = 0.0
        for k in range(w.rank[stage, 1]):
            total += _term_total(w, stage, k)
        if s.count[PARTICLES] < 2:
            return math.inf
        if not total > 0.0:
            return math.inf if s.clock[VALUE] == 0.0 else math.nan
        # a majorant that was found broken is raised as a whole
        raised = max(1.0, s.clock[FLOOR])
        wait = 0.0
        for _ in range(_PATIENCE):
            s.count[TRIALS] += 1
            wait += rng.exponential(s.rng)
            if w.rank[stage, 2] == 0:
                _pair_by_term(s, w, stage, total)
            else:
                _pair_mixed(s, w, stage, total)
            if w.chosen[0] == w.chosen[2] and w.chosen[1] == w.chosen[3]:
                continue  # a particle does not meet itself
            verdict = accepted(s, w, p, stage, raised)
            if verdict < 0:
                return math.nan
            if verdict > 0:
                s.count[FIRST] = w.chosen[0]
                break
        return wait * s.clock[VOLUME] / (total * raised * factor)

    return draw


@piece
def _weigh(w, stage, slot):
    for row in range(w.rank[stage, 0]):
        w.tree[row, slot] = w.number[slot] * w.factor[stage, slot, row]


@piece
def update(s, w, entries, p):
    """Take the pair out and put in what appears; False if there is no room."""
    slots = w.number.shape[0]
    for e in range(entries):
        c = slot_for(w, s.sizes[e])
        if c >= slots:
            w.meta[SLOTS_NEEDED] = c + 1
            return False
        if not has_room(w, c, s.counts[e]) and not make_room(s, w, c, s.counts[e]):
            return False
    for e in range(entries - 1):  # making room for one may have taken it from another
        if not has_room(w, slot_for(w, s.sizes[e]), s.counts[e]):
            w.meta[POOL_NEEDED] = 2 * w.pool.shape[0]
            return False
    a, b = w.chosen[0], w.chosen[2]
    if a == b and w.chosen[1] < w.chosen[3]:  # the later place first: the other one stays
        remove(s, w, b, w.chosen[3])
        remove(s, w, a, w.chosen[1])
    else:
        remove(s, w, a, w.chosen[1])
        remove(s, w, b, w.chosen[3])
    s.count[PARTICLES] -= 2
    stage = w.meta[STAGE]
    c = slot_for(w, s.sizes[0])
    insert(s, w, c, s.sizes[0], s.counts[0])
    _weigh(w, stage, a)
    _weigh(w, stage, b)
    _weigh(w, stage, c)
    refresh(w.tree, w.levels, w.rank[stage, 0], a, b, c)
    for e in range(1, entries):
        c = slot_for(w, s.sizes[e])
        insert(s, w, c, s.sizes[e], s.counts[e])
        _weigh(w, stage, c)
        refresh(w.tree, w.levels, w.rank[stage, 0], c, c, c)
    return True


@cold_piece
def _build(w, stage):
    w.meta[STAGE] = stage
    for slot in range(w.number.shape[0]):
        _weigh(w, stage, slot)
    build(w.tree, w.levels, w.rank[stage, 0])


@piece
def prepare(s, w, p):
    """Build the trees for the majorant of the octave that is reached, or ask for it."""
    stage = np.int64(0)
    if w.rank.shape[0] > 1:
        if s.count[SINCE] > s.count[PARTICLES] + 64:
            rescan(s, w)
        stage = octave(s.count[LARGEST])
    if stage != w.meta[STAGE]:
        if w.rank[stage, 0] == 0:
            w.meta[WANTED] = stage
            return BOUND
        _build(w, stage)
    return 0
