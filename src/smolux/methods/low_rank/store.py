"""Particles in slots of nearly equal sizes, as the low-rank method holds them.

The small sizes have a slot each, which is counted; the particles of a wider slot lie one after
another in a stretch of one array. A stretch that is full moves to the end of the array; when the
end is reached, all move together again, with new gaps. Their order within a slot never changes, so
nothing depends on where they lie.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from smolux.core.slots import slot_of
from smolux.core.state import LARGEST, SINCE, STORED
from smolux.jit.compile import cold_piece, piece

# Entries of Work.meta.
STAGE = 0  # row of the tables in force; -1: the tree is to be built
TAIL = 1  # end of the last stretch of the pool
SLOTS_NEEDED = 2  # what `grow` is asked for
POOL_NEEDED = 3
WANTED = 4  # row of the tables that `supply_bound` is asked for
WIDEST = 5  # sizes above this need a pool of wider entries
SEEK = 6  # 1: candidates were in vain; a particle that outweighs all others is to be held apart
APART = 7  # slot of that particle, 0 if there is none
METAS = 8

#: a place is the number of a particle within its slot, of this many bits, and the slot above them
PLACE_BITS = 44
_WITHIN = (1 << PLACE_BITS) - 1


class Work(NamedTuple):
    """Particles and sums for C slots, F factors in K terms; tables for S stages.

    Attributes
    ----------
    number : float64 array of shape (R, C)
        Particles in each slot (whole numbers).
    tree : int64 array of shape (R, F, T)
        Segment trees over ``number * grains``, without a particle that is held apart; see
        `smolux.methods.low_rank.segment_tree`.
    levels : int64 array
        Where their levels begin.
    start, room, order : int64 arrays of shape (R, C)
        The stretch of each slot; the slots by where their stretches begin, as of the last move.
    pool : int32 or int64 array of shape (R, P)
        Sizes of the particles of the wider slots.
    meta : int64 array of shape (R, 8)
    mix : float64 array of shape (R, F)
        Scratch for majorants of mixed sign.
    grains : float64 array of shape (R, C, F)
        Weight of one particle of a slot, a whole number of quanta: the factor, rounded up.
    share : float64 array of shape (R, C)
        ``K >= share_a share_b`` times the majorant in the slots a and b.
    weight : float64 array of shape (R, K)
        Weight of each term, in quanta of its factors.
    least : int64 array of shape (R, F)
        Sums for which the quanta are too coarse.
    scale : float64 array of shape (R, F)
        Quanta in a unit of each factor.
    factor : float64 array of shape (S, slots, F)
        Bounds of the factors over each slot.
    shares : float64 array of shape (S, slots)
        As `share`, for the factors themselves.
    weights : float64 array of shape (S, K)
        As `weight`, for the factors themselves.
    term : int64 array of shape (S, K, 2)
        Left and right factor of each term.
    rank : int64 array of shape (S, 3)
        Factors and terms in use; how many factors, the last ones, are bounds from below, for terms
        of negative weight. Zeros where nothing is known yet.
    units : float64 array of shape (S,)
        Units in a rate of one: weights and sums are in units, so that they are no extreme numbers.
    bound : float64 array of shape (slots, slots), or empty
        Bounds of the kernel for pairs of slots, if the majorant is made of them; NaN until needed.
    bits : int64 array of shape (1,)
        See `smolux.core.slots`.
    """

    number: np.ndarray
    tree: np.ndarray
    levels: np.ndarray
    start: np.ndarray
    room: np.ndarray
    order: np.ndarray
    pool: np.ndarray
    meta: np.ndarray
    mix: np.ndarray
    grains: np.ndarray
    share: np.ndarray
    weight: np.ndarray
    least: np.ndarray
    scale: np.ndarray
    factor: np.ndarray
    shares: np.ndarray
    weights: np.ndarray
    term: np.ndarray
    rank: np.ndarray
    units: np.ndarray
    bound: np.ndarray
    bits: np.ndarray


@piece
def view(w, r):
    """Work arrays of one replica."""
    return Work(
        w.number[r],
        w.tree[r],
        w.levels,
        w.start[r],
        w.room[r],
        w.order[r],
        w.pool[r],
        w.meta[r],
        w.mix[r],
        w.grains[r],
        w.share[r],
        w.weight[r],
        w.least[r],
        w.scale[r],
        w.factor,
        w.shares,
        w.weights,
        w.term,
        w.rank,
        w.units,
        w.bound,
        w.bits,
    )


@piece
def counted(w):
    """Slots below this hold one size each."""
    return np.int64(2) << w.bits[0]


@piece
def place_of(slot, k):
    """Place of the particle `k` of a slot."""
    return (slot << PLACE_BITS) | k


@piece
def slot_at(place):
    """Slot of a particle."""
    return place >> PLACE_BITS


@piece
def size_at(s, w, place):
    """Size of a particle."""
    slot = slot_at(place)
    return slot if slot < counted(w) else np.int64(w.pool[w.start[slot] + (place & _WITHIN)])


@piece
def take(s, w, place):
    """Take a particle out: the last of its slot moves into the gap."""
    slot = slot_at(place)
    w.number[slot] -= 1.0
    if slot >= counted(w):
        first = w.start[slot]
        w.pool[first + (place & _WITHIN)] = w.pool[first + np.int64(w.number[slot])]
        s.count[STORED] -= 1


@piece
def insert(s, w, slot, size, count):
    """Put particles into a slot that has room for them."""
    n = np.int64(w.number[slot])
    w.number[slot] += count
    if size > s.count[LARGEST]:
        s.count[LARGEST] = size
    if slot >= counted(w):
        first = w.start[slot] + n
        w.pool[first] = size
        for k in range(1, count):
            w.pool[first + k] = size
        s.count[STORED] += count


@piece
def has_room(w, slot, count):
    """Whether so many more particles fit in a slot as it lies."""
    return slot < counted(w) or np.int64(w.number[slot]) + count <= w.room[slot]


@cold_piece
def make_room(s, w, slot, count):
    """Move stretches until there is room; False if the pool is too small."""
    needed = np.int64(w.number[slot]) + count
    room = needed + needed // 4 + 8
    stored = s.count[STORED]
    if w.meta[TAIL] + room > w.pool.shape[0] and w.pool.shape[0] >= stored + stored // 4 + 2 * room:
        _respace(s, w, 1)
        if needed <= w.room[slot]:
            return True
    if w.meta[TAIL] + room > w.pool.shape[0]:
        w.meta[POOL_NEEDED] = stored + stored // 2 + 4 * room + 1024
        return False
    new = w.meta[TAIL]
    for k in range(np.int64(w.number[slot])):
        w.pool[new + k] = w.pool[w.start[slot] + k]
    w.start[slot], w.room[slot] = new, room
    w.meta[TAIL] = new + room
    return True


@cold_piece
def _respace(s, w, copies):
    """Lay all stretches one after another, each with a gap, every particle `copies` times."""
    slots = w.order.shape[0]
    for k in range(1, slots):  # nearly sorted: only a few have moved to the end since
        slot, m = w.order[k], k
        while m > 0 and w.start[w.order[m - 1]] > w.start[slot]:
            w.order[m] = w.order[m - 1]
            m -= 1
        w.order[m] = slot
    end = np.int64(0)
    first = counted(w)
    for k in range(slots):
        slot = w.order[k]
        n = np.int64(w.number[slot]) if slot >= first else np.int64(0)
        for m in range(n):
            w.pool[end + m] = w.pool[w.start[slot] + m]
        w.start[slot] = end
        end += n
    # half of what is free goes into the gaps, in proportion, the rest stays at the end
    total = copies * s.count[STORED]
    gap = min(0.5 * (w.pool.shape[0] - total) / max(total, 1), 0.25)
    end = np.int64(0)
    for k in range(slots):
        slot = w.order[k]
        n = np.int64(w.number[slot]) * copies if slot >= first else np.int64(0)
        w.room[slot] = n + np.int64(gap * n)
        end += w.room[slot]
    w.meta[TAIL] = end
    for k in range(slots - 1, -1, -1):
        slot = w.order[k]
        n = np.int64(w.number[slot]) if slot >= first else np.int64(0)
        old = w.start[slot]
        end -= w.room[slot]
        w.start[slot] = end
        for m in range(n - 1, -1, -1):
            size = w.pool[old + m]
            for c in range(copies - 1, -1, -1):
                w.pool[end + c * n + m] = size


@cold_piece
def double(s, w):
    """Put every particle in once more; the trees are then built afresh."""
    stored = s.count[STORED]
    if stored > 0:
        if 2 * stored > w.pool.shape[0]:
            w.meta[POOL_NEEDED] = 2 * stored + stored // 2 + 64
            return False
        _respace(s, w, 2)
    for slot in range(w.number.shape[0]):
        w.number[slot] *= 2.0
    w.meta[STAGE] = -1
    s.count[STORED] *= 2
    return True


@lru_cache(maxsize=64)
def make_visit(tally):
    """Bind the counting of all particles, for output."""

    @cold_piece
    def visit(s, w, t, grid, p):
        largest = np.int64(0)
        for slot in range(w.number.shape[0]):
            n = np.int64(w.number[slot])
            if n > 0 and slot < counted(w):
                tally(t, grid, np.int64(slot), n, p)
                largest = max(largest, np.int64(slot))
            elif n > 0:
                for k in range(w.start[slot], w.start[slot] + n):
                    size = np.int64(w.pool[k])
                    tally(t, grid, size, 1, p)
                    largest = max(largest, size)
        return largest

    return visit


@cold_piece
def rescan(s, w):
    """Take the largest size afresh, to within its slot."""
    s.count[SINCE] = 0
    slot = np.int64(w.number.shape[0] - 1)
    while slot > 1 and w.number[slot] == 0.0:
        slot -= 1
    largest = slot
    if slot >= counted(w):
        for k in range(w.start[slot], w.start[slot] + np.int64(w.number[slot])):
            largest = max(largest, np.int64(w.pool[k]))
    s.count[LARGEST] = largest


@piece
def slot_for(w, size):
    """Slot of a size."""
    return slot_of(size, w.bits[0])
