"""Events beside encounters: of single particles, and particles that come in.

Three streams superpose, and the earliest event is the next one; after it all are drawn afresh,
which changes nothing, as waiting times have no memory.

- Encounters, drawn by the method.
- Single particles, see `smolux.core.unary`.
- Sources, each at a constant rate for a unit of volume.

The encounter is drawn first: it is the most frequent event. Where many candidates for it have been
looked at and something else came before, it is drawn last, and its candidates are looked at no
further than the earliest of the others, whose times they have no influence on. So a kernel that is
zero for all that is there, or a particle that only meets itself, does not hold the others up.

Time-dependent factors are bounded in windows and thinned when the event comes, as for encounters.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from smolux.jit.compile import cold_piece, piece

from . import rng
from .bounds import thinned
from .fire import Books, Kinds
from .loop import schedule
from .state import (
    BAD_RATE,
    BY_SPLITS,
    CLOCKS,
    FIRST,
    IN_DOUBT,
    KIND,
    LATE,
    MASS_OUT,
    ONE,
    OTHER,
    PENDING,
    SPLIT_IN_DOUBT,
    TIME,
    TRIALS,
    UNARY,
    UNARY_PART,
    UNARY_PROCESS,
    UNARY_SIZE,
    VOLUME,
    WANTED,
    WINDOW,
)

PAIR, ALONE, SOURCE = 0, 1, 2
#: candidates for an encounter in vain after which encounters are drawn last
_MANY = 256


def make_next_event(draw: Any, ready: Any, unary: Any, select: Any, pairs: int, unaries: int,
                    sources: int) -> Any:  # fmt: skip
    """Bind the drawing of the next event, of whatever kind; see `smolux.core.loop`.

    `ready` and `unary` are those of `smolux.core.unary`, and not called if nothing happens to
    single particles.
    """

    @cold_piece
    def source_rate(s, windows):
        total = 0.0
        for r in range(sources):
            k = pairs + unaries + r
            bound = windows.bounds[s.count[WINDOW], k] + s.clock[CLOCKS + k]
            total += bound * windows.inflow[r]
        return total * s.clock[VOLUME]

    @piece
    def encounter(s, w, windows, p, limit):
        """Draw the next encounter; return its waiting time, infinite if there is none."""
        total = windows.total[s.count[WINDOW]]
        for r in range(pairs):
            total += s.clock[CLOCKS + r]
        return draw(s, w, p, total, limit) if pairs > 0 and total > 0.0 else math.inf

    @piece
    def other(s, w, windows, q, limit):
        """Draw what else comes first, return its waiting time; the limit if nothing does."""
        wait = limit
        if sources > 0:
            rate = source_rate(s, windows)
            if rate > 0.0:
                come = rng.exponential(s.rng) / rate
                if come < wait:
                    wait = come
                    s.count[KIND] = SOURCE
        if unaries > 0:
            alone = unary(s, w, windows, q.unary, wait)
            if math.isnan(alone):
                return math.nan
            if alone < wait:
                wait = alone
                s.count[KIND] = ALONE
        return wait

    @piece
    def next_event(s, w, windows, p, q, until, stop):
        s.count[KIND] = PAIR
        s.count[FIRST] = -1
        if unaries > 0:
            reason = ready(s, w, p, q.unary)
            if reason != 0:
                return reason
        s.missed[IN_DOUBT] = s.missed[SPLIT_IN_DOUBT] = 0.0
        late = s.count[LATE] == 1
        first = limit = math.inf
        if late:
            first = other(s, w, windows, q, math.inf)
            limit = min(first, windows.edges[s.count[WINDOW] + 1] - s.clock[TIME])
        before = s.count[TRIALS]
        wait = encounter(s, w, windows, p, limit)
        looked = s.count[TRIALS] - before
        if not late:
            first = other(s, w, windows, q, wait)
        if math.isnan(wait) or math.isnan(first):
            return BAD_RATE
        if wait < first:
            s.count[KIND] = PAIR
        if s.count[KIND] == PAIR and s.count[FIRST] >= 0:
            s.count[LATE] = 0
        elif looked > _MANY:
            s.count[LATE] = 1
        if unaries > 0 and s.count[KIND] == ALONE:
            select(s, w, s.count[UNARY])
        schedule(s, windows, min(wait, first))
        return 0

    return next_event


def make_choice(
    unary_factor: Any, source_factor: Any, pairs: int, unaries: int, sources: int
) -> Any:
    """Bind the choice of the process of an event that is no encounter, or none (-1)."""

    @cold_piece
    def kept(s, windows, r, value, share):
        """Thin by the true factor; `share` is uniform below its bound."""
        bound = windows.bounds[s.count[WINDOW], r] + s.clock[CLOCKS + r]
        return thinned(s, r, value, bound, share)

    @cold_piece
    def choose_alone(s, windows, q):
        r = s.count[UNARY_PROCESS]
        k = pairs + r
        bound = windows.bounds[s.count[WINDOW], k] + s.clock[CLOCKS + k]
        value = unary_factor(r, s.clock[PENDING], q.unary_factors)
        return kept(s, windows, k, value, rng.uniform(s.rng) * bound)

    @cold_piece
    def choose_source(s, windows, q):
        total = 0.0
        first = pairs + unaries
        for r in range(sources):
            bound = windows.bounds[s.count[WINDOW], first + r] + s.clock[CLOCKS + first + r]
            total += bound * windows.inflow[r]
        x = rng.uniform(s.rng) * total
        r, bound = 0, 0.0
        for m in range(sources):
            r, bound = m, windows.bounds[s.count[WINDOW], first + m] + s.clock[CLOCKS + first + m]
            if x < bound * windows.inflow[m] or m == sources - 1:
                break
            x -= bound * windows.inflow[m]
        share = x / windows.inflow[r]
        s.attempts[first + r] += 1
        value = source_factor(r, s.clock[PENDING], q.source_factors)
        return kept(s, windows, first + r, value, share)

    @piece
    def choose(s, windows, q):
        if s.count[KIND] == ALONE:
            return choose_alone(s, windows, q) if unaries > 0 else -1
        return choose_source(s, windows, q) if sources > 0 else -1

    return choose


def make_kinds(
    encounters: Kinds, unary_outcome: Any, choose_other: Any, stands: Any, rounded: Any, pairs: int,
    unaries: int,
) -> Kinds:  # fmt: skip
    """Bind the events beside encounters to these, see `smolux.core.fire.Kinds`.

    `choose_other` is that of `make_choice`, `stands` is ``stands(size, p)``, how many particles a
    simulated one stands for; `rounded` rounds what appears, ``rounded(s, entries, size, p)``, when
    a particle of one size is replaced.
    """

    @cold_piece
    def pick(s, windows, r):
        """Size of a particle that comes in."""
        k = r - pairs - unaries
        x = rng.uniform(s.rng)
        m = 0
        while m < windows.share.shape[1] - 1 and x >= windows.share[k, m]:
            m += 1
        return windows.size[k, m]

    @piece
    def alive(s):
        if s.count[KIND] == PAIR:
            return encounters.alive(s)
        return s.count[UNARY] >= 0 or s.count[KIND] == SOURCE

    @piece
    def choose(s, w, windows, q):
        if s.count[KIND] == PAIR:
            return encounters.choose(s, w, windows, q)
        return choose_other(s, windows, q)

    @cold_piece
    def result(s, w, windows, r, p, q):
        if s.count[KIND] == PAIR:
            return encounters.result(s, w, windows, r, p, q)
        if s.count[KIND] == ALONE:
            size = s.count[UNARY_SIZE]
            entries, removes = unary_outcome(r - pairs, size, s.count[UNARY_PART], s)
            entries = rounded(s, entries, size, p)
            left = float(size) * stands(size, p) if removes else 0.0
            return entries, size, np.int64(0), ONE, 0.0, left
        size = pick(s, windows, r)
        s.sizes[0], s.counts[0] = size, 1
        return 1, np.int64(0), np.int64(0), 0, float(size) * stands(size, p), 0.0

    @piece
    def note(s):
        if s.count[KIND] == PAIR:
            encounters.note(s)
        elif s.count[KIND] == ALONE:
            s.missed[BY_SPLITS] += s.missed[SPLIT_IN_DOUBT]

    return Kinds(alive, choose, result, note)


def make_books(stands: Any, ledger: Any, known: Any, unaries: int) -> Books:
    """Bind what is kept beside, see `smolux.core.fire.Books`.

    The `ledger` and `known` are those of `smolux.core.unary`, and not called if nothing happens to
    single particles.
    """
    enter, leave = ledger.enter, ledger.leave

    @cold_piece
    def cut_off(s, windows, entries, p):
        kept = 0
        for e in range(entries):
            if s.sizes[e] > windows.cut[0]:
                s.clock[MASS_OUT] += float(s.sizes[e]) * s.counts[e] * stands(s.sizes[e], p)
                s.events[windows.cut[1]] += s.counts[e]
            else:
                s.sizes[kept], s.counts[kept] = s.sizes[e], s.counts[e]
                kept += 1
        return kept

    @cold_piece
    def wanting(s, entries, q):
        for e in range(entries):
            if not known(s.sizes[e], q):
                s.count[WANTED] = s.sizes[e]
                return True
        return False

    @piece
    def book(s, gone, i, j, entries, q):
        if gone & ONE:
            leave(s, i)
        if gone & OTHER:
            leave(s, j)
        for e in range(entries):
            enter(s, s.sizes[e], s.counts[e], q)

    return Books(cut_off, wanting, book, unaries)
