"""Particles by classes of sizes: the arrays of the size-class method and how they change."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..core.compile import at, cold_piece, piece
from ..core.pool import place_of, return_chunk, take_chunk
from ..core.prefetch import prefetch
from ..core.slots import slot_of
from ..core.state import PARTICLES

#: candidates drawn ahead, so that their memory is there when it is needed
AHEAD = 32

# Entries of Work.meta.
BITS = 0  # of sizes that tell classes apart: 2**BITS classes an octave
CHUNK = 1  # bits of the entries of a chunk
WIDEST = 2  # sizes above this need a pool of wider entries
FREE = 3  # chunks that no list holds
NEXT = 4  # next candidate drawn ahead
PAIRS = 5  # pairs of classes in the table
STALE = 6  # whether the table must be renewed before the next candidate
BLOCK = 7  # events until it is renewed in any case
SPAN = 8  # events over which particles that came in are counted, those long ago less
SINGLE = 9  # classes below this hold one size each, and are only counted
META = 10

#: a particle is a number of this many bits within its class, and the class above them
SLOT_BITS = 44
SLOT = (1 << SLOT_BITS) - 1
#: entries of lists are asked for so far from their ends, as these move
STRIDE = 32
#: what one particle that comes in counts for, so that it is not forgotten at once
SHARE = 16


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
        Particles that have come into each class, 16 for each; halved with every table.
    before : int64 array of shape (R, G)
        Particles in each class when the table was made.
    tail : int64 array of shape (R, G)
        Place of the last entry of each list.
    where : int32 array of shape (R, G, chunks)
        Chunks of each list.
    free : int32 array of shape (R, pool chunks)
        Chunks that no list holds, the first ``meta[FREE]`` entries.
    pool : int32 or int64 array of shape (R, entries)
        Sizes.
    table : uint64 array of shape (R, 3 P)
        The alias table of pairs of classes, see `smolux.core.alias.pack`.
    weight, share : float64 arrays of shape (R, P)
    classes : uint32 array of shape (R, P)
        The two classes of each pair in the table, 16 bits each.
    alias, queue : int32 arrays of shape (R, P)
        Scratch, for the making of the table, as are `weight` and `share`.
    one, two : int64 arrays of shape (R, AHEAD)
        Candidates drawn ahead: class and slot of the two particles.
    place_one, place_two : int64 arrays of shape (R, AHEAD)
        Their places in the pool.
    column : int64 array of shape (R, AHEAD)
        Columns of the table they come from; below zero if they are accepted whatever their rates.
    rest : uint64 array of shape (R, AHEAD)
        What is left of the random bits with which they were drawn.
    wait : float64 array of shape (R, AHEAD)
        Their waiting times, of mean 1.
    high, low : float64 arrays of shape (G, G)
        Bounds of the rate for each pair of classes, the lower one as a share of the upper; `low` is
        NaN until asked for, `high` also where there is no finite bound.
    """

    meta: np.ndarray
    number: np.ndarray
    room: np.ndarray
    flow: np.ndarray
    before: np.ndarray
    tail: np.ndarray
    where: np.ndarray
    free: np.ndarray
    pool: np.ndarray
    table: np.ndarray
    weight: np.ndarray
    share: np.ndarray
    alias: np.ndarray
    classes: np.ndarray
    queue: np.ndarray
    one: np.ndarray
    two: np.ndarray
    place_one: np.ndarray
    place_two: np.ndarray
    column: np.ndarray
    rest: np.ndarray
    wait: np.ndarray
    high: np.ndarray
    low: np.ndarray


@piece
def view(w, r):
    """Work arrays of one replica."""
    return Work(
        w.meta[r],
        w.number[r],
        w.room[r],
        w.flow[r],
        w.before[r],
        w.tail[r],
        w.where[r],
        w.free[r],
        w.pool[r],
        w.table[r],
        w.weight[r],
        w.share[r],
        w.alias[r],
        w.classes[r],
        w.queue[r],
        w.one[r],
        w.two[r],
        w.place_one[r],
        w.place_two[r],
        w.column[r],
        w.rest[r],
        w.wait[r],
        w.high,
        w.low,
    )


@piece
def is_list(w, g):
    """Whether the particles of a class are listed, not only counted."""
    return g >= w.meta[SINGLE]


@piece
def place(w, g, slot):
    """Place of a particle of a list in the pool."""
    return place_of(w.where, g, slot, w.meta[CHUNK])


@piece
def size_at(w, g, place):
    """Size of a particle by its place."""
    return np.int64(w.pool[at(place)]) if is_list(w, g) else np.int64(g)


@cold_piece
def locate(w):
    """Find the places of the candidates drawn ahead; 0 for what is only counted."""
    for k in range(w.meta[NEXT], AHEAD):
        for slots, places in ((w.one, w.place_one), (w.two, w.place_two)):
            g = slots[k] >> SLOT_BITS
            places[k] = place(w, g, slots[k] & SLOT) if is_list(w, g) else 0


@piece
def remove(w, g, place):
    """Take a particle out: the last of its class moves into the gap."""
    last = w.number[at(g)] - 1
    w.number[at(g)] = last
    if is_list(w, g):
        end, bits = w.tail[at(g)], w.meta[CHUNK]
        w.pool[at(place)] = w.pool[at(end)]
        prefetch(w.pool, end - STRIDE)
        if last & ((1 << bits) - 1) == 0:
            w.meta[FREE] = return_chunk(w.where, w.free, w.meta[FREE], g, last >> bits)
            end = place_of(w.where, g, max(last, 1) - 1, bits) + 1
        w.tail[at(g)] = end - 1


@piece
def append(w, g, size):
    """Put a particle at the end of a list; there must be a free chunk."""
    bits = w.meta[CHUNK]
    slot = w.number[at(g)]
    end = w.tail[at(g)] + 1
    if slot & ((1 << bits) - 1) == 0:
        end = _next_chunk(w, g, slot >> bits) << bits
    w.tail[at(g)] = end
    w.pool[at(end)] = size
    w.number[at(g)] = slot + 1


@cold_piece
def _next_chunk(w, g, chunk):
    before = w.where[g, chunk]
    w.meta[FREE] = take_chunk(w.where, w.free, w.meta[FREE], g, chunk)
    if w.where[g, chunk] != before:  # a candidate may have been drawn for one of its slots
        locate(w)
    return np.int64(w.where[g, chunk])


@piece
def insert(w, size, count):
    """Put particles of one size in; there must be free chunks."""
    g = slot_of(size, w.meta[BITS])
    if is_list(w, g):
        for _ in range(count):
            append(w, g, size)
    else:
        w.number[at(g)] += count
    w.flow[at(g)] += SHARE * count
    if w.number[at(g)] > w.room[at(g)]:
        w.meta[STALE] = 1


@piece
def chunks_for(w, size, count):
    """Chunks that particles of one size may need; more than there are if they have no room."""
    g, bits = slot_of(size, w.meta[BITS]), w.meta[CHUNK]
    if g >= w.number.shape[0] or size > w.meta[WIDEST]:
        return w.meta[FREE] + 1
    if not is_list(w, g):
        return np.int64(0)
    if (w.number[at(g)] + count) >> bits >= w.where.shape[1]:
        return w.meta[FREE] + 1
    return (count >> bits) + 1


@cold_piece
def double(s, w):
    """Put every particle in once more; False, with nothing changed, if there is no room."""
    bits, single = w.meta[CHUNK], w.meta[SINGLE]
    chunks = np.int64(0)
    for g in range(single, w.number.shape[0]):
        end = (2 * w.number[g]) >> bits
        chunks += end - (w.number[g] >> bits) + 1
        if end >= w.where.shape[1]:
            return False
    if chunks > w.meta[FREE]:
        return False
    w.meta[STALE], w.meta[NEXT] = 1, AHEAD
    for g in range(w.number.shape[0]):
        n = w.number[g]
        if g < single:
            w.number[g] = 2 * n
        else:
            for slot in range(n):
                append(w, g, w.pool[place(w, g, slot)])
        w.before[g] *= 2
    s.count[PARTICLES] *= 2
    return True


@lru_cache(maxsize=64)
def make_visit(tally):
    """Bind the counting of all particles, for output."""

    @cold_piece
    def visit(s, w, t, grid, p):
        largest = np.int64(0)
        for g in range(1, w.number.shape[0]):
            if w.number[g] == 0:
                continue
            if not is_list(w, g):
                tally(t, grid, np.int64(g), w.number[g], p)
                largest = np.int64(g)
                continue
            for slot in range(w.number[g]):
                size = np.int64(w.pool[place(w, g, slot)])
                tally(t, grid, size, 1, p)
                largest = max(largest, size)
        return largest

    return visit
