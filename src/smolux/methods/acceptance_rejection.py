"""Acceptance-rejection: pairs of equal chance, thinned by the rate over its bound."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..core import rng
from ..core.compile import cold_piece, piece
from ..core.levels import level_edges, level_of, renew_majorant
from ..core.loop import Pieces, note_bad, note_largest, repair
from ..core.prefetch import prefetch
from ..core.state import (
    FIRST,
    FLOOR,
    LARGEST,
    MAJORANT,
    MONOMERS,
    PARTICLES,
    SECOND,
    SINCE,
    SMALLEST,
    STORED,
    TIME,
    TRIALS,
    VALUE,
    VOLUME,
    WORST_I,
    WORST_J,
    State,
)
from ..errors import InputError
from .base import Int, Method, Rates, enlarged, spread

#: candidates looked at before the loop may return without an event
_PATIENCE = 4096
#: candidates whose pairs are drawn ahead, so that their memory is there when it is needed
_AHEAD = 8
#: rates of sizes up to this are tabulated when computing one costs more than reading it
_TABLE = 192


class Work(NamedTuple):
    """Monomers are only counted (``count[MONOMERS]``); all other particles lie in one array.

    Attributes
    ----------
    sizes : int64 array of shape (R, capacity)
        The first ``count[STORED]`` entries are the particles of sizes above 1.
    ahead : float64 array of shape (R, 16)
        Uniform numbers that choose the pairs of the next candidates; -1 before the first.
    level : int64 array of shape (R, 2)
        Levels that the bound in force covers.
    edges, majorant, table : arrays
        Edges of levels; bound for each pair of levels, NaN until asked for; rates of small sizes.
    """

    sizes: np.ndarray
    ahead: np.ndarray
    level: np.ndarray
    edges: np.ndarray
    majorant: np.ndarray
    table: np.ndarray


@piece
def _view(w, r):
    return Work(w.sizes[r], w.ahead[r], w.level[r], w.edges, w.majorant, w.table)


@piece
def _size(s, w, slot):
    # read first, choose then: which kind comes is a coin toss that no branch predictor wins
    place = slot - s.count[MONOMERS]
    size = w.sizes[max(place, 0)]
    return size if place >= 0 else np.int64(1)


@piece
def _pair(s, w):
    return _size(s, w, s.count[FIRST]), _size(s, w, s.count[SECOND])


@piece
def _lone(s, w, k):
    return k, _size(s, w, k)


@piece
def _seize(s, w, place):
    s.count[FIRST] = place


@piece
def _look_ahead(s, w, k):
    """Draw the pair of a later candidate and ask for its memory.

    The number of particles will have changed by a few when its turn comes, which leaves the place
    within the same stretch of memory.
    """
    for m in range(k, k + 2):
        w.ahead[m] = rng.uniform(s.rng)
        place = np.int64(w.ahead[m] * s.count[PARTICLES]) - s.count[MONOMERS]
        prefetch(w.sizes, max(place, 0))


def _make_draw(rate: Any) -> Any:
    @piece
    def value_of(w, i, j, p):
        n = w.table.shape[0]
        if i <= n and j <= n:
            return w.table[i - 1, j - 1]
        return rate(float(i), float(j), *p)

    @piece
    def draw(s, w, p, factor):
        n = s.count[PARTICLES]
        s.count[FIRST] = -1
        majorant = s.clock[MAJORANT]
        if n < 2:
            return math.inf
        if majorant <= 0.0:
            return math.inf if s.clock[VALUE] == 0.0 else math.nan
        if w.ahead[0] < 0.0:
            for k in range(0, 2 * _AHEAD, 2):
                _look_ahead(s, w, k)
        wait = 0.0
        for trial in range(s.count[TRIALS], s.count[TRIALS] + _PATIENCE):
            s.count[TRIALS] += 1
            wait += rng.exponential(s.rng)
            k = 2 * (trial % _AHEAD)
            a, b = np.int64(w.ahead[k] * n), np.int64(w.ahead[k + 1] * (n - 1))
            b += b >= a
            _look_ahead(s, w, k)
            i, j = _size(s, w, a), _size(s, w, b)
            value = value_of(w, i, j, p)
            if not 0.0 <= value <= majorant:
                if not 0.0 <= value < math.inf:
                    note_bad(s, i, j, value)
                    return math.nan
                repair(s, i, j, value)
            if value >= majorant or rng.uniform(s.rng) * majorant < value:
                s.count[FIRST], s.count[SECOND] = a, b
                break
        return wait * 2.0 * s.clock[VOLUME] / (float(n) * float(n - 1) * majorant * factor)

    return draw


@piece
def _remove(s, w, slot):
    """Take a particle out: the last of its kind moves into the gap."""
    place = slot - s.count[MONOMERS]
    stored = np.int64(place >= 0)
    last = s.count[STORED] - stored
    s.count[MONOMERS] -= 1 - stored
    s.count[STORED] = last
    # for a monomer, the entry past the end is written over itself
    w.sizes[place if stored else last] = w.sizes[last]


@piece
def _insert(s, w, size, count):
    s.count[PARTICLES] += count
    s.count[SMALLEST] = min(s.count[SMALLEST], size)
    note_largest(s, size)
    if size == 1:
        s.count[MONOMERS] += count
        return
    stored = s.count[STORED]
    w.sizes[stored] = size
    for k in range(1, count):
        w.sizes[stored + k] = size
    s.count[STORED] = stored + count


@piece
def _update(s, w, gone, entries, p):
    needed = np.int64(1)
    for e in range(entries):
        needed += s.counts[e] if s.sizes[e] > 1 else 0
    if s.count[STORED] + needed > w.sizes.shape[0]:
        return False
    a, b = s.count[FIRST], s.count[SECOND]
    if gone == 3:
        # monomers are numbered first: taking the later slot first keeps the number of the other
        _remove(s, w, max(a, b))
        _remove(s, w, min(a, b))
        s.count[PARTICLES] -= 2
    elif gone > 0:
        _remove(s, w, a if gone == 1 else b)
        s.count[PARTICLES] -= 1
    for e in range(entries):
        _insert(s, w, s.sizes[e], s.counts[e])
    return True


@cold_piece
def _rescan(s, w):
    """Take the smallest and largest size afresh; the bound in force is then renewed."""
    s.count[SINCE] = 0
    low = np.int64(1) if s.count[MONOMERS] > 0 else max(w.sizes[0], np.int64(1))
    high = low
    for k in range(s.count[STORED]):
        low = min(low, w.sizes[k])
        high = max(high, w.sizes[k])
    s.count[SMALLEST], s.count[LARGEST] = low, high
    w.level[0], w.level[1] = w.edges.shape[0] - 2, 0


@piece
def _prepare(s, w, p):
    if s.count[SINCE] > s.count[PARTICLES] + 64:
        _rescan(s, w)
    s.clock[MAJORANT] = max(s.clock[MAJORANT], s.clock[FLOOR])
    return renew_majorant(s, w.edges, w.majorant, w.level)


@cold_piece
def _double(s, w):
    stored = s.count[STORED]
    if 2 * stored >= w.sizes.shape[0]:
        return False
    for k in range(stored):
        w.sizes[stored + k] = w.sizes[k]
    s.count[STORED] *= 2
    s.count[MONOMERS] *= 2
    s.count[PARTICLES] *= 2
    return True


def _make_visit(tally: Any) -> Any:
    @cold_piece
    def visit(s, w, t, grid, p):
        largest = np.int64(0)
        if s.count[MONOMERS] > 0:
            tally(t, grid, np.int64(1), s.count[MONOMERS], p)
            largest = np.int64(1)
        for k in range(s.count[STORED]):
            tally(t, grid, w.sizes[k], 1, p)
            largest = max(largest, w.sizes[k])
        return largest

    return visit


@dataclass(frozen=True)
class AcceptanceRejection(Method):
    """Draw pairs with equal chance; accept with probability ``K(i, j) / K_max``.

    ``K_max`` bounds the kernel over the pairs of sizes present. The cost of an event is the
    inverse of the mean acceptance; the monomers of a shattering event are only counted.

    References
    ----------
    A. L. Garcia et al., Physica A 143, 535 (1987), doi:10.1016/0378-4371(87)90205-5;
    Kalinov et al., Algorithms 1 and 3.
    """

    name: ClassVar[str] = "acceptance-rejection"
    title: ClassVar[str] = "acceptance-rejection"
    reference: ClassVar[str] = "A. L. Garcia et al., Physica A 143, 535 (1987)"

    work_type: ClassVar[type] = Work

    @staticmethod
    def bind(rate: Any, tally: Any) -> Pieces:
        """See `Method.bind`."""
        visit = _make_visit(tally)
        return Pieces(
            _view, _make_draw(rate), _pair, _update, _prepare, _double, _lone, _seize, visit
        )

    def new_work(
        self, rates: Rates, populations: list[tuple[Int, Int]], state: State, mass: int
    ) -> Work:
        """See `Method.new_work`."""
        total = np.array([counts.sum() for _, counts in populations])
        monomers = np.array([c[0] if s[0] == 1 else 0 for s, c in populations])
        stored = total - monomers
        # enough without growth: half of the monomers merge in pairs
        capacity = int(np.maximum(stored, total // 2).max())
        array = np.zeros((len(populations), capacity + 8), np.int64)
        for r in np.flatnonzero(stored):
            sizes, counts = populations[r]
            first = int(sizes[0] == 1)
            spread(sizes[first:], counts[first:], array[r, : stored[r]])
        count = state.count
        count[:, MONOMERS], count[:, STORED], count[:, PARTICLES] = monomers, stored, total
        count[:, SMALLEST] = [sizes[0] for sizes, _ in populations]
        count[:, LARGEST] = [sizes[-1] for sizes, _ in populations]
        ahead = np.full((len(populations), 2 * _AHEAD), -1.0)
        edges = level_edges()
        levels = len(edges) - 1
        level = np.tile(np.array([levels - 1, 0]), (len(populations), 1))
        table = rates.table(0 if rates.cheap else _TABLE)
        return Work(array, ahead, level, edges, np.full((levels, levels), np.nan), table)

    def grow(self, work: Work, state: State) -> Work:
        """See `Method.grow`."""
        return work._replace(sizes=enlarged(work.sizes, 2 * work.sizes.shape[1]))

    def supply_bound(self, work: Work, rates: Rates, state: State, replica: int) -> None:
        """See `Method.supply_bound`; bounds for two octaves are computed together.

        They come in fixed blocks: a bound must not depend on which replica asked first.
        """
        count = state.count[replica]
        low, high = (int(level_of.py_func(work.edges, count[k])) for k in (SMALLEST, LARGEST))
        if not np.isnan(work.majorant[low, high]):  # another replica has asked for it
            return
        block = high - high % 16
        highs = np.arange(max(low, block), min(block + 16, work.majorant.shape[1]))
        top = (work.edges[highs + 1] - 1).astype(float)
        bottom = np.full(top.shape, float(work.edges[low]))
        bound = rates.bounds(bottom, top, bottom, top)[1]
        if not rates.rigorous:
            # zeros alone prove nothing: candidates go on coming, at the rate of all sizes so far
            wider = rates.bounds(np.ones(top.shape), top, np.ones(top.shape), top)[1]
            bound = np.where(bound > 0.0, bound, wider)
        bound[bound == np.inf] = np.nan
        work.majorant[low, highs] = np.maximum(bound, 0.0)
        smallest, largest = float(count[SMALLEST]), float(count[LARGEST])
        if np.isnan(work.majorant[low, high]):
            raise InputError(
                f"the kernel has no finite bound for the sizes {smallest:.0f} to {largest:.0f}, "
                f"which were reached at t = {state.clock[replica, TIME]:.6g}; limit what grows, as "
                "in exp(min(x, 700)), or end earlier"
            )
        if work.majorant[low, high] == 0.0:  # no candidate would ever find a rate below zero
            value = float(rates.arrays(smallest, largest))
            if not 0.0 <= value < np.inf:
                state.clock[replica, VALUE] = value
                count[WORST_I], count[WORST_J] = smallest, largest

    def population(self, work: Work, state: State, replica: int) -> tuple[Int, Int]:
        """See `Method.population`."""
        count = state.count[replica]
        sizes, counts = np.unique(work.sizes[replica, : count[STORED]], return_counts=True)
        if count[MONOMERS]:
            sizes, counts = np.append(1, sizes), np.append(count[MONOMERS], counts)
        return sizes.astype(np.int64), counts.astype(np.int64)

    def bytes_per_replica(self, particles: int) -> int:
        """See `Method.bytes_per_replica`."""
        return 8 * particles
