"""The low-rank method, compiled: how a pair is drawn and the trees are kept."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from smolux.core import rng
from smolux.core.bounds import ROUNDING, note_bad, repair
from smolux.core.loop import PATIENCE, Pieces
from smolux.core.pick import largest_rate, slots_with, takes
from smolux.core.state import FIRST, FLOOR, PARTICLES, SECOND, TRIALS, VALUE, VOLUME
from smolux.core.store import Store, pieces_of
from smolux.jit.compile import cold_piece, piece
from smolux.jit.prefetch import prefetch

from .segment_tree import add, find, find_mixed
from .store import (
    APART,
    POOL_NEEDED,
    SEEK,
    SLOTS_NEEDED,
    STAGE,
    WIDEST,
    counted,
    double,
    has_room,
    insert,
    make_room,
    make_visit,
    place_of,
    size_at,
    slot_at,
    slot_for,
    take,
    view,
)
from .trees import MOST, prepare, root_of


@piece
def _term_total(w, stage, k):
    """Sum of one term of the majorant over all ordered pairs."""
    left, right = w.term[stage, k, 0], w.term[stage, k, 1]
    return w.weight[k] * (float(root_of(w, left)) * float(root_of(w, right)))


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
    k = min(np.int64(x / weight), np.int64(w.number[slot]) - 1)
    if slot >= counted(w):
        prefetch(w.pool, w.start[slot] + k)
    return place_of(slot, k)


@piece
def _choose(w, row, x):
    """Place of a particle, by one factor; `x` is uniform in [0, 1)."""
    root = root_of(w, row)
    slot, rest = find(w.tree, w.levels, row, min(np.int64(x * root), root - 1))
    return _place(w, slot, float(rest), w.grains[slot, row])


@cold_piece
def _choose_mixed(w, stage, x):
    """Do the same by the sum of the factors times the coefficients in ``w.mix``."""
    slot, rest = find_mixed(w.tree, w.levels, w.rank[stage, 0], w.mix, x)
    weight = 0.0
    for row in range(w.rank[stage, 0]):
        weight += w.mix[row] * w.grains[slot, row]
    return _place(w, slot, rest, weight)


@cold_piece
def _pair_mixed(s, w, stage, total):
    """Choose a pair by all terms together, which may be of mixed sign: Osinsky, eq. (26)."""
    w.mix[:] = 0.0
    for k in range(w.rank[stage, 1]):
        left, right = w.term[stage, k, 0], w.term[stage, k, 1]
        w.mix[left] += w.weight[k] * root_of(w, right)
    one = _choose_mixed(w, stage, rng.uniform(s.rng) * total)
    a = slot_at(one)
    w.mix[:] = 0.0
    others = 0.0
    for k in range(w.rank[stage, 1]):
        left, right = w.term[stage, k, 0], w.term[stage, k, 1]
        w.mix[right] += w.weight[k] * w.grains[a, left]
        others += w.weight[k] * w.grains[a, left] * root_of(w, right)
    return one, _choose_mixed(w, stage, rng.uniform(s.rng) * others)


@piece
def _pair_by_term(s, w, stage, total):
    """Choose a term by its weight, then both particles by its two factors."""
    x = rng.uniform(s.rng)
    if w.rank[stage, 1] == 1:
        one = _choose(w, w.term[stage, 0, 0], x)
        return one, _choose(w, w.term[stage, 0, 1], rng.uniform(s.rng))
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
    one = _choose(w, w.term[stage, k, 0], x / weight)
    return one, _choose(w, w.term[stage, k, 1], rng.uniform(s.rng))


@piece
def _choose_pair(s, w, stage, total):
    """Choose a pair by the majorant, which is `total` over all of them."""
    if w.rank[stage, 2] == 0:
        return _pair_by_term(s, w, stage, total)
    return _pair_mixed(s, w, stage, total)


@cold_piece
def _with_apart(w, stage):
    """Sum of the majorant over the particle held apart and any other; coefficients in ``w.mix``."""
    w.mix[:] = 0.0
    for k in range(w.rank[stage, 1]):
        left, right = w.term[stage, k, 0], w.term[stage, k, 1]
        w.mix[left] += w.weight[k] * w.grains[w.meta[APART], right]
        w.mix[right] += w.weight[k] * w.grains[w.meta[APART], left]
    total = 0.0
    for row in range(w.rank[stage, 0]):
        total += w.mix[row] * root_of(w, row)
    return total


@cold_piece
def _pair_with_apart(w, stage, x):
    """Choose the particle held apart, and another at `x` in the sum of `_with_apart`."""
    _with_apart(w, stage)
    return place_of(w.meta[APART], np.int64(0)), _choose_mixed(w, stage, x)


@piece
def pick(s, w, r, c):
    """Place and size of a particle, see `smolux.core.loop.Pieces`."""
    first, last, low, high = slots_with(c, w.bits[0])
    total, largest = np.int64(0), largest_rate(s, r, low, high)
    for slot in range(first, min(last + 1, w.number.shape[0])):
        total += np.int64(w.number[slot])
    while True:
        left, slot = rng.below(s.rng, total), first
        while left >= w.number[slot]:
            left -= np.int64(w.number[slot])
            slot += 1
        place = place_of(slot, left)
        size = size_at(s, w, place)
        if low == high or takes(s, r, size, largest):
            return place, size
        s.count[TRIALS] += 1


def _make_draw(rate: Any) -> Any:
    """Bind the drawing of the next pair."""

    @piece
    def accepted(s, w, p, stage, raised, one, two):
        """Whether a pair collides: 1 or 0; -1 if its rate is none."""
        x = rng.uniform(s.rng)
        a, b = slot_at(one), slot_at(two)
        if x * raised < w.share[a] * w.share[b]:
            return 1
        i, j = size_at(s, w, one), size_at(s, w, two)
        value = rate(float(i), float(j), *p)
        majorant, units = raised * _majorant(w, stage, a, b), w.units[stage]
        if not 0.0 <= value * units <= majorant * ROUNDING:
            if not 0.0 <= value < math.inf:
                note_bad(s, i, j, value)
                return -1
            repair(s, i, j, value * units / majorant * raised, raised)
        return 1 if x * majorant < value * units else 0

    @piece
    def collides(s, w, p, stage, raised, one, two):
        """Note a pair if it collides, and whether: 1 or 0; -1 if its rate is none."""
        if one == two:
            return 0  # a particle does not meet itself
        verdict = accepted(s, w, p, stage, raised, one, two)
        if verdict > 0:
            s.count[FIRST], s.count[SECOND] = one, two
        return verdict

    @cold_piece
    def draw_with_apart(s, w, p, factor, limit, others):
        """Do the same with a particle that is held apart; `others` is the sum without it."""
        stage, apart = w.meta[STAGE], _with_apart(w, w.meta[STAGE])
        total = others + apart
        if not total > 0.0:
            return math.inf if s.clock[VALUE] == 0.0 else math.nan
        raised = max(1.0, s.clock[FLOOR])
        wait, unit = 0.0, s.clock[VOLUME] / (total * raised * factor) * w.units[stage]
        for _ in range(PATIENCE):
            wait += rng.exponential(s.rng)
            if limit < math.inf and wait * unit >= limit:
                return limit
            s.count[TRIALS] += 1
            x = rng.uniform(s.rng) * total
            if x < apart:
                one, two = _pair_with_apart(w, stage, x)
            else:
                one, two = _choose_pair(s, w, stage, others)
            verdict = collides(s, w, p, stage, raised, one, two)
            if verdict < 0:
                return math.nan
            if verdict > 0:
                break
        if s.count[FIRST] < 0:
            w.meta[STAGE] = -1
        return wait * s.clock[VOLUME] / (total * raised * factor) * w.units[stage]

    @piece
    def draw(s, w, p, factor, limit):
        s.count[FIRST] = -1
        stage = w.meta[STAGE]
        total = 0.0
        for k in range(w.rank[stage, 1]):
            total += _term_total(w, stage, k)
        if s.count[PARTICLES] < 2:
            return math.inf
        if w.meta[APART] > 0:
            return draw_with_apart(s, w, p, factor, limit, total)
        if not total > 0.0:
            return math.inf if s.clock[VALUE] == 0.0 else math.nan
        # a majorant that was found broken is raised as a whole
        raised = max(1.0, s.clock[FLOOR])
        wait, unit = 0.0, s.clock[VOLUME] / (total * raised * factor) * w.units[stage]
        for _ in range(PATIENCE):
            wait += rng.exponential(s.rng)
            if limit < math.inf and wait * unit >= limit:
                return limit
            s.count[TRIALS] += 1
            one, two = _choose_pair(s, w, stage, total)
            verdict = collides(s, w, p, stage, raised, one, two)
            if verdict < 0:
                return math.nan
            if verdict > 0:
                break
        if s.count[FIRST] < 0:  # all in vain: perhaps one particle meets only itself
            w.meta[SEEK], w.meta[STAGE] = 1, -1
        return wait * s.clock[VOLUME] / (total * raised * factor) * w.units[stage]

    return draw


@piece
def _account(w, stage, a, b, c, count):
    """Account in all trees for one particle less in two slots and `count` more in another."""
    apart = w.meta[APART]
    if apart > 0 and (a == apart or b == apart or c == apart):
        w.meta[STAGE] = -1
        return
    for row in range(w.rank[stage, 0]):
        new = count * w.grains[c, row]
        if new + root_of(w, row) > MOST:
            w.meta[STAGE] = -1
            return
        less_a, less_b = -np.int64(w.grains[a, row]), -np.int64(w.grains[b, row])
        add(w.tree, w.levels, row, (a, b, c), (less_a, less_b, np.int64(new)))
        if root_of(w, row) < w.least[row]:
            w.meta[STAGE] = -1


@piece
def room(s, w, gone, entries, p):
    """Whether there is room for what appears; if not, note how much there should be."""
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
    return True


@piece
def put(s, w, size, count, i, j, p):
    """Put particles in, and account in all trees for them and for those that are gone."""
    c = slot_for(w, size)
    insert(s, w, c, size, count)
    if w.meta[STAGE] >= 0:
        # no particle is in slot 0, and none weighs anything there
        a = slot_for(w, i) if i > 0 else np.int64(0)
        b = slot_for(w, j) if j > 0 else np.int64(0)
        _account(w, w.meta[STAGE], a, b, c, count)


def bind(rate: Any, tally: Any) -> Pieces:
    """Bind the pieces to a rate and a way to count."""
    store = Store(view, size_at, pick, room, take, put, double, make_visit(tally))
    return pieces_of(store, _make_draw(rate), prepare)
