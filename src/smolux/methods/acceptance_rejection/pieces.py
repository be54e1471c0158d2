"""How acceptance-rejection stores particles and draws pairs, compiled."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from smolux.core import rng
from smolux.core.bounds import ROUNDING, note_bad, note_largest, repair
from smolux.core.burst import NOT_PLAIN, PLAIN, Burst, make_draw_one
from smolux.core.loop import PATIENCE, Pieces
from smolux.core.pick import largest_rate, takes
from smolux.core.slots import slot_of
from smolux.core.state import (
    FIRST,
    FLOOR,
    LARGEST,
    MAJORANT,
    MONOMERS,
    PARTICLES,
    SECOND,
    SINCE,
    SMALLEST,
    STORED,
    TRIALS,
    UNARY_BITS,
    VALUE,
    VOLUME,
)
from smolux.core.store import Store, pieces_of
from smolux.jit.compile import at, cold_piece, piece
from smolux.jit.prefetch import prefetch

from .levels import renew_majorant
from .store import APART, SLACK, VAIN, renew_all, rescan, seek_apart, size_of, view, watch

#: candidates whose pairs are drawn ahead, so that their memory is there when it is needed
AHEAD = 8
_ONE = at(1)


class Held(NamedTuple):
    """What changes within a burst, and what is in force: sizes from `bottom` to below `top`.

    The mean waiting time of two particles at the greatest rate is half of `unit`.
    """

    monomers: Any
    stored: Any
    smallest: Any
    largest: Any
    bottom: Any
    top: Any
    unit: Any


@piece
def _size(s, w, place):
    return size_of(w, s.count[MONOMERS], place)


@piece
def _pick(s, w, r, c):
    if c == 1:
        return rng.below(s.rng, s.count[MONOMERS]), np.int64(1)
    # all others are held together
    largest = largest_rate(s, r, np.int64(2), slot_of(s.count[LARGEST], UNARY_BITS))
    while True:
        k = rng.below(s.rng, s.count[STORED])
        size = np.int64(w.sizes[k])
        if takes(s, r, size, largest):
            return s.count[MONOMERS] + k, size
        s.count[TRIALS] += 1


@piece
def _ask(w, monomers, slot):
    """Ask for the memory of a later candidate.

    The number of particles will have changed by a few when its turn comes, which leaves the place
    within the same stretch of memory.
    """
    prefetch(w.sizes, max(slot - monomers, 0))


@piece
def _ask_with_row(w, monomers, slot):
    prefetch(w.sizes, slot)
    prefetch(w.rows, slot * w.mixed.shape[0])


def make_find(rate: Any, rows: bool = False) -> Any:
    """Bind the search for the next pair, see `smolux.core.burst.Burst`; with `rows` or without."""
    ask = _ask_with_row if rows else _ask

    @piece
    def value_of(w, i, j, p):
        n = w.table.shape[0]
        if i <= n and j <= n:
            return w.table[i - 1, j - 1]
        return rate(float(i), float(j), *p)

    @piece
    def find(s, w, p, factor, limit, held, n, trials, c0, c1, c2, c3):
        """See `smolux.core.burst.Burst`; NaN for a rate that is none, which has been noted."""
        majorant, monomers = s.clock[MAJORANT], held.monomers
        unit = held.unit / (float(n) * float(n - 1))
        waited, last = 0.0, trials + PATIENCE
        while trials < last:
            k = at(2 * (trials & (AHEAD - 1)))
            x, c0, c1, c2, c3 = rng.exponential_of(s.rng, c0, c1, c2, c3)
            waited += x
            if limit < math.inf and waited * unit >= limit:
                return limit, -1, -1, 0, 0, trials, c0, c1, c2, c3
            trials += 1
            a, b = np.int64(w.ahead[k] * n), np.int64(w.ahead[k + _ONE] * (n - 1))
            b += b >= a
            u, c0, c1, c2, c3 = rng.uniform_of(c0, c1, c2, c3)
            v, c0, c1, c2, c3 = rng.uniform_of(c0, c1, c2, c3)
            w.ahead[k], w.ahead[k + _ONE] = u, v
            ask(w, monomers, np.int64(u * n))
            ask(w, monomers, np.int64(v * n))
            i, j = size_of(w, monomers, a), size_of(w, monomers, b)
            value = value_of(w, i, j, p)
            if not 0.0 <= value <= majorant:
                if not 0.0 <= value < math.inf:
                    note_bad(s, i, j, value)
                    return math.nan, a, b, i, j, trials, c0, c1, c2, c3
                if value > majorant * ROUNDING:
                    repair(s, i, j, value, majorant)
            if value >= majorant:
                return waited * unit, a, b, i, j, trials, c0, c1, c2, c3
            u, c0, c1, c2, c3 = rng.uniform_of(c0, c1, c2, c3)
            if u * majorant < value:
                return waited * unit, a, b, i, j, trials, c0, c1, c2, c3
        w.apart[VAIN] = 1
        return waited * unit, -1, -1, 0, 0, trials, c0, c1, c2, c3

    return find


def make_draw(find: Any) -> Any:
    """Bind the drawing of a pair, see `smolux.core.loop.Pieces`."""
    draw_one = make_draw_one(find)

    @piece
    def draw(s, w, p, factor, limit):
        s.count[FIRST] = -1
        if s.count[PARTICLES] < 2:
            return math.inf
        if s.clock[MAJORANT] <= 0.0:
            return math.inf if s.clock[VALUE] == 0.0 else math.nan
        if w.ahead[0] < 0.0:
            for k in range(2 * AHEAD):
                w.ahead[k] = rng.uniform(s.rng)
        return draw_one(s, w, p, factor, limit, hold(s, w, factor))

    return draw


@piece
def _exchange(w, monomers, stored, a, b, size, count):
    """Take the particles of two slots out and put others in: one, or any number of monomers."""
    x, y = a - monomers, b - monomers
    first, second = np.int64(x >= 0), np.int64(y >= 0)
    monomers -= 2 - first - second
    if size > 1:
        w.sizes[at(x if x >= 0 else y if y >= 0 else stored)] = size
        stored += 1 - first - second
        # unless both were stored, the entry past the end is written over itself
        gap = y if x >= 0 and y >= 0 else stored
        w.sizes[at(gap)] = w.sizes[at(stored)]
        return monomers, stored
    high, low = max(x, y), min(x, y)
    if high >= 0:
        stored -= 1
        w.sizes[high] = w.sizes[stored]
    if low >= 0:
        stored -= 1
        w.sizes[low] = w.sizes[stored]
    return monomers + count, stored


@piece
def _without(w, monomers, stored, slot):
    """Take the particle of a slot out: the last of its kind moves into the gap."""
    place = slot - monomers
    if place < 0:
        return monomers - 1, stored
    w.sizes[at(place)] = w.sizes[at(stored - 1)]
    return monomers, stored - 1


@piece
def _exchange_one(w, monomers, stored, slot, size, count):
    """Take the particle of a slot out and put others in: one, or any number of monomers."""
    monomers, stored = _without(w, monomers, stored, slot)
    if size == 1:
        return monomers + count, stored
    w.sizes[at(stored)] = size
    return monomers, stored + 1


@piece
def row(s, w):
    """See `smolux.core.burst.Burst`."""
    if w.ahead[0] < 0.0 or s.clock[MAJORANT] <= 0.0:
        return 0
    # each event brings the next look at all sizes nearer by two at most, see `prepare`
    return (s.count[PARTICLES] + 64 - s.count[SINCE]) // 2


@piece
def hold(s, w, factor):
    """See `smolux.core.burst.Burst`."""
    return Held(
        s.count[MONOMERS],
        s.count[STORED],
        s.count[SMALLEST],
        s.count[LARGEST],
        w.edges[w.level[2]],
        w.edges[w.level[3] + 1],
        # one after the other: their product may be beyond all numbers
        2.0 * s.clock[VOLUME] / s.clock[MAJORANT] / factor,
    )


@piece
def _replace(w, held, a, b, gone, size, count):
    room = held.stored + SLACK <= w.sizes.shape[0]
    if size < held.bottom or size >= held.top or not room or (size > 1 and count > 1):
        return NOT_PLAIN, held
    if gone == 3:
        monomers, stored = _exchange(w, held.monomers, held.stored, a, b, size, count)
    else:
        one = a if gone == 1 else b
        monomers, stored = _exchange_one(w, held.monomers, held.stored, one, size, count)
    smallest, largest = min(held.smallest, size), max(held.largest, size)
    return PLAIN, Held(monomers, stored, smallest, largest, held.bottom, held.top, held.unit)


@piece
def release(s, held):
    """See `smolux.core.burst.Burst`."""
    s.count[MONOMERS], s.count[STORED] = held.monomers, held.stored
    s.count[SMALLEST], s.count[LARGEST] = held.smallest, held.largest


@piece
def _room(s, w, gone, entries, p):
    needed = np.int64(SLACK)
    for e in range(entries):
        needed += s.counts[e] if s.sizes[e] > 1 else 0
    if s.count[STORED] + needed > w.sizes.shape[0]:
        return False
    if w.apart[APART] == 1:
        watch(s, w, gone, entries)
    for e in range(entries):
        s.count[SMALLEST] = min(s.count[SMALLEST], s.sizes[e])
        note_largest(s, s.sizes[e])
    return True


@piece
def _exchange_pair(s, w):
    size, count = s.sizes[0], s.counts[0]
    if size > 1 and count != 1:
        return False
    s.count[MONOMERS], s.count[STORED] = _exchange(
        w, s.count[MONOMERS], s.count[STORED], s.count[FIRST], s.count[SECOND], size, count
    )
    return True


@piece
def _take(s, w, place):
    # monomers are numbered first: the number of a particle before this one stays
    s.count[MONOMERS], s.count[STORED] = _without(w, s.count[MONOMERS], s.count[STORED], place)


@piece
def _put(s, w, size, count, i, j, p):
    if size == 1:
        s.count[MONOMERS] += count
        return
    stored = s.count[STORED]
    for k in range(count):
        w.sizes[stored + k] = size
    s.count[STORED] = stored + count


@piece
def prepare(s, w, p):
    """Bring the bound in force up to date."""
    if w.apart[VAIN] == 1:
        seek_apart(s, w)
    if s.count[SINCE] > s.count[PARTICLES] + 64:
        rescan(s, w)
    s.clock[MAJORANT] = max(s.clock[MAJORANT], s.clock[FLOOR])
    return renew_majorant(s, w.edges, w.majorant, w.level, w.apart[APART] == 1)


@cold_piece
def _double(s, w):
    stored = s.count[STORED]
    if 2 * stored + SLACK > w.sizes.shape[0]:
        return False
    if w.apart[APART] == 1:  # of the one apart there are two now
        renew_all(w)
    for k in range(stored):
        w.sizes[stored + k] = w.sizes[k]
    s.count[STORED] *= 2
    s.count[MONOMERS] *= 2
    return True


@lru_cache(maxsize=64)
def make_visit(tally: Any) -> Any:
    """Bind the counting of all particles."""

    @cold_piece
    def visit(s, w, t, grid, p):
        largest = np.int64(0)
        if s.count[MONOMERS] > 0:
            tally(t, grid, np.int64(1), s.count[MONOMERS], p)
            largest = np.int64(1)
        for k in range(s.count[STORED]):
            tally(t, grid, w.sizes[k], 1, p)
            largest = max(largest, w.sizes[k])
        return largest

    return visit


def bind(rate: Any, tally: Any) -> Pieces:
    """Bind the pieces to a rate and a way to count."""
    find = make_find(rate)
    store = Store(
        view, _size, _pick, _room, _take, _put, _double, make_visit(tally), _exchange_pair
    )
    return pieces_of(store, make_draw(find), prepare, Burst(row, hold, find, _replace, release))
