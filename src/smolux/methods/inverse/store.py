"""Particles as the inverse method holds them: counted by size, and one by one above."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from smolux.core import rng
from smolux.core.slots import slot_top
from smolux.core.state import LARGEST, SINCE, STORED, UNARY_BITS
from smolux.jit.compile import cold_piece, piece


class Work(NamedTuple):
    """Buckets of equal particles for sizes up to B, one entry a particle above.

    Slots below B are buckets, slot ``B + d`` is entry ``d`` of the large particles.

    Attributes
    ----------
    number : float64 array of shape (R, B)
        Particles in each bucket (whole numbers).
    rate : float64 array of shape (R, 1, B)
        Rate ``S_k`` of one particle of the bucket with all others; kept up to size
        ``count[LARGEST]``.
    block : float64 array of shape (R, B / 32)
        Sums of ``number * rate`` over blocks.
    large : int64 array of shape (R, capacity)
        Sizes above B; the first ``count[STORED]`` are in use.
    large_rate : float64 array of shape (R, capacity)
    table : float64 array of shape (B + 3, B), or (2 B + 3, B)
        Rates of bucket sizes with each other; three rows of scratch for larger sizes. If the
        kernel gives no rate somewhere, zeros stand there, and its own values in the last B rows.
    peak : float64 array of shape (R, 1)
        Largest sum of all rates since they were computed afresh.
    """

    number: np.ndarray
    rate: np.ndarray
    block: np.ndarray
    large: np.ndarray
    large_rate: np.ndarray
    table: np.ndarray
    peak: np.ndarray


@piece
def view(w, r):
    """Work arrays of one replica."""
    return Work(w.number[r], w.rate[r], w.block[r], w.large[r], w.large_rate[r], w.table, w.peak[r])


@piece
def top_of(s, w):
    """How many buckets are in use: those up to the largest size."""
    return min(s.count[LARGEST], w.table.shape[1])


@piece
def size_at(s, w, slot):
    """Size of the particles in a slot."""
    buckets = w.table.shape[1]
    return np.int64(slot + 1) if slot < buckets else w.large[slot - buckets]


@piece
def pick(s, w, r, c):
    """Slot and size of a particle, see `smolux.core.loop.Pieces`."""
    low, high = slot_top(c - 1, UNARY_BITS) + 1, slot_top(c, UNARY_BITS)
    left, buckets = rng.below(s.rng, s.held[c]), w.table.shape[1]
    for slot in range(low - 1, min(high, buckets)):
        if left < w.number[slot]:
            return np.int64(slot), np.int64(slot + 1)
        left -= np.int64(w.number[slot])
    for d in range(s.count[STORED]):
        if low <= w.large[d] <= high:
            if left == 0:
                return np.int64(buckets + d), w.large[d]
            left -= 1
    return np.int64(-1), np.int64(0)  # never reached


@piece
def take(s, w, slot):
    """Take a particle out: the last of the large ones moves into a gap."""
    buckets = w.table.shape[1]
    if slot < buckets:
        w.number[slot] -= 1.0
    else:
        s.count[STORED] -= 1
        w.large[slot - buckets] = w.large[s.count[STORED]]
        w.large_rate[slot - buckets] = w.large_rate[s.count[STORED]]


@cold_piece
def double(s, w):
    """Put every particle in once more; the rates are then computed afresh."""
    stored = s.count[STORED]
    if 2 * stored > w.large.shape[0]:
        return False
    for k in range(w.table.shape[1]):
        w.number[k] *= 2.0
    for d in range(stored):
        w.large[stored + d] = w.large[d]
    s.count[STORED] *= 2
    s.count[SINCE] = 0
    return True


@lru_cache(maxsize=64)
def make_visit(tally: Any) -> Any:
    """Bind the counting of all particles, for output."""

    @cold_piece
    def visit(s, w, t, grid, p):
        largest = np.int64(0)
        for k in range(w.table.shape[1]):
            if w.number[k] > 0.0:
                largest = np.int64(k + 1)
                tally(t, grid, largest, np.int64(w.number[k]), p)
        for d in range(s.count[STORED]):
            tally(t, grid, w.large[d], 1, p)
            largest = max(largest, w.large[d])
        return largest

    return visit
