"""Lists of sizes, one for each class, in chunks of one pool.

A list grows and shrinks at its end by whole chunks, so that nothing is ever moved to make room and
the pool need not be larger than all lists together, but for one chunk each.
"""

from __future__ import annotations

import numpy as np

from .compile import at, piece


@piece
def place_of(where, g, slot, bits):
    """Place in the pool of an entry of list `g`."""
    chunk = np.int64(where[at(g), at(slot >> bits)])
    return (chunk << bits) + (slot & ((1 << bits) - 1))


@piece
def take_chunk(where, free, left, g, chunk):
    """Give list `g` its next chunk; `left` are free before, one less is returned."""
    where[at(g), at(chunk)] = free[at(left - 1)]
    return left - 1


@piece
def return_chunk(where, free, left, g, chunk):
    """Take a chunk of list `g` back; the number of free ones is returned."""
    free[at(left)] = where[at(g), at(chunk)]
    return left + 1
