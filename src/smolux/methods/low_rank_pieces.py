"""The low-rank method, compiled: how a pair is drawn and the trees are kept."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..core import rng
from ..core.compile import cold_piece, piece
from ..core.loop import PATIENCE, ROUNDING, note_bad, repair
from ..core.prefetch import prefetch
from ..core.segment_tree import add, build, find, find_mixed
from ..core.slots import octave
from ..core.state import BOUND, FIRST, FLOOR, LARGEST, PARTICLES, SINCE, TRIALS, VALUE, VOLUME
from .low_rank_store import (
    POOL_NEEDED,
    SLOTS_NEEDED,
    STAGE,
    WANTED,
    WIDEST,
    counted,
    has_room,
    insert,
    make_room,
    remove,
    rescan,
    size_at,
    slot_for,
)

#: a particle is a number of this many bits within its slot, and the slot above them
_PLACE_BITS = 44

#: sums are kept below this number of quanta, so that a uniform number can tell them all apart
_MOST = 1 << 52
#: what the quanta are chosen for
_AIM = 2.0**44


@piece
def _root(w, row):
    return w.tree[row, w.tree.shape[1] - 1]


@piece
def _term_total(w, stage, k):
    """Sum of one term of the majorant over all ordered pairs."""
    left, right = w.term[stage, k, 0], w.term[stage, k, 1]
    return w.weight[k] * (float(_root(w, left)) * float(_root(w, right)))


@piece
def _majorant(w, stage, a, b):
    """``A(a, b) + A(b, a)`` of two slots."""
    total = 0.0
    for k in range(w.rank[stage, 1]):
        left, right = w.term[stage, k, 0], w.term[stage, k, 1]
        total += w.weight[k] * (
            w.grains[a, left] * w.grains[b, right] + w.grains[b, left] * w.grains[a, right]
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
def _choose(w, row, x):
    """Slot and place of a particle, by one factor; `x` is uniform in [0, 1)."""
    root = _root(w, row)
    slot, rest = find(w.tree, w.levels, row, min(np.int64(x * root), root - 1))
    return slot, _place(w, slot, float(rest), w.grains[slot, row])


@cold_piece
def _choose_mixed(w, stage, x):
    """Do the same by the sum of the factors times the coefficients in ``w.mix``."""
    slot, rest = find_mixed(w.tree, w.levels, w.rank[stage, 0], w.mix, x)
    weight = 0.0
    for row in range(w.rank[stage, 0]):
        weight += w.mix[row] * w.grains[slot, row]
    return slot, _place(w, slot, rest, weight)


@cold_piece
def _pair_mixed(s, w, stage, total):
    """Choose a pair by all terms together, which may be of mixed sign: Osinsky, eq. (26)."""
    w.mix[:] = 0.0
    for k in range(w.rank[stage, 1]):
        left, right = w.term[stage, k, 0], w.term[stage, k, 1]
        w.mix[left] += w.weight[k] * _root(w, right)
    a, place = _choose_mixed(w, stage, rng.uniform(s.rng) * total)
    w.chosen[0], w.chosen[1] = a, place
    w.mix[:] = 0.0
    others = 0.0
    for k in range(w.rank[stage, 1]):
        left, right = w.term[stage, k, 0], w.term[stage, k, 1]
        w.mix[right] += w.weight[k] * w.grains[a, left]
        others += w.weight[k] * w.grains[a, left] * _root(w, right)
    w.chosen[2], w.chosen[3] = _choose_mixed(w, stage, rng.uniform(s.rng) * others)


@piece
def _pair_by_term(s, w, stage, total):
    """Choose a term by its weight, then both particles by its two factors."""
    x = rng.uniform(s.rng)
    if w.rank[stage, 1] == 1:
        w.chosen[0], w.chosen[1] = _choose(w, w.term[stage, 0, 0], x)
        w.chosen[2], w.chosen[3] = _choose(w, w.term[stage, 0, 1], rng.uniform(s.rng))
        return
    x *= total
    k, weight = 0, 1.0
    for m in range(w.rank[stage, 1]):
        own = _term_total(w, stage, m)
        if own > 0.0:
            k, weight = m, own
            if x < own:
                break
            x -= own
    # what is left of x is uniform below the weight of the term, and serves again
    w.chosen[0], w.chosen[1] = _choose(w, w.term[stage, k, 0], x / weight)
    w.chosen[2], w.chosen[3] = _choose(w, w.term[stage, k, 1], rng.uniform(s.rng))


@cold_piece
def pick(s, w, low, high, n):
    """Place and size of a particle of the sizes `low` to `high`, of which there are `n`.

    A place is the number of the particle in its slot, with the slot above these bits.
    """
    first, last = slot_for(w, low), min(slot_for(w, high), w.number.shape[0] - 1)
    total = np.int64(0)
    for slot in range(first, last + 1):
        total += np.int64(w.number[slot])
    while True:
        left, slot = rng.below(s.rng, total), first
        while left >= w.number[slot]:
            left -= np.int64(w.number[slot])
            slot += 1
        size = size_at(w, slot, left)
        if low <= size <= high:  # slots may be wider than what is asked for
            return (slot << _PLACE_BITS) | left, size
        s.count[TRIALS] += 1


@piece
def seize(s, w, place):
    """Put a particle in the place of the first of the pair."""
    s.count[FIRST] = place >> _PLACE_BITS
    w.chosen[0], w.chosen[1] = place >> _PLACE_BITS, place & ((1 << _PLACE_BITS) - 1)


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
        if x * raised < w.share[a] * w.share[b]:
            return 1
        i, j = pair(s, w)
        value = rate(float(i), float(j), *p)
        majorant = raised * _majorant(w, stage, a, b)
        if not 0.0 <= value <= majorant * ROUNDING:
            if not 0.0 <= value < math.inf:
                note_bad(s, i, j, value)
                return -1
            repair(s, i, j, value / majorant * raised, raised)
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
        for _ in range(PATIENCE):
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
def _account(w, stage, a, b, c, count):
    """Account in all trees for one particle less in two slots and `count` more in another."""
    for row in range(w.rank[stage, 0]):
        new = count * w.grains[c, row]
        if new + _root(w, row) > _MOST:
            w.meta[STAGE] = -1
            return
        less_a, less_b = -np.int64(w.grains[a, row]), -np.int64(w.grains[b, row])
        add(w.tree, w.levels, row, (a, b, c), (less_a, less_b, np.int64(new)))
        if _root(w, row) < w.least[row]:
            w.meta[STAGE] = -1


@piece
def _take_out(s, w, gone):
    """Take one of the pair out, or both; return their slots, 0 for one that stays."""
    a, b = w.chosen[0], w.chosen[2]
    if gone == 3:
        if a == b and w.chosen[1] < w.chosen[3]:  # the later place first: the other one stays
            remove(s, w, b, w.chosen[3])
            remove(s, w, a, w.chosen[1])
        else:
            remove(s, w, a, w.chosen[1])
            remove(s, w, b, w.chosen[3])
        s.count[PARTICLES] -= 2
        return a, b
    if gone == 0:
        return np.int64(0), np.int64(0)
    slot, place = (a, w.chosen[1]) if gone == 1 else (b, w.chosen[3])
    remove(s, w, slot, place)
    s.count[PARTICLES] -= 1
    return slot, np.int64(0)


@piece
def update(s, w, gone, entries, p):
    """Take out what vanishes and put in what appears; False if there is no room."""
    if entries == 0:  # what is gone is accounted for beside what appears
        s.sizes[0], s.counts[0] = 1, 0
        entries = 1
    slots, together = w.number.shape[0], np.int64(0)
    for e in range(entries):
        if slot_for(w, s.sizes[e]) >= counted(w):
            together += s.counts[e]  # they may all be of one slot
    for e in range(entries):
        c = slot_for(w, s.sizes[e])
        if c >= slots:
            w.meta[SLOTS_NEEDED] = c + 1
            return False
        if s.sizes[e] > w.meta[WIDEST]:
            return False
        if not has_room(w, c, together) and not make_room(s, w, c, together):
            return False
    for e in range(entries - 1):  # making room for one may have taken it from another
        if not has_room(w, slot_for(w, s.sizes[e]), together):
            w.meta[POOL_NEEDED] = 2 * w.pool.shape[0]
            return False
    a, b = _take_out(s, w, gone)
    stage = w.meta[STAGE]
    for e in range(entries):
        c = slot_for(w, s.sizes[e])
        insert(s, w, c, s.sizes[e], s.counts[e])
        if e > 0:
            a = b = np.int64(0)  # no particle is in slot 0, and none weighs anything there
        if w.meta[STAGE] >= 0:
            _account(w, stage, a, b, c, s.counts[e])
    return True


@cold_piece
def _build(w, stage, afresh):
    """Choose quanta for which the sums are large whole numbers, and build the trees of them.

    Unless `afresh`, the quanta are those of before, and so is everything that follows from them.
    """
    w.meta[STAGE] = stage
    factors, slots = w.rank[stage, 0], w.number.shape[0]
    for slot in range(slots):
        w.share[slot] = w.shares[stage, slot]
    for k in range(w.rank[stage, 1]):
        w.weight[k] = w.weights[stage, k]
    for row in range(factors):
        total = 0.0
        for slot in range(1, slots):
            if w.number[slot] > 0.0:
                total += w.number[slot] * w.factor[stage, slot, row]
        if afresh:
            w.scale[row] = 1.0
            if total > 0.0:
                w.scale[row] = math.ldexp(1.0, math.floor(math.log2(_AIM / total)))
        scale = w.scale[row]
        above = 1.0 if row < factors - w.rank[stage, 2] else 0.0
        for slot in range(1, slots):
            exact = w.factor[stage, slot, row] * scale
            grains = np.floor(exact) + above
            w.grains[slot, row] = grains
            w.share[slot] = min(w.share[slot], w.shares[stage, slot] * (exact / grains))
            if w.number[slot] > 0.0:
                w.tree[row, slot] = np.int64(w.number[slot] * grains)
            else:
                w.tree[row, slot] = 0
        build(w.tree, w.levels, row)
        if afresh:
            w.least[row] = _root(w, row) >> 8
        elif not w.least[row] <= _root(w, row) <= _MOST:
            w.meta[STAGE] = -1
        for k in range(w.rank[stage, 1]):
            for side in range(2):
                if w.term[stage, k, side] == row:
                    w.weight[k] /= scale


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
        if w.meta[STAGE] == -stage - 2:  # the arrays have grown
            _build(w, stage, False)
        if w.meta[STAGE] != stage:
            _build(w, stage, True)
    return 0
