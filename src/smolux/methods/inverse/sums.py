"""Cumulative sums over sizes, and searches in them."""

from __future__ import annotations

from smolux.jit.compile import piece

#: sums are kept for blocks of this many sizes: a search looks at blocks, then inside one
BLOCK = 32

#: sums may be reordered, so that they vectorise
_FAST = {"fastmath": {"reassoc", "contract", "nsz"}, "forceinline": False}


@piece(**_FAST)
def weigh(number, rates, row, block, top):
    """Add up ``number * rates[row]`` over blocks, and in all."""
    total = 0.0
    for b in range((top + BLOCK - 1) // BLOCK):
        x = 0.0
        for k in range(b * BLOCK, min((b + 1) * BLOCK, top)):
            x += number[k] * rates[row, k]
        block[b] = x
        total += x
    return total


@piece(**_FAST)
def shift(rate, table, i, j, gone, new, count, top):
    """Account for one event in the rates of all sizes: one traversal of three rows."""
    for k in range(top):
        rate[k] += count * table[new, k] - gone * (table[i, k] + table[j, k])


@piece
def find(number, rates, row, block, top, x):
    """Find where the cumulative sum of ``number * rates[row]`` passes `x`; -1 past the end."""
    for b in range((top + BLOCK - 1) // BLOCK):
        if x >= block[b]:
            x -= block[b]
            continue
        last = -1
        for k in range(b * BLOCK, min((b + 1) * BLOCK, top)):
            weight = number[k] * rates[row, k]
            if weight > 0.0:
                last = k
                if x < weight:
                    return k
                x -= weight
        return last
    return -1


@piece
def find_large(weights, stored, x):
    """Find where the cumulative sum of the first weights passes `x`; the last one past the end."""
    last = -1
    for d in range(stored):
        if weights[d] > 0.0:
            last = d
            if x < weights[d]:
                return d
            x -= weights[d]
    return last
