"""Alias tables: a number of a given law from one uniform number, whatever the law.

References
----------
M. D. Vose, IEEE Trans. Softw. Eng. 17, 972 (1991), doi:10.1109/32.92917.
"""

from __future__ import annotations

import numpy as np

from .compile import at, cold_piece, piece


@cold_piece
def build(weights, total, share, alias, queue):
    """Fill `share` and `alias` for ``P(k) = weights[k] / total``; `queue` is scratch.

    All arrays have one entry for each outcome. A column keeps its own outcome with the probability
    ``share`` and gives `alias` else.
    """
    n = weights.shape[0]
    scale = n / total
    low, high = 0, n
    for k in range(n):
        share[k] = weights[k] * scale
        alias[k] = k
        if share[k] < 1.0:
            queue[low] = k
            low += 1
        else:
            high -= 1
            queue[high] = k
    # the queue holds columns to be filled from its start on, those with a surplus at its end
    first = 0
    while first < low and high < n:
        poor, rich = queue[first], queue[high]
        first += 1
        alias[poor] = rich
        share[rich] -= 1.0 - share[poor]
        if share[rich] < 1.0:
            high += 1
            queue[low] = rich
            low += 1
    # what rounding has left over at one end gives itself in any case
    for k in range(first, low):
        share[queue[k]] = 1.0
    for k in range(high, n):
        share[queue[k]] = 1.0


@piece
def outcome(share, either, n, x):
    """Outcome of a table of `n` columns for a uniform number.

    `either` has for each column its own outcome in the upper half and that of its alias in the
    lower one: both are there with one read, and a choice costs less than a branch.
    """
    x *= n
    k = np.int64(x)
    both = either[at(k)]
    return both >> 32 if x - k < share[at(k)] else both & 0xFFFFFFFF
