"""Segment trees: sums of weights over slots, in which a slot is found by its place in the total.

Weights are whole numbers, so sums are exact: differences are added along the path to the root,
nothing drifts, and the sums depend neither on the order of events nor on empty slots at the end. A
tree has one row for each kind of weight; a node is the sum of its four children.

References
----------
A. I. Osinsky, Low-rank Monte Carlo for Smoluchowski-class equations, arXiv:2312.02788 (2023),
section 3.
"""

from __future__ import annotations

import numpy as np

from smolux.jit.compile import cold_piece, piece

#: children of a node; with more, an event adds to fewer sums, and looks at more of them
FANOUT = 4


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


@piece
def add(tree, levels, row, slots, weights):
    """Add to the weights of three slots, equal or not, in one row."""
    a, b, c = slots
    x, y, z = weights
    for level in range(levels.shape[0] - 1):
        # unsigned: an index that may be negative costs a comparison
        first = levels[level]
        tree[row, np.uintp(first + a)] += x
        tree[row, np.uintp(first + b)] += y
        tree[row, np.uintp(first + c)] += z
        a //= FANOUT
        b //= FANOUT
        c //= FANOUT
    tree[row, tree.shape[1] - 1] += x + y + z


@cold_piece
def build(tree, levels, row):
    """Compute the nodes of one row from the slots."""
    tree[row, levels[1] :] = 0
    for level in range(levels.shape[0] - 1):
        for k in range(levels[level + 1] - levels[level]):
            tree[row, levels[level + 1] + k // FANOUT] += tree[row, levels[level] + k]


@piece
def find(tree, levels, row, x):
    """Find where the cumulative sum of a row passes `x`, ``0 <= x < root``.

    Returns the slot, and by how much `x` is above the sum of those before it. No branch depends on
    the weights: which child it is, no processor can predict.
    """
    slot = np.int64(0)
    for level in range(levels.shape[0] - 2, -1, -1):
        first = levels[level] + slot * FANOUT
        one = tree[row, np.uintp(first)]
        two = one + tree[row, np.uintp(first + 1)]
        three = two + tree[row, np.uintp(first + 2)]
        before = one if x >= one else np.int64(0)
        before = two if x >= two else before
        before = three if x >= three else before
        slot = slot * FANOUT + (x >= one) + (x >= two) + (x >= three)
        x -= before
    return slot, x


@cold_piece
def find_mixed(tree, levels, rows, coefficients, x):
    """`find` in the sum of the rows times coefficients of any sign, in which no slot is negative.

    Rounding may leave `x` beyond all children of a node: then it is the last that is not empty.

    References
    ----------
    Osinsky, eq. (26).
    """
    slot = np.int64(0)
    for level in range(levels.shape[0] - 2, -1, -1):
        first = levels[level] + slot * FANOUT
        child, rest = np.int64(0), 0.0
        for k in range(FANOUT):
            weight = 0.0
            for row in range(rows):
                weight += coefficients[row] * tree[row, first + k]
            if weight > 0.0:
                child, rest = np.int64(k), min(x, weight)
                if x < weight:
                    break
                x -= weight
        x = rest
        slot = slot * FANOUT + child
    return slot, x
