"""How the particles of the size-class method change, and how they are counted."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from smolux.core.slots import slot_of
from smolux.jit.compile import at, cold_piece, piece

from .lists import is_list, make_lists, place_of, size_at
from .state import AHEAD, BITS, CHUNK, FREE, NEXT, SHARE, SINGLE, STALE, WIDEST


@piece
def listed(w, size, count):
    """How many of so many particles of one size come into a list: all or none."""
    return count if is_list(w, slot_of(size, w.meta[BITS])) else np.int64(0)


@piece
def chunks_for(w, size, count, together):
    """Chunks that particles of one size may need; more than there are if they have no room.

    With `together` particles for lists, of all sizes, which may be of one class.
    """
    g, bits = slot_of(size, w.meta[BITS]), w.meta[CHUNK]
    if g >= w.number.shape[0] or size > w.meta[WIDEST]:
        return w.meta[FREE] + 1
    if not is_list(w, g):
        return np.int64(0)
    if (w.number[at(g)] + together) >> bits >= w.where.shape[1]:
        return w.meta[FREE] + 1
    return (count >> bits) + 1


@piece
def _no_account(w):
    return


@piece
def _double_account(w):
    for k in range(w.account.shape[0]):
        for d in range(w.account.shape[1]):
            w.account[k, d] *= 2


class Changes(NamedTuple):
    """How particles come and go.

    Attributes
    ----------
    remove : ``remove(w, g, place)``
    insert : ``insert(w, size, count)``
    double : ``double(s, w)``
    """

    remove: Any
    insert: Any
    double: Any


@lru_cache(maxsize=2)
def make_changes(rows: bool) -> Changes:
    """Bind what happens to particles, with `rows` or without; see `smolux.core.rows`."""
    cut, append, duplicate = make_lists(rows)
    more = _double_account if rows else _no_account

    @piece
    def remove(w, g, place):
        """Take a particle out."""
        last = w.number[at(g)] - 1
        w.number[at(g)] = last
        if is_list(w, g):
            cut(w, g, place, last)

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
        more(w)
        for g in range(w.number.shape[0]):
            if g < single:
                w.number[g] *= 2
            else:
                duplicate(w, g)
            w.before[g] *= 2
        return True

    return Changes(remove, insert, double)


#: of particles without rows
remove, insert, double = make_changes(False)


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
                size = size_at(w, g, place_of(w, g, slot))
                tally(t, grid, size, 1, p)
                largest = max(largest, size)
        return largest

    return visit
