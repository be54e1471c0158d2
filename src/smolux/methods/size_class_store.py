"""Particles by classes of sizes: the arrays of the size-class method and how they change."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..core.compile import at, cold_piece, piece
from ..core.pool import place_of, return_chunk, take_chunk
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
META = 9
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
    either : int64 array of shape (R, P)
        The classes of the pair a column of the table keeps, in the upper half, and of its alias.
    queue : int32 array of shape (R, P)
        Scratch.
    one, two : int64 arrays of shape (R, AHEAD)
        Candidates drawn ahead: class and slot of the two particles.
    mark : float64 array of shape (R, AHEAD)
        What their rates are held against, as a share of the bound; below zero: they are accepted.
    wait : float64 array of shape (R, AHEAD)
        Their waiting times, of mean 1.
    mask : int64 array of shape (G,)
        For slots: -1 if a class is a list, 0 if its particles are only counted.
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
    either: np.ndarray
    queue: np.ndarray
    one: np.ndarray
    two: np.ndarray
    mark: np.ndarray
    wait: np.ndarray
    mask: np.ndarray
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
        w.where[r],
        w.free[r],
        w.pool[r],
        w.weight[r],
        w.share[r],
        w.alias[r],
        w.classes[r],
        w.either[r],
        w.queue[r],
        w.one[r],
        w.two[r],
        w.mark[r],
        w.wait[r],
        w.mask,
        w.high,
        w.low,
    )


@piece
def place(w, g, slot):
    """Place of a particle of a list in the pool."""
    return place_of(w.where, g, slot, w.meta[CHUNK])


@piece
def size_at(w, g, slot):
    """Size of a particle."""
    if w.mask[at(g)] == 0:
        return np.int64(g)
    return np.int64(w.pool[at(place(w, g, slot))])


@piece
def remove(w, g, slot):
    """Take a particle out: the last of its class moves into the gap."""
    last = w.number[at(g)] - 1
    w.number[at(g)] = last
    if w.mask[at(g)] != 0:
        w.pool[at(place(w, g, slot))] = w.pool[at(place(w, g, last))]
        bits = w.meta[CHUNK]
        if last & ((1 << bits) - 1) == 0:
            w.meta[FREE] = return_chunk(w.where, w.free, w.meta[FREE], g, last >> bits)


@piece
def append(w, g, size):
    """Put a particle at the end of a list; there must be a free chunk."""
    bits = w.meta[CHUNK]
    slot = w.number[at(g)]
    if slot & ((1 << bits) - 1) == 0:
        w.meta[FREE] = take_chunk(w.where, w.free, w.meta[FREE], g, slot >> bits)
    w.pool[at(place(w, g, slot))] = size
    w.number[at(g)] = slot + 1


@piece
def insert(w, size, count):
    """Put particles of one size in; there must be free chunks."""
    g = slot_of(size, w.meta[BITS])
    if w.mask[at(g)] != 0:
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
    if ((w.number[at(g)] + count) & w.mask[at(g)]) >> bits >= w.where.shape[1]:
        return w.meta[FREE] + 1
    return ((count >> bits) + 1) & w.mask[at(g)]


@cold_piece
def double(s, w):
    """Put every particle in once more; False, with nothing changed, if there is no room."""
    bits = w.meta[CHUNK]
    chunks = np.int64(0)
    for g in range(w.number.shape[0]):
        if w.mask[g] != 0:
            end = (2 * w.number[g]) >> bits
            chunks += end - (w.number[g] >> bits) + 1
            if end >= w.where.shape[1]:
                return False
    if chunks > w.meta[FREE]:
        return False
    for g in range(w.number.shape[0]):
        n = w.number[g]
        if w.mask[g] != 0:
            for slot in range(n):
                append(w, g, w.pool[place(w, g, slot)])
        else:
            w.number[g] = 2 * n
        w.before[g] *= 2
    s.count[PARTICLES] *= 2
    w.meta[STALE] = 1
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
            if w.mask[g] == 0:
                tally(t, grid, np.int64(g), w.number[g], p)
                largest = np.int64(g)
                continue
            for slot in range(w.number[g]):
                size = size_at(w, g, slot)
                tally(t, grid, size, 1, p)
                largest = max(largest, size)
        return largest

    return visit
