"""Geometric levels of sizes, and bounds of a rate over the levels that are present.

A level is one size up to 16, then an eighth of an octave. The bound in force covers the levels from
that of the smallest to that of the largest size present, so it is renewed only when one of them
changes level.
"""

from __future__ import annotations

import math

import numpy as np

from smolux.core.state import BOUND, FLOOR, LARGEST, MAJORANT, SMALLEST
from smolux.jit.compile import cold_piece, piece


def level_edges() -> np.ndarray:
    """Edges of the levels: level ``l`` holds the sizes ``edges[l] .. edges[l + 1] - 1``."""
    steps = np.arange(1, 8 * 58 + 1)
    coarse = [int(16 * 2.0 ** (k / 8)) for k in steps]
    return np.unique(np.array([*range(1, 17), *coarse], np.int64))


@piece
def level_of(edges, size):
    """Level of a size."""
    low, high = 0, edges.shape[0]
    while high - low > 1:
        middle = (low + high) // 2
        if edges[middle] <= size:
            low = middle
        else:
            high = middle
    return low


@cold_piece
def _change_levels(s, edges, table, level):
    low = level_of(edges, s.count[SMALLEST])
    high = level_of(edges, s.count[LARGEST])
    value = table[low, high]
    if math.isnan(value):
        return BOUND
    level[0], level[1] = level[2], level[3] = low, high
    s.clock[MAJORANT] = max(value, s.clock[FLOOR])
    return 0


@piece
def renew_majorant(s, edges, table, level, apart):
    """Put the bound over the sizes present into the state; `BOUND` if it is not in the table yet.

    ``level[0], level[1]`` are the levels the bound in force covers; ``level[2], level[3]`` those of
    all particles but one, if that is held `apart`: such bounds are in no table.
    """
    if s.count[SMALLEST] >= edges[level[0]] and s.count[LARGEST] < edges[level[1] + 1]:
        return 0
    if apart:
        return BOUND
    return _change_levels(s, edges, table, level)
