"""The arrays of the size-class method."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from smolux.jit.compile import piece

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
        The alias table of pairs of classes, see `smolux.methods.size_class.alias.pack`.
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
    high, low : float64 arrays of shape (1 or R, G, G)
        Bounds of the rate for each pair of classes, the lower one as a share of the upper; `low` is
        NaN until asked for, `high` also where there is no finite bound. All replicas share those
        that are proved; those that are not are raised by the replica that finds a rate above them.
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
        w.high[min(r, w.high.shape[0] - 1)],
        w.low[min(r, w.low.shape[0] - 1)],
    )
