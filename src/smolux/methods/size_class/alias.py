"""Alias tables: a number of a given law from one uniform number, whatever the law.

References
----------
M. D. Vose, IEEE Trans. Softw. Eng. 17, 972 (1991), doi:10.1109/32.92917.
"""

from __future__ import annotations

import numpy as np

from smolux.jit.compile import cold_piece, piece
from smolux.jit.wide import upper_half

_HALF, _LOWER = np.uint64(32), np.uint64((1 << 32) - 1)
_WORD, _UPPER = 2.0**64, 2.0**32
_BELOW_ONE = 1.0 - 2.0**-53


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


@cold_piece
def pack(n, share, alias, code, sure, table):
    """Write a table for `draw`: for each column, what a choice reads, side by side.

    Outcomes are known by ``code[k]`` (32 bits); ``sure[k]`` is the probability, or less, that they
    are accepted whatever they turn out to be. The three words of a column are the share it keeps,
    the codes of its own outcome and of its alias, and below which remainder each of them is sure
    to be accepted, 32 bits each.
    """
    for k in range(n):
        other, kept = alias[k], min(share[k], 1.0)
        table[3 * k] = _fixed(kept, _WORD)
        table[3 * k + 1] = (np.uint64(code[k]) << _HALF) | np.uint64(code[other])
        own = _fixed(kept * sure[k], _UPPER)
        its = _fixed(kept + (1.0 - kept) * sure[other], _UPPER)
        table[3 * k + 2] = (own << _HALF) | its


@piece
def _fixed(x, scale):
    """Turn a number in [0, 1] into whole parts of `scale`, rounded down, less than all of them."""
    return np.uint64(min(x * scale, scale * _BELOW_ONE))


@piece
def draw(table, n, word):
    """Draw from a table of `n` columns by 64 random bits.

    Returns
    -------
    code : uint64
        Of the outcome.
    column, rest : uint64
        Of the table, and what is left of the random bits, for `remainder`.
    sure : bool
        Whether it is accepted at once.
    """
    column, rest = upper_half(word, n), word * n
    first = np.uint64(3) * column
    both, limits = table[first + np.uint64(1)], table[first + np.uint64(2)]
    # a choice costs less than a branch
    shift = _HALF if rest < table[first] else np.uint64(0)
    code = (both >> shift) & _LOWER
    return code, column, rest, rest >> _HALF < (limits >> shift) & _LOWER


@piece
def remainder(table, column, rest):
    """Uniform number in [0, 1) given the outcome: where in its part of the column the draw fell."""
    share = table[np.uint64(3) * column]
    if rest < share:
        return float(rest) / float(share)
    return float(rest - share) / (_WORD - float(share))
