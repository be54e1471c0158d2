"""Lists of the particles of each class, in chunks of one pool.

A list grows and shrinks at its end by whole chunks, so that nothing is ever moved to make room and
the pool need not be larger than all lists together, but for one chunk each.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from smolux.jit.compile import at, cold_piece, piece
from smolux.jit.prefetch import prefetch

from .state import AHEAD, CHUNK, FREE, NEXT, SINGLE, SLOT, SLOT_BITS

#: entries are asked for so far from the ends of lists, as these move
_STRIDE = 32


@piece
def is_list(w, g):
    """Whether the particles of a class are listed, not only counted."""
    return g >= w.meta[SINGLE]


@piece
def place_of(w, g, slot):
    """Place of an entry of a list in the pool."""
    bits = w.meta[CHUNK]
    chunk = np.int64(w.where[at(g), at(slot >> bits)])
    return (chunk << bits) + (slot & ((1 << bits) - 1))


@piece
def size_at(w, g, place):
    """Size of a particle by its class and place."""
    return np.int64(w.pool[at(place)]) if is_list(w, g) else np.int64(g)


@cold_piece
def _next_chunk(w, g, chunk):
    """Give a list its next chunk: its place in the pool."""
    before = w.where[g, chunk]
    w.meta[FREE] -= 1
    w.where[g, chunk] = w.free[w.meta[FREE]]
    if w.where[g, chunk] != before:  # a candidate may have been drawn for one of its slots
        locate(w)
    return np.int64(w.where[g, chunk]) << w.meta[CHUNK]


@cold_piece
def locate(w):
    """Find the places of the candidates drawn ahead."""
    for k in range(w.meta[NEXT], AHEAD):
        w.place_one[k] = place_of_particle(w, w.one[k])
        w.place_two[k] = place_of_particle(w, w.two[k])


@piece
def place_in(w, g, slot):
    """Place of a slot of any class, 0 if it is only counted; without a branch.

    Candidates are drawn for more slots than a list may hold so far; those beyond have any place.
    """
    bits = w.meta[CHUNK]
    slot = slot if is_list(w, g) else 0
    chunk = np.int64(w.where[at(g), at(min(slot >> bits, w.where.shape[1] - 1))])
    return (chunk << bits) + (slot & ((1 << bits) - 1))


@piece
def place_of_particle(w, one):
    """Place of a particle, a number of class and slot; 0 if it is only counted."""
    return place_in(w, one >> SLOT_BITS, one & SLOT)


@piece
def size_of_particle(w, one):
    """Size of a particle, a number of class and slot."""
    return size_at(w, one >> SLOT_BITS, place_of_particle(w, one))


@piece
def _nothing(w, place):
    return


@piece
def _nothing_of(w, place, other):
    return


@piece
def _move_row(w, place, other):
    width = w.mixed.shape[0]
    for d in range(width):
        w.rows[at(place * width + d)] = w.rows[at(other * width + d)]
    prefetch(w.rows, (other - _STRIDE) * width)


@piece
def _write_row(w, place):
    width = w.mixed.shape[0]
    for d in range(width):
        w.rows[at(place * width + d)] = w.row[d]


@piece
def _read_row(w, place):
    width = w.mixed.shape[0]
    for d in range(width):
        w.row[d] = w.rows[at(place * width + d)]


class Lists(NamedTuple):
    """How entries of a list come and go.

    Attributes
    ----------
    cut : ``cut(w, g, place, last)``
    append : ``append(w, g, size)``
    duplicate : ``duplicate(w, g)``
    """

    cut: Any
    append: Any
    duplicate: Any


@lru_cache(maxsize=2)
def make_lists(rows: bool) -> Lists:
    """Bind lists of particles, with `rows` or without; see `smolux.core.rows`."""
    move, write, read = (
        (_move_row, _write_row, _read_row) if rows else (_nothing_of, _nothing, _nothing)
    )

    @piece
    def cut(w, g, place, last):
        """Take an entry out of a list: entry `last`, now its end, moves into the gap."""
        end, bits = w.tail[at(g)], w.meta[CHUNK]
        w.pool[at(place)] = w.pool[at(end)]
        move(w, place, end)
        prefetch(w.pool, end - _STRIDE)
        end -= 1
        if last & ((1 << bits) - 1) == 0:
            w.free[at(w.meta[FREE])] = w.where[at(g), at(last >> bits)]
            w.meta[FREE] += 1
            end = place_of(w, g, max(last, 1) - 1)
        w.tail[at(g)] = end

    @piece
    def append(w, g, size):
        """Put a particle at the end of a list; there must be a free chunk."""
        slot, bits = w.number[at(g)], w.meta[CHUNK]
        end = w.tail[at(g)] + 1
        if slot & ((1 << bits) - 1) == 0:
            end = _next_chunk(w, g, slot >> bits)
        w.tail[at(g)] = end
        w.number[at(g)] = slot + 1
        w.pool[at(end)] = size
        write(w, end)

    @cold_piece
    def duplicate(w, g):
        """Put every particle of a list in once more; there must be free chunks."""
        bits = w.meta[CHUNK]
        full, rest = w.number[g] >> bits, w.number[g] & ((1 << bits) - 1)
        # full chunks are copied whole, and the one that is not full comes after them
        partial = w.where[g, full]
        for c in range(full):
            end = _next_chunk(w, g, full + c)
            start = np.int64(w.where[g, c]) << bits
            for k in range(1 << bits):
                w.pool[end + k] = w.pool[start + k]
                move(w, end + k, start + k)
        w.number[g] = (2 * full << bits) + rest
        if rest > 0:
            w.where[g, 2 * full] = partial
            for k in range(rest):
                place = (np.int64(partial) << bits) + k
                read(w, place)
                append(w, g, w.pool[place])
        elif full > 0:
            w.tail[g] = place_of(w, g, w.number[g] - 1)

    return Lists(cut, append, duplicate)


#: of particles without rows
cut, append, duplicate = make_lists(False)
