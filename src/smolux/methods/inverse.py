"""The inverse method (fast DSMC): both particles by cumulative sums, none rejected."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..core import rng
from ..core.compile import cold_piece, piece
from ..core.loop import Pieces, note_bad, note_largest
from ..core.state import (
    FIRST,
    LARGEST,
    PARTICLES,
    SECOND,
    SINCE,
    STORED,
    TRIALS,
    VALUE,
    VOLUME,
    State,
)
from ..core.sums import BLOCK, find, find_large, shift, weigh
from ..errors import InputError
from .base import Int, Method, Rates, enlarged, spread

#: events after which the sums are computed afresh, so that rounding does not pile up
_REFRESH = 1 << 16


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
    """

    number: np.ndarray
    rate: np.ndarray
    block: np.ndarray
    large: np.ndarray
    large_rate: np.ndarray
    table: np.ndarray


@piece
def _view(w, r):
    return Work(w.number[r], w.rate[r], w.block[r], w.large[r], w.large_rate[r], w.table)


@piece
def _top(s, w):
    return min(s.count[LARGEST], w.table.shape[1])


@piece
def _size(w, slot):
    buckets = w.table.shape[1]
    return np.int64(slot + 1) if slot < buckets else w.large[slot - buckets]


@piece
def _pair(s, w):
    return _size(w, s.count[FIRST]), _size(w, s.count[SECOND])


@cold_piece
def _lone(s, w, k):
    left, slot = float(k), 0
    while slot < w.table.shape[1]:
        if left < w.number[slot]:
            return np.int64(slot), np.int64(slot + 1)
        left -= w.number[slot]
        slot += 1
    place = slot + np.int64(left)
    return place, _size(w, place)


@piece
def _seize(s, w, place):
    s.count[FIRST] = place


@cold_piece
def _first(s, w, small, x):
    """Slot of the first particle, by its rate with all others."""
    top, buckets = _top(s, w), w.table.shape[1]
    if x < small:
        k = find(w.number, w.rate, 0, w.block, top, x)
        if k >= 0:
            return k
    d = find_large(w.large_rate, s.count[STORED], x - small)
    return buckets + d if d >= 0 else -1


@piece
def _remove(s, w, slot):
    buckets = w.table.shape[1]
    if slot < buckets:
        w.number[slot] -= 1.0
    else:
        s.count[STORED] -= 1
        w.large[slot - buckets] = w.large[s.count[STORED]]
        w.large_rate[slot - buckets] = w.large_rate[s.count[STORED]]
    s.count[PARTICLES] -= 1


@cold_piece
def _double(s, w):
    stored = s.count[STORED]
    if 2 * stored > w.large.shape[0]:
        return False
    for k in range(w.table.shape[1]):
        w.number[k] *= 2.0
    for d in range(stored):
        w.large[stored + d] = w.large[d]
    s.count[STORED] *= 2
    s.count[PARTICLES] *= 2
    s.count[SINCE] = 0
    return True


@lru_cache(maxsize=64)
def _make_visit(tally: Any) -> Any:
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


def _make_rates(rate: Any) -> tuple[Any, Any, Any, Any]:
    @piece
    def pair_rate(s, w, i, j, met, p):
        """Rate of two sizes; 0 where the kernel gives none, which is noted if they have `met`."""
        if i <= w.table.shape[1] and j <= w.table.shape[1]:
            return w.table[i - 1, j - 1]
        value = rate(float(i), float(j), *p)
        if 0.0 <= value < math.inf:
            return value
        if met:
            note_bad(s, i, j, value)
        return 0.0

    @cold_piece
    def row_of(s, w, scratch, size, top, p):
        """Row of the table with the rates of `size` with the sizes ``1 .. top``."""
        buckets = w.table.shape[1]
        if size <= buckets:
            return size - 1
        row = buckets + scratch
        for k in range(top):
            w.table[row, k] = pair_rate(s, w, np.int64(k + 1), size, w.number[k] > 0.0, p)
        return np.int64(row)

    @cold_piece
    def own_rate(s, w, size, d, p):
        """Rate of a particle with all others: a large one in place `d`, or one of a bucket (-1)."""
        top = _top(s, w)
        total = weigh(w.number, w.table, row_of(s, w, 0, size, top, p), w.block, top)
        met = d >= 0 or w.number[size - 1] > 0.0
        for k in range(s.count[STORED]):
            if k != d:
                total += pair_rate(s, w, size, w.large[k], met, p)
        return total if d >= 0 else total - w.table[size - 1, size - 1]

    @cold_piece
    def look(s, w, size):
        """Note a pair of buckets that are present for which the kernel gives no rate."""
        row = w.table.shape[1] + 2 + size
        if w.number[size - 1] > 0.0:
            for k in range(_top(s, w)):
                others = w.number[k] - (1.0 if k == size - 1 else 0.0)
                if others > 0.0 and not 0.0 <= w.table[row, k] < math.inf:
                    note_bad(s, size, np.int64(k + 1), w.table[row, k])

    return pair_rate, row_of, own_rate, look


def _make_draw(pair_rate: Any, row_of: Any) -> Any:
    @cold_piece
    def second(s, w, a, p):
        """Slot of the second particle, by its rate with the first, which is left out."""
        top, buckets, stored = _top(s, w), w.table.shape[1], s.count[STORED]
        size = _size(w, a)
        row = row_of(s, w, 0, size, top, p)
        if a < buckets:
            w.number[a] -= 1.0
        small = weigh(w.number, w.table, row, w.block, top)
        large = 0.0
        for d in range(stored):
            if buckets + d != a:
                large += pair_rate(s, w, size, w.large[d], True, p)
        x = rng.uniform(s.rng) * (small + large)
        slot = find(w.number, w.table, row, w.block, top, x) if x < small else -1
        if slot < 0:
            x -= small
            for d in range(stored):
                weight = pair_rate(s, w, size, w.large[d], False, p)
                if buckets + d != a and weight > 0.0:
                    slot = buckets + d
                    if x < weight:
                        break
                    x -= weight
        if a < buckets:
            w.number[a] += 1.0
        return slot

    @cold_piece
    def draw(s, w, p, factor):
        s.count[FIRST] = -1
        s.count[TRIALS] += 1
        if not 0.0 <= s.clock[VALUE] < math.inf:
            return math.nan
        small = weigh(w.number, w.rate, 0, w.block, _top(s, w))
        large = 0.0
        for d in range(s.count[STORED]):
            large += w.large_rate[d]
        total = small + large
        if s.count[PARTICLES] < 2 or total <= 0.0:
            return math.inf
        wait = rng.exponential(s.rng) * 2.0 * s.clock[VOLUME] / (total * factor)
        a = _first(s, w, small, rng.uniform(s.rng) * total)
        if a >= 0:
            b = second(s, w, a, p)
            if b >= 0:
                s.count[FIRST], s.count[SECOND] = a, b
        return wait

    return draw


def _make_update(pair_rate: Any, row_of: Any, own_rate: Any, look: Any) -> Any:
    @cold_piece
    def account(s, w, i, j, gone, size, count, p):
        """Account in all rates for `gone` of `i` and `j` each and `count` new ones of `size`."""
        top = _top(s, w)
        shift(
            w.rate[0],
            w.table,
            row_of(s, w, 0, i, top, p),
            row_of(s, w, 1, j, top, p),
            gone,
            row_of(s, w, 2, size, top, p),
            float(count),
            top,
        )
        for d in range(s.count[STORED]):
            large = w.large[d]
            w.large_rate[d] += count * pair_rate(s, w, size, large, True, p) - gone * (
                pair_rate(s, w, i, large, False, p) + pair_rate(s, w, j, large, False, p)
            )

    @cold_piece
    def arrive(s, w, size, count, p):
        """Put `count` particles of `size` in, the rates of all others being up to date."""
        buckets = w.table.shape[1]
        s.count[PARTICLES] += count
        if size <= buckets:
            w.number[size - 1] += count
            if w.table.shape[0] > buckets + 3:
                look(s, w, size)
            return
        first = s.count[STORED]
        for d in range(first, first + count):
            w.large[d] = size
        s.count[STORED] += count
        own = own_rate(s, w, size, first, p)
        for d in range(first, first + count):
            w.large_rate[d] = own

    @cold_piece
    def reach(s, w, size, p):
        """Raise the largest size to which rates are kept."""
        old = _top(s, w)
        note_largest(s, size)
        for k in range(old, _top(s, w)):
            w.rate[0, k] = 0.0
        for k in range(old, _top(s, w)):
            w.rate[0, k] = own_rate(s, w, np.int64(k + 1), -1, p)

    @cold_piece
    def update(s, w, gone, entries, p):
        if entries == 0:  # what is gone is accounted for beside what appears
            s.sizes[0], s.counts[0] = 1, 0
            entries = 1
        buckets = w.table.shape[1]
        needed = 0
        for e in range(entries):
            if s.sizes[e] > buckets:
                needed += s.counts[e]
        if s.count[STORED] + needed > w.large.shape[0]:
            return False
        for e in range(entries):
            reach(s, w, s.sizes[e], p)
        a, b = s.count[FIRST], s.count[SECOND]
        i = j = np.int64(1)
        if gone == 3:
            i, j = _pair(s, w)
            # the last large particle moves into a gap: the later slot first, so the other stays
            _remove(s, w, max(a, b))
            _remove(s, w, min(a, b))
        elif gone > 0:
            one = a if gone == 1 else b
            i = j = _size(w, one)
            _remove(s, w, one)
        # of both; half of either if it is one
        share = 1.0 if gone == 3 else 0.5 if gone > 0 else 0.0
        for e in range(entries):
            account(s, w, i, j, share if e == 0 else 0.0, s.sizes[e], s.counts[e], p)
            arrive(s, w, s.sizes[e], s.counts[e], p)
        return True

    return update


def _make_prepare(own_rate: Any, look: Any) -> Any:
    @cold_piece
    def renew(s, w, p):
        """Compute every rate afresh, and the largest size."""
        largest = np.int64(0)
        for k in range(w.table.shape[1]):
            if w.number[k] > 0.0:
                largest = np.int64(k + 1)
        for d in range(s.count[STORED]):
            largest = max(largest, w.large[d])
        s.count[LARGEST] = largest
        for k in range(_top(s, w)):
            w.rate[0, k] = own_rate(s, w, np.int64(k + 1), -1, p)
            if w.table.shape[0] > w.table.shape[1] + 3:
                look(s, w, np.int64(k + 1))
        for d in range(s.count[STORED]):
            w.large_rate[d] = own_rate(s, w, w.large[d], d, p)
        s.count[SINCE] = 1

    @piece
    def prepare(s, w, p):
        if s.count[SINCE] == 0 or s.count[SINCE] > _REFRESH:
            renew(s, w, p)
        return 0

    return prepare


@dataclass(frozen=True)
class Inverse(Method):
    """Choose the first particle by its rate with all others, the second by its rate with the first.

    Particles of sizes up to `buckets` are counted by size with one rate a size; larger ones are
    held singly. An event costs a few traversals of the sizes present, and none is rejected.

    Parameters
    ----------
    buckets : int
        The size B up to which particles are grouped.

    References
    ----------
    F. E. Kruis, A. Maisels, H. Fissan, AIChE J. 46, 1735 (2000), doi:10.1002/aic.690460905;
    Kalinov et al., Algorithms 2 and 4 and section 4.
    """

    buckets: int = 1024

    name: ClassVar[str] = "inverse"
    title: ClassVar[str] = "inverse (fast DSMC)"
    reference: ClassVar[str] = "F. E. Kruis, A. Maisels, H. Fissan, AIChE J. 46, 1735 (2000)"

    work_type: ClassVar[type] = Work

    @staticmethod
    def bind(rate: Any, tally: Any) -> Pieces:
        """See `Method.bind`."""
        pair_rate, row_of, own_rate, look = _make_rates(rate)
        return Pieces(
            _view,
            _make_draw(pair_rate, row_of),
            _pair,
            _make_update(pair_rate, row_of, own_rate, look),
            _make_prepare(own_rate, look),
            _double,
            _lone,
            _seize,
            _make_visit(tally),
        )

    def __post_init__(self) -> None:
        if not (isinstance(self.buckets, (int, np.integer)) and self.buckets >= 1):
            raise InputError(f"buckets = {self.buckets!r}: must be a whole number of at least 1")

    def new_work(
        self, rates: Rates, populations: list[tuple[Int, Int]], state: State, mass: int
    ) -> Work:
        """See `Method.new_work`."""
        replicas = len(populations)
        # no size can exceed the mass, so small systems need few buckets
        buckets = min(self.buckets, max(BLOCK, 2 * mass))
        number = np.zeros((replicas, buckets))
        # how many of the sizes, which ascend, have a bucket
        held = [int(np.searchsorted(sizes, buckets, side="right")) for sizes, _ in populations]
        stored = [int(c[h:].sum()) for h, (_, c) in zip(held, populations, strict=True)]
        large = np.zeros((replicas, max(*stored, 8) * 2), np.int64)
        for r, (sizes, counts) in enumerate(populations):
            number[r, sizes[: held[r]] - 1] = counts[: held[r]]
            if stored[r]:
                spread(sizes[held[r] :], counts[held[r] :], large[r, : stored[r]])
        count = state.count
        count[:, STORED] = stored
        count[:, PARTICLES] = [counts.sum() for _, counts in populations]
        count[:, LARGEST] = [sizes[-1] for sizes, _ in populations]
        given = rates.table(buckets)
        valid = (given >= 0.0) & (given < np.inf)
        table = np.vstack((np.where(valid, given, 0.0), np.zeros((3, buckets))))
        return Work(
            number,
            np.zeros((replicas, 1, buckets)),
            np.zeros((replicas, -(-buckets // BLOCK))),
            large,
            np.zeros(large.shape),
            table if valid.all() else np.vstack((table, given)),
        )

    def grow(self, work: Work, state: State) -> Work:
        """See `Method.grow`."""
        capacity = 2 * work.large.shape[1]
        return work._replace(
            large=enlarged(work.large, capacity), large_rate=enlarged(work.large_rate, capacity)
        )

    def population(self, work: Work, state: State, replica: int) -> tuple[Int, Int]:
        """See `Method.population`."""
        number = work.number[replica]
        small = np.flatnonzero(number)
        large, counts = np.unique(
            work.large[replica, : state.count[replica, STORED]], return_counts=True
        )
        return (
            np.concatenate((small + 1, large)).astype(np.int64),
            np.concatenate((number[small], counts)).astype(np.int64),
        )

    def bytes_per_replica(self, particles: int) -> int:
        """See `Method.bytes_per_replica`."""
        return 8 * 6 * self.buckets
