"""The trees of the low-rank method: their quanta, and which particle is left out of them."""

from __future__ import annotations

import math

import numpy as np

from smolux.core.slots import octave
from smolux.core.state import BOUND, LARGEST, PARTICLES, SINCE
from smolux.jit.compile import cold_piece, piece

from .segment_tree import build
from .store import APART, SEEK, STAGE, WANTED, rescan

#: sums are kept below this number of quanta, so that a uniform number can tell them all apart
MOST = 1 << 52
#: what the quanta are chosen for
_AIM = 2.0**44
#: share of the majorant from which on a particle with itself is left out of the trees
_OUTWEIGHS = 0.99


@piece
def root_of(w, row):
    """Sum of all weights of one factor."""
    return w.tree[row, w.tree.shape[1] - 1]


@cold_piece
def _outweighing(w, stage):
    """Slot of a particle that would nearly always be drawn with itself; 0 if there is none."""
    w.mix[:] = 0.0
    for slot in range(1, w.number.shape[0]):
        if w.number[slot] > 0.0:
            for row in range(w.rank[stage, 0]):
                w.mix[row] += w.number[slot] * w.factor[stage, slot, row]
    total = 0.0
    for k in range(w.rank[stage, 1]):
        total += w.weights[stage, k] * w.mix[w.term[stage, k, 0]] * w.mix[w.term[stage, k, 1]]
    for slot in range(1, w.number.shape[0]):
        if w.number[slot] == 1.0:
            own = 0.0
            for k in range(w.rank[stage, 1]):
                left, right = w.term[stage, k, 0], w.term[stage, k, 1]
                own += (
                    w.weights[stage, k] * w.factor[stage, slot, left] * w.factor[stage, slot, right]
                )
            if own > _OUTWEIGHS * total:
                return np.int64(slot)
    return np.int64(0)


@cold_piece
def _build_row(w, stage, row, afresh):
    """Build the tree of one factor, with quanta for which its sum is a large whole number."""
    slots, apart = w.number.shape[0], w.meta[APART]
    total = 0.0
    for slot in range(1, slots):
        if w.number[slot] > 0.0 and slot != apart:
            total += w.number[slot] * w.factor[stage, slot, row]
    if afresh:
        w.scale[row] = 1.0
        if total > 0.0:
            w.scale[row] = math.ldexp(1.0, math.floor(math.log2(_AIM / total)))
    above = 1.0 if row < w.rank[stage, 0] - w.rank[stage, 2] else 0.0
    for slot in range(1, slots):
        exact = w.factor[stage, slot, row] * w.scale[row]
        grains = np.floor(exact) + above
        w.grains[slot, row] = grains
        w.share[slot] = min(w.share[slot], w.shares[stage, slot] * (exact / grains))
        if w.number[slot] > 0.0 and slot != apart:
            w.tree[row, slot] = np.int64(w.number[slot] * grains)
        else:
            w.tree[row, slot] = 0
    build(w.tree, w.levels, row)


@cold_piece
def _build(w, stage, afresh):
    """Choose quanta for which the sums are large whole numbers, and build the trees of them.

    Unless `afresh`, the quanta are those of before, and so is everything that follows from them.
    """
    w.meta[STAGE] = stage
    if afresh:
        w.meta[APART] = _outweighing(w, stage) if w.meta[SEEK] == 1 else 0
    for slot in range(w.number.shape[0]):
        w.share[slot] = w.shares[stage, slot]
    for k in range(w.rank[stage, 1]):
        w.weight[k] = w.weights[stage, k]
    for row in range(w.rank[stage, 0]):
        _build_row(w, stage, row, afresh)
        if afresh:
            w.least[row] = root_of(w, row) >> 8
        elif not w.least[row] <= root_of(w, row) <= MOST:
            w.meta[STAGE] = -1
        for k in range(w.rank[stage, 1]):
            for side in range(2):
                if w.term[stage, k, side] == row:
                    w.weight[k] /= w.scale[row]


@piece
def prepare(s, w, p):
    """Build the trees for the majorant of the octave that is reached, or ask for it."""
    stage = np.int64(0)
    if w.rank.shape[0] > 1:
        if s.count[SINCE] > s.count[PARTICLES] + 64:
            rescan(s, w)
        stage = octave(s.count[LARGEST])
    if stage != w.meta[STAGE]:
        if w.rank[stage, 0] == 0:
            w.meta[WANTED] = stage
            return BOUND
        if w.meta[STAGE] == -stage - 2:  # the arrays have grown
            _build(w, stage, False)
        if w.meta[STAGE] != stage:
            _build(w, stage, True)
    return 0
