"""Breakage in two: the rate of a size, and the split drawn from its own law.

A size k has the splits ``i + (k - i)`` for i up to half of k. They lie in bins that double in width
from both ends, as laws of breakage change fastest where a fragment is small, or where both are
nearly equal. Of small sizes all splits are gone through once, when the size first occurs: the rate
is then exact, and every bin has the largest rate of its splits. Larger sizes have bounds for slots
of sizes, asked for octave by octave, and a split that is drawn may come to nothing. Up to the size
`EXACT` this is so only where bounds are proved and so close that it is rare, as they hold for all
laws that are smooth. Above, where nearly all would, as with a law that is not zero for halves only,
the sizes of a slot are gone through as well, and the latest are remembered.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from smolux.jit.compile import cold_piece, piece, user_piece

from . import rng
from .bounds import ROUNDING, note_bad
from .slots import octave, slot_of, slot_top
from .state import COUNTED, RAISED, SPLIT_IN_DOUBT, TRIALS, UNARY_BITS, UNARY_SLOTS

#: largest sizes of which all splits are gone through: in any case, where bounds are not proved and
#: close, and in slots of narrow laws
_SMALL, EXACT, _LARGEST = 1 << 10, 1 << 14, 1 << 26
#: how many of these are remembered, as a power of two, and what spreads them over their rows
_KEPT_BITS = 10
_SPREAD = np.uint64(0x9E3779B97F4A7C15)
#: bins of any size, at most
_BINS = 2 * 62
#: the slots of `_SMALL` and `EXACT`
_FIRST, _PROVED = (10 - UNARY_BITS + 1) << UNARY_BITS, (14 - UNARY_BITS + 1) << UNARY_BITS
#: shares of candidates that come to something, below which bounds are not close, a law is narrow
_CLOSE, _NARROW = 1 / 2, 1 / 32


class Splits(NamedTuple):
    """What is known of one law of breakage; filled as sizes occur, and the same for all replicas.

    Attributes
    ----------
    size : int64 array of shape (rows,)
        Whose row it is: those up to `EXACT` in order, then larger ones; 0 if nobody's yet.
    total : float64 array of shape (rows,)
        Rate of that size, NaN if a split has none.
    ends : float64 array of shape (rows, bins)
        Cumulative sum over the bins of the largest rate in each times its splits.
    bounds : float64 array of shape (slots, bins)
        The same for the larger sizes of a slot, from bounds; -1 in the first bin of a slot that is
        not asked for yet.
    narrow : bool array of shape (slots,)
        Whether its sizes have rows of their own.
    """

    size: np.ndarray
    total: np.ndarray
    ends: np.ndarray
    bounds: np.ndarray
    narrow: np.ndarray


def new_splits(proved: bool) -> Splits:
    """Return tables of which nothing is known; memory is taken as they are filled.

    Unless bounds of the law can be `proved`, none are asked for up to `EXACT`.
    """
    rows, slots = EXACT + 1 + (1 << _KEPT_BITS), UNARY_SLOTS - _FIRST
    bounds, narrow = np.zeros((slots, _BINS)), np.zeros(slots, np.bool_)
    first = 0 if proved else _PROVED - _FIRST
    narrow[:first], bounds[first:, 0] = True, -1.0
    size, total = np.zeros(rows, np.int64), np.zeros(rows)
    return Splits(size, total, np.zeros((rows, _BINS)), bounds, narrow)


def slots_beside(size: int) -> slice:
    """Return the slots of the octave of a size."""
    first = (int(size).bit_length() - UNARY_BITS) << UNARY_BITS
    return slice(first, first + (1 << UNARY_BITS))


def fill(splits: Splits, slots: slice, bounds: Any, widths: Any, means: Any, proved: Any) -> None:
    """Take in bounds for the bins of slots, the splits in each, mean rates, and what is proved."""
    rows = slice(slots.start - _FIRST, slots.stop - _FIRST)
    each = bounds * widths
    splits.bounds[rows, : each.shape[1]] = np.cumsum(each, axis=1)
    least = _NARROW if slots.start >= _PROVED else np.where(proved, _CLOSE, np.inf)
    # a law that is zero everywhere is no narrow one
    splits.narrow[rows] = (means * widths).sum(axis=1) < least * each.sum(axis=1)


@piece
def bins_of(k):
    """Bins of a size from 2 on."""
    return 2 * octave(k) - 1


@piece
def width_of(k, b):
    """Most splits that a bin has for a size in the slot of k."""
    return stretch(slot_top(slot_of(k, np.int64(UNARY_BITS)), np.int64(UNARY_BITS)), b)[1]


@piece
def stretch(k, b):
    """First of the splits in a bin, by the smaller fragment, and how many there are.

    From the small end 1, 2 and 3, 4 to 7 and so on up to a quarter of k; then half of k, and down
    from there 1, 2 and 3, 4 to 7 and so on below it.
    """
    half = k // 2
    quarter = max(half // 2, np.int64(1))
    low = max(octave(k) - 1, np.int64(1))
    if b < low:
        first = np.int64(1) << b
        return first, min(2 * first - 1, quarter) - first + 1
    if b == low:
        return half, np.int64(1)
    below = np.int64(1) << (b - low - 1)
    last = min(2 * below - 1, half - quarter - 1)
    return half - last, max(last - below + 1, np.int64(0))


def bind_splits(rate: Callable[..., Any]) -> tuple[Any, Any, Any]:
    """Bind what a law of breakage ``rate(i, j, *parameters)`` needs.

    Returns
    -------
    total : ``total(size, s, q)``
        Rate of a size, or a bound of it; NaN if it has none.
    known : ``known(size, q)``
        Whether that can be told.
    part : ``part(size, s, q)``
        One of both fragments, drawn; 0 if it came to nothing, -1 if its rate is none, as noted.
    """
    law = user_piece(rate)

    @piece
    def weight(k, i, q):
        value = float(law(float(i), float(k - i), *q[0]))
        # of equal fragments there is one split, not two
        return 0.5 * value if 2 * i == k else value

    @cold_piece
    def learn(k, row, q):
        """Go through all splits of a size."""
        total = upto = 0.0
        for b in range(bins_of(k)):
            first, count = stretch(k, b)
            most = 0.0
            for i in range(first, first + count):
                value = weight(k, i, q)
                if not 0.0 <= value < math.inf:
                    total = math.nan
                total += value
                most = max(most, value)
            upto += count * most
            q[1].ends[row, b] = upto
        q[1].size[row], q[1].total[row] = k, total

    @piece
    def row_of(k, q):
        """Row of a size, or -1 if it has none."""
        row = k
        if k > _SMALL and not q[1].narrow[slot_of(k, np.int64(UNARY_BITS)) - _FIRST]:
            return np.int64(-1)
        if k > EXACT:
            if k > _LARGEST:
                return np.int64(-1)
            # by the leading bits of a product: halves of a size must not share a row
            row = EXACT + 1 + np.int64((np.uint64(k) * _SPREAD) >> np.uint64(64 - _KEPT_BITS))
        if q[1].size[row] != k:
            learn(k, row, q)
        return row

    @piece
    def end(k, row, b, q):
        """Cumulative sum of the bounds up to a bin."""
        if row >= 0:
            return q[1].ends[row, b]
        return q[1].bounds[slot_of(k, np.int64(UNARY_BITS)) - _FIRST, b]

    @cold_piece
    def total(size, s, q):
        if size < 2:
            return 0.0
        row = row_of(size, q)
        if row >= 0:
            return q[1].total[row]
        return (1.0 + s.clock[RAISED]) * end(size, row, bins_of(size) - 1, q)

    @piece
    def known(size, q):
        return size <= _SMALL or q[1].bounds[slot_of(size, np.int64(UNARY_BITS)) - _FIRST, 0] >= 0.0

    @piece
    def candidate(s, k, row, q):
        """Split, by the bounds of the bins, and the bound of it; 0 if there is none there."""
        b, low = bins_of(k) - 1, max(octave(k) - 1, np.int64(1))
        x = rng.uniform(s.rng) * end(k, row, b, q)
        if x < end(k, row, low, q):
            b, low = low, np.int64(-1)
        # down from the widest: most splits of most laws are there
        while b > low + 1 and x < end(k, row, b - 1, q):
            b -= 1
        before = end(k, row, b - 1, q) if b > 0 else 0.0
        first, count = stretch(k, b)
        width = count if row >= 0 else width_of(k, b)
        each = (end(k, row, b, q) - before) / width
        place = min(np.int64((x - before) / each), width - 1)
        return first + place if place < count else np.int64(0), each

    @piece
    def part(size, s, q):
        row = row_of(size, q)
        raised = 1.0 if row >= 0 else 1.0 + s.clock[RAISED]
        while True:
            i, limit = candidate(s, size, row, q)
            value = weight(size, i, q) if i > 0 else 0.0
            if not 0.0 <= value < math.inf:
                note_bad(s, i, size - i, value)
                return np.int64(-1)
            if value > limit * raised * ROUNDING and row < 0:  # bounds found by trial only
                s.missed[SPLIT_IN_DOUBT] = value / (limit * raised) - 1.0
                s.clock[RAISED] = max(s.clock[RAISED], 1.1 * value / limit - 1.0)
                s.held[COUNTED] = 0  # the rates of all sizes above are to be summed afresh
            if rng.uniform(s.rng) * limit * raised < value:
                return i
            if row < 0:
                return np.int64(0)
            s.count[TRIALS] += 1

    return total, known, part
