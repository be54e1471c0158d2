"""Particles as acceptance-rejection stores them, and which of them the bound in force is for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from smolux.core.state import (
    FIRST,
    LARGEST,
    LIMIT,
    MONOMERS,
    PARTICLES,
    SECOND,
    SINCE,
    SMALLEST,
    STORED,
    TRIALS,
)
from smolux.jit.compile import at, cold_piece, piece

from .levels import level_of

# Entries of Work.apart.
APART, VAIN, LOOKED, LOW, HIGH = range(5)
#: candidates between two looks for a particle apart: a bound is asked of Python for each
_RARELY = 1 << 19
#: entries past the particles that may be written to
SLACK = 2


class Work(NamedTuple):
    """Monomers are only counted (``count[MONOMERS]``); all other particles lie in one array.

    Attributes
    ----------
    sizes : int64 array of shape (R, capacity)
        The first ``count[STORED]`` entries are the particles of sizes above 1.
    ahead : float64 array of shape (R, 16)
        Uniform numbers that choose the pairs of the next candidates; -1 before the first.
    level : int64 array of shape (R, 4)
        Levels that the bound in force covers: of all particles, and of all but one.
    apart : int64 array of shape (R, 5)
        Whether the bound in force is for pairs without that one; whether candidates were in vain;
        at which candidate the particles were looked through for it, and the levels of the second
        smallest and of the second largest then.
    edges, majorant, table : arrays
        Edges of levels; bound for each pair of levels, NaN until asked for; rates of small sizes.
    """

    sizes: np.ndarray
    ahead: np.ndarray
    level: np.ndarray
    apart: np.ndarray
    edges: np.ndarray
    majorant: np.ndarray
    table: np.ndarray


@piece
def view(w, r):
    """Work arrays of one replica."""
    return Work(w.sizes[r], w.ahead[r], w.level[r], w.apart[r], w.edges, w.majorant, w.table)


@piece
def size_of(w, monomers, slot):
    """Size of a particle; the first ones are the monomers."""
    # read first, choose then: which kind comes is a coin toss that no branch predictor wins
    place = slot - monomers
    size = w.sizes[at(max(place, 0))]
    return size if place >= 0 else np.int64(1)


@piece
def renew_all(w):
    """Let the bound be renewed, for all pairs of particles."""
    w.apart[APART] = 0
    w.level[0], w.level[1] = w.edges.shape[0] - 2, 0


@piece
def _is_apart(w, size):
    return size < w.edges[w.level[2]] or size >= w.edges[w.level[3] + 1]


@cold_piece
def watch(s, w, gone, entries):
    """See to it that an event leaves no more than one particle apart."""
    new = np.int64(0)
    for e in range(entries):
        if _is_apart(w, s.sizes[e]):
            new += s.counts[e]
    if gone & 1 and _is_apart(w, size_of(w, s.count[MONOMERS], s.count[FIRST])):
        new -= 1
    if gone & 2 and _is_apart(w, size_of(w, s.count[MONOMERS], s.count[SECOND])):
        new -= 1
    if new > 0:
        renew_all(w)


@cold_piece
def seek_apart(s, w):
    """Look for a particle that is much larger or smaller than all others, after candidates in vain.

    Its rate with itself, at which nothing ever happens, may be the bound in force. A look costs
    less than the candidates since the last one.
    """
    w.apart[VAIN] = 0
    since = s.count[TRIALS] - w.apart[LOOKED]
    if since < s.count[PARTICLES] or (since < _RARELY and w.apart[LOOKED] > 0):
        return
    w.apart[LOOKED] = s.count[TRIALS]
    low = lower = np.int64(LIMIT)  # the smallest is the lower one
    high = higher = np.int64(0)
    ones = s.count[MONOMERS]
    for k in range(-min(ones, 2), s.count[STORED]):
        size = w.sizes[k] if k >= 0 else np.int64(1)
        low, lower = min(low, max(lower, size)), min(lower, size)
        high, higher = max(high, min(higher, size)), max(higher, size)
    s.count[SINCE] = 0
    s.count[SMALLEST], s.count[LARGEST] = lower, higher
    renew_all(w)
    w.apart[LOW], w.apart[HIGH] = level_of(w.edges, low), level_of(w.edges, high)
    if w.apart[LOW] > level_of(w.edges, lower) or w.apart[HIGH] < level_of(w.edges, higher):
        w.apart[APART] = 1
        w.level[2] = -1  # which of the two it is, the bounds will say


@cold_piece
def rescan(s, w):
    """Take the smallest and largest size afresh; the bound in force is then renewed."""
    s.count[SINCE] = 0
    low = np.int64(1) if s.count[MONOMERS] > 0 else max(w.sizes[0], np.int64(1))
    high = low
    for k in range(s.count[STORED]):
        low = min(low, w.sizes[k])
        high = max(high, w.sizes[k])
    s.count[SMALLEST], s.count[LARGEST] = low, high
    renew_all(w)
