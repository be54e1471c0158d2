"""Compiled pieces of the size-class method, and the arrays they work on."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..core import rng
from ..core.alias import build, outcome
from ..core.compile import cold_piece, piece
from ..core.loop import Pieces, note_bad, repair, tally_one
from ..core.pool import place_of, return_chunk, take_chunk
from ..core.prefetch import prefetch
from ..core.slots import slot_of
from ..core.state import BOUND, FIRST, MAJORANT, PARTICLES, SECOND, SINCE, TRIALS, VOLUME

#: candidates drawn ahead, so that their memory is there when it is needed
AHEAD = 32
#: candidates looked at before the loop may return without an event
_PATIENCE = 4096
#: a chosen particle is a number of this many bits within its class, and the class above them
_SLOT_BITS = 44
_SLOT = (1 << _SLOT_BITS) - 1

# Entries of Work.meta.
BITS = 0  # of sizes that tell classes apart: 2**BITS classes an octave
CHUNK = 1  # bits of the entries of a chunk
WIDEST = 2  # sizes above this need a pool of wider entries
FREE = 3  # chunks that no list holds
NEXT = 4  # next candidate drawn ahead
PAIRS = 5  # pairs of classes in the table
STALE = 6  # whether the table must be renewed before the next candidate
BLOCK = 7  # events until it is renewed in any case
META = 8


class Work(NamedTuple):
    """Classes of sizes; those of one size are only counted, the others are lists.

    Attributes
    ----------
    meta : int64 array of shape (R, META)
    number : int64 array of shape (R, G)
        Particles in each class.
    room : int64 array of shape (R, G)
        Places for which candidates are drawn, filled or not.
    flow : int64 array of shape (R, G)
        Particles that have come into each class since the table was made.
    before : int64 array of shape (R, G)
        Particles in each class when the table was made.
    where : int32 array of shape (R, G, chunks)
        Chunks of each list.
    free : int32 array of shape (R, pool chunks)
        Chunks that no list holds, the first ``meta[FREE]`` entries.
    pool : int32 or int64 array of shape (R, entries)
        Sizes.
    weight, share : float64 arrays of shape (R, P)
    alias : int32 array of shape (R, P)
    classes : int32 array of shape (R, P)
        The two classes of each pair in the table, 16 bits each.
    queue : int32 array of shape (R, P)
        Scratch.
    one, two : int64 arrays of shape (R, AHEAD)
        Candidates drawn ahead: class and slot of the two particles.
    listed : bool array of shape (G,)
        Whether a class is a list.
    high, low : float64 arrays of shape (G, G)
        Bounds of the rate for each pair of classes, the lower one as a share of the upper; `low` is
        NaN until asked for, `high` also where there is no finite bound.
    """

    meta: np.ndarray
    number: np.ndarray
    room: np.ndarray
    flow: np.ndarray
    before: np.ndarray
    where: np.ndarray
    free: np.ndarray
    pool: np.ndarray
    weight: np.ndarray
    share: np.ndarray
    alias: np.ndarray
    classes: np.ndarray
    queue: np.ndarray
    one: np.ndarray
    two: np.ndarray
    listed: np.ndarray
    high: np.ndarray
    low: np.ndarray


@piece
def _view(w, r):
    return Work(
        w.meta[r],
        w.number[r],
        w.room[r],
        w.flow[r],
        w.before[r],
        w.where[r],
        w.free[r],
        w.pool[r],
        w.weight[r],
        w.share[r],
        w.alias[r],
        w.classes[r],
        w.queue[r],
        w.one[r],
        w.two[r],
        w.listed,
        w.high,
        w.low,
    )


@piece
def _place(w, g, slot):
    """Place of a particle of a list in the pool."""
    return place_of(w.where, g, slot, w.meta[CHUNK])


@piece
def _size(w, g, slot):
    if not w.listed[g]:
        return np.int64(g)
    return np.int64(w.pool[_place(w, g, slot)])


@piece
def _pair(s, w):
    a, b = s.count[FIRST], s.count[SECOND]
    return (
        _size(w, a >> _SLOT_BITS, a & _SLOT),
        _size(w, b >> _SLOT_BITS, b & _SLOT),
    )


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
            prefetch(w.pool, _place(w, g, a))
        if w.listed[h]:
            prefetch(w.pool, _place(w, h, b))
    w.meta[NEXT] = 0


def _make_draw(rate: Any) -> Any:
    @piece
    def accepts(s, w, g, h, a, b, p):
        """Whether the rate accepts a candidate: 1 or 0; -1 if there is no rate."""
        u = rng.uniform(s.rng)
        if u < w.low[g, h]:
            return 1
        i, j = _size(w, g, a), _size(w, h, b)
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
def _remove(s, w, g, slot):
    """Take a particle out: the last of its class moves into the gap."""
    last = w.number[g] - 1
    w.number[g] = last
    if w.listed[g]:
        w.pool[_place(w, g, slot)] = w.pool[_place(w, g, last)]
        bits = w.meta[CHUNK]
        if last & ((1 << bits) - 1) == 0:
            w.meta[FREE] = return_chunk(w.where, w.free, w.meta[FREE], g, last >> bits)


@piece
def _append(w, g, size):
    """Put a particle at the end of a list; there must be a free chunk."""
    bits = w.meta[CHUNK]
    slot = w.number[g]
    if slot & ((1 << bits) - 1) == 0:
        w.meta[FREE] = take_chunk(w.where, w.free, w.meta[FREE], g, slot >> bits)
    w.pool[_place(w, g, slot)] = size
    w.number[g] = slot + 1


@piece
def _insert(s, w, size, count):
    g = slot_of(size, w.meta[BITS])
    if w.listed[g]:
        for _ in range(count):
            _append(w, g, size)
    else:
        w.number[g] += count
    w.flow[g] += count
    s.count[PARTICLES] += count
    if w.number[g] > w.room[g]:
        w.meta[STALE] = 1


@piece
def _fits(s, w, entries):
    """Whether what the event makes has room."""
    chunks = np.int64(0)
    for e in range(entries):
        size, g = s.sizes[e], slot_of(s.sizes[e], w.meta[BITS])
        if g >= w.number.shape[0] or size > w.meta[WIDEST]:
            return False
        if w.listed[g]:
            chunks += (s.counts[e] >> w.meta[CHUNK]) + 1
            if (w.number[g] + s.counts[e]) >> w.meta[CHUNK] >= w.where.shape[1]:
                return False
    return chunks <= w.meta[FREE]


@piece
def _update(s, w, entries, p):
    if not _fits(s, w, entries):
        return False
    a, b = s.count[FIRST], s.count[SECOND]
    # the later place of a class goes first: then the other stays where it is
    _remove(s, w, max(a, b) >> _SLOT_BITS, max(a, b) & _SLOT)
    _remove(s, w, min(a, b) >> _SLOT_BITS, min(a, b) & _SLOT)
    s.count[PARTICLES] -= 2
    for e in range(entries):
        _insert(s, w, s.sizes[e], s.counts[e])
    return True


@cold_piece
def _give_room(s, w, used):
    """Choose for how many particles of each class candidates are drawn until the next table.

    More places cost candidates that find them empty, fewer a new table as soon as a class is full.
    So there is room for what has come in at the rate since the last table, and its scatter. The
    number of events until the next table weighs its cost, about a quarter of a candidate for each
    pair of classes, against candidates lost to particles that have gone.
    """
    since = float(max(s.count[SINCE], 1))
    n, pairs = float(s.count[PARTICLES]), 0.5 * used * (used + 1)
    most = w.where.shape[1] << w.meta[CHUNK]
    # every class should have room at once, for which its own scatter is not enough
    scatter = 1.0 + math.sqrt(2.0 * math.log(used + 1.0))
    events = max(min(math.sqrt(n * (16.0 + 0.25 * pairs)), 0.25 * n, 32.0 * since + 64.0), 1.0)
    w.meta[BLOCK] = np.int64(events)
    for k in range(used):
        g = w.queue[k]
        gain = events * (w.number[g] - w.before[g]) / since
        flow = events * w.flow[g] / since
        slack = 1.2 * max(gain, 0.0) + scatter * math.sqrt(flow) + 1.5
        w.room[g] = w.number[g] + np.int64(slack)
        if w.listed[g]:
            w.room[g] = min(w.room[g], most)
        w.before[g] = w.number[g]
        w.flow[g] = 0


@cold_piece
def _weigh(s, w, used):
    """Enter the pairs of classes and their rates into the table; whether their bounds are known."""
    pairs, total = 0, 0.0
    for k in range(used):
        g = w.queue[k]
        for m in range(k, used):
            h = w.queue[m]
            half = 0.5 if g == h else 1.0
            weight = half * float(w.room[g]) * float(w.room[h]) * w.high[g, h]
            if math.isnan(weight):
                return False
            if weight > 0.0:
                w.weight[pairs] = weight
                w.classes[pairs] = (g << 16) | h
                total += weight
                pairs += 1
    s.clock[MAJORANT] = total
    w.meta[PAIRS] = pairs
    return True


@cold_piece
def _renew(s, w):
    """Make the table of pairs of classes afresh; `BOUND` if a bound is not known yet."""
    used = 0
    for g in range(1, w.number.shape[0]):
        if w.number[g] > 0 or w.flow[g] > 0:
            w.queue[used] = g
            used += 1
        else:
            w.room[g] = w.before[g] = 0
    largest = w.queue[used - 1]
    if math.isnan(w.low[largest, largest]):
        return BOUND
    _give_room(s, w, used)
    if not _weigh(s, w, used):
        return BOUND
    s.count[SINCE] = 0
    w.meta[STALE] = 0
    w.meta[NEXT] = AHEAD
    pairs = w.meta[PAIRS]
    if pairs > 0:
        build(w.weight[:pairs], s.clock[MAJORANT], w.share, w.alias, w.queue)
    return 0


@piece
def _prepare(s, w, p):
    if w.meta[STALE] == 1 or s.count[SINCE] >= w.meta[BLOCK]:
        return _renew(s, w)
    return 0


@cold_piece
def _double(s, w):
    bits = w.meta[CHUNK]
    chunks = np.int64(0)
    for g in range(w.number.shape[0]):
        if w.listed[g]:
            end = (2 * w.number[g]) >> bits
            chunks += end - (w.number[g] >> bits) + 1
            if end >= w.where.shape[1]:
                return False
    if chunks > w.meta[FREE]:
        return False
    for g in range(w.number.shape[0]):
        n = w.number[g]
        if w.listed[g]:
            for slot in range(n):
                _append(w, g, w.pool[_place(w, g, slot)])
        else:
            w.number[g] = 2 * n
        w.before[g] *= 2
    s.count[PARTICLES] *= 2
    w.meta[STALE] = 1
    return True


@cold_piece
def _visit(s, w, t, grid):
    largest = np.int64(0)
    for g in range(1, w.number.shape[0]):
        if w.number[g] == 0:
            continue
        if not w.listed[g]:
            tally_one(t, grid, np.int64(g), w.number[g])
            largest = np.int64(g)
            continue
        for slot in range(w.number[g]):
            size = _size(w, g, slot)
            tally_one(t, grid, size, 1)
            largest = max(largest, size)
    return largest


def bind(rate: Any) -> Pieces:
    """Bind the pieces to a rate."""
    return Pieces(_view, _make_draw(rate), _pair, _update, _prepare, _double, _visit)
