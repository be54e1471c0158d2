"""Segment trees: sums of weights over slots, in which a slot is found by its place in the total.

A tree has one row for each kind of weight. A node is the sum of its sixteen children, always added
up in the same way and never corrected by differences: rounding does not pile up, and neither the
history nor empty slots at the end change a sum.

References
----------
A. I. Osinsky, Low-rank Monte Carlo for Smoluchowski-class equations, arXiv:2312.02788 (2023),
section 3.
"""

from __future__ import annotations

import numpy as np

from .compile import cold_piece, piece

#: children of a node
FANOUT = 16

#: the sum of the children may be reordered, so that it vectorises
_FAST = {"fastmath": {"reassoc", "contract", "nsz"}}


def levels_of(slots: int) -> np.ndarray:
    """Where each level of a tree begins in a row: the slots first, the root last.

    The row has ``levels[-1] + 1`` entries; `slots` must be a multiple of `FANOUT`.
    """
    starts, nodes = [0], slots
    while nodes > 1:
        starts.append(starts[-1] + nodes)
        nodes //= FANOUT
        if nodes > 1:
            nodes = -(-nodes // FANOUT) * FANOUT
    return np.array(starts, np.int64)


@piece(**_FAST)
def _add_up(tree, row, first):
    total = 0.0
    for k in range(FANOUT):
        total += tree[row, first + k]
    return total


@piece
def _renew(tree, levels, rows, level, node):
    """Compute one node of every row from its children; `level` is that of the children."""
    for row in range(rows):
        tree[row, levels[level + 1] + node] = _add_up(tree, row, levels[level] + node * FANOUT)


@piece
def refresh(tree, levels, rows, a, b, c):
    """Bring the first `rows` rows up to date after a change of three slots, equal or not."""
    for level in range(levels.shape[0] - 1):
        a //= FANOUT
        b //= FANOUT
        c //= FANOUT
        _renew(tree, levels, rows, level, c)
        if a != c:
            _renew(tree, levels, rows, level, a)
        if b != c and b != a:
            _renew(tree, levels, rows, level, b)


@cold_piece
def build(tree, levels, rows):
    """Compute all nodes from the slots."""
    for level in range(levels.shape[0] - 1):
        end = levels[level + 2] if level + 2 < levels.shape[0] else tree.shape[1]
        children = levels[level + 1] - levels[level]
        for node in range(end - levels[level + 1]):
            if node * FANOUT < children:
                _renew(tree, levels, rows, level, node)


@piece
def find(tree, levels, row, x):
    """Find where the cumulative sum of the slots passes `x`; the slot, and what is left of `x`.

    Rounding may leave `x` beyond all children of a node: then it is the last that is not empty.
    """
    slot = np.int64(0)
    for level in range(levels.shape[0] - 2, -1, -1):
        first = levels[level] + slot * FANOUT
        chosen = np.int64(-1)
        for k in range(FANOUT):
            weight = tree[row, first + k]
            if weight > 0.0:
                chosen = np.int64(k)
                if x < weight:
                    break
                x -= weight
        else:
            x = tree[row, first + chosen]
        slot = slot * FANOUT + chosen
    return slot, x


@cold_piece
def find_mixed(tree, levels, rows, coefficients, x):
    """`find` in the sum of the rows times coefficients of any sign, in which no slot is negative.

    References
    ----------
    Osinsky, eq. (26).
    """
    slot = np.int64(0)
    for level in range(levels.shape[0] - 2, -1, -1):
        first = levels[level] + slot * FANOUT
        chosen, largest = np.int64(0), 0.0
        rest = x
        for k in range(FANOUT):
            weight = 0.0
            for row in range(rows):
                weight += coefficients[row] * tree[row, first + k]
            if weight > 0.0:
                chosen, largest = np.int64(k), weight
                if rest < weight:
                    break
                rest -= weight
        else:
            rest = largest
        x = rest
        slot = slot * FANOUT + chosen
    return slot, x
