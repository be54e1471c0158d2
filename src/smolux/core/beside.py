"""Events beside encounters: of single particles, and particles that come in.

Three streams superpose, and the earliest event is the next one; after it all are drawn afresh,
which changes nothing, as waiting times have no memory.

- Encounters, drawn by the method.
- Single particles, see `smolux.core.lone`.
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

from . import rng
from .bounds import thinned
from .compile import cold_piece, piece
from .loop import make_choose_process, schedule
from .state import (
    BAD_FACTOR,
    BAD_RATE,
    BAD_SHARE,
    BY_KERNEL,
    BY_SPLITS,
    CLOCKS,
    DRAW,
    EVENTS,
    FIRST,
    GROW,
    IN_DOUBT,
    KIND,
    LARGEST,
    LATE,
    LIMIT,
    LONE,
    LONE_PART,
    LONE_PROCESS,
    LONE_SIZE,
    MASS_IN,
    MASS_OUT,
    PENDING,
    PHASE,
    PROCESS,
    SINCE,
    SPLIT_IN_DOUBT,
    SPLITS,
    TIME,
    TOO_LARGE,
    TRIALS,
    VOLUME,
    WANTED,
    WINDOW,
)

PAIR, ALONE, SOURCE = 0, 1, 2
#: candidates for an encounter in vain after which encounters are drawn last
_MANY = 256


def make_next_event(draw: Any, ready: Any, lone: Any, seize: Any, pairs: int, lones: int,
                    sources: int) -> Any:  # fmt: skip
    """Bind the drawing of the next event, of whatever kind; see `smolux.core.loop`.

    `ready` and `lone` are those of `smolux.core.lone`, and not called if nothing happens to single
    particles.
    """

    @cold_piece
    def source_rate(s, windows):
        total = 0.0
        for r in range(sources):
            k = pairs + lones + r
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
        if lones > 0:
            alone = lone(s, w, windows, q.lone, wait)
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
        if lones > 0:
            reason = ready(s, w, p, q.lone)
            if reason != 0:
                return reason
        s.missed[IN_DOUBT] = s.missed[SPLIT_IN_DOUBT] = 0.0
        late = s.count[LATE] == 1
        wait = first = limit = math.inf
        looked = np.int64(0)
        for turn in range(2):
            if late == (turn == 0):
                first = other(s, w, windows, q, wait)
                if late:
                    limit = min(first, windows.edges[s.count[WINDOW] + 1] - s.clock[TIME])
            else:
                before = s.count[TRIALS]
                wait = encounter(s, w, windows, p, limit)
                looked = s.count[TRIALS] - before
        if math.isnan(wait) or math.isnan(first):
            return BAD_RATE
        if wait < first:
            s.count[KIND] = PAIR
        if s.count[KIND] == PAIR and s.count[FIRST] >= 0:
            s.count[LATE] = 0
        elif looked > _MANY:
            s.count[LATE] = 1
        if lones > 0 and s.count[KIND] == ALONE:
            seize(s, w, s.count[LONE])
        schedule(s, windows, min(wait, first))
        return 0

    return next_event


def make_choice(lone_factor: Any, source_factor: Any, pairs: int, lones: int, sources: int) -> Any:
    """Bind the choice of the process of an event that is no encounter, or none (-1)."""

    @cold_piece
    def kept(s, windows, r, value, share):
        """Thin by the true factor; `share` is uniform below its bound."""
        bound = windows.bounds[s.count[WINDOW], r] + s.clock[CLOCKS + r]
        return thinned(s, r, value, bound, share)

    @cold_piece
    def choose_alone(s, windows, q):
        r = s.count[LONE_PROCESS]
        k = pairs + r
        bound = windows.bounds[s.count[WINDOW], k] + s.clock[CLOCKS + k]
        value = lone_factor(r, s.clock[PENDING], q.lone_factors)
        return kept(s, windows, k, value, rng.uniform(s.rng) * bound)

    @cold_piece
    def choose_source(s, windows, q):
        total = 0.0
        first = pairs + lones
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
            return choose_alone(s, windows, q) if lones > 0 else -1
        return choose_source(s, windows, q) if sources > 0 else -1

    return choose


def make_fire(
    pieces: Any,
    pair_outcome: Any,
    factor: Any,
    lone_outcome: Any,
    choose: Any,
    stands: Any,
    rounded: Any,
    ledger: Any,
    known: Any,
    pairs: int,
    lones: int,
    share: Any = None,
) -> Any:
    """Bind what happens when the pending event comes; see `smolux.core.loop.make_fire`.

    `stands` is ``stands(size, p)``, how many particles a simulated one stands for; `rounded` rounds
    what appears, ``rounded(s, entries, size, p)``, when a particle of one size is replaced. The
    `ledger` and `known` are those of `smolux.core.lone`, and not called if nothing happens to
    single particles.
    """
    choose_pair = make_choose_process(pairs, pieces.pair, share)
    pair, update = pieces.pair, pieces.update
    enter, leave = ledger.enter, ledger.leave

    @cold_piece
    def pick(s, windows, r):
        """Size of a particle that comes in."""
        k = r - pairs - lones
        x = rng.uniform(s.rng)
        m = 0
        while m < windows.share.shape[1] - 1 and x >= windows.share[k, m]:
            m += 1
        return windows.size[k, m]

    @cold_piece
    def cut_off(s, windows, entries, p):
        """Take out what appears beyond the limit; return how many entries are left."""
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
    def result(s, w, windows, r, p, q):
        """Write what appears; how many entries, and the sizes of what is there and may vanish.

        Then what of both does (bits 1 and 2), and the mass that comes in and goes out.
        """
        if s.count[KIND] == PAIR:
            i, j = pair(s, w)
            entries, gone = pair_outcome(r, i, j, s, p, q)
            return entries, i, j, gone, 0.0, 0.0
        if s.count[KIND] == ALONE:
            size = s.count[LONE_SIZE]
            entries, removes = lone_outcome(r - pairs, size, s.count[LONE_PART], s)
            entries = rounded(s, entries, size, p)
            left = float(size) * stands(size, p) if removes else 0.0
            return entries, size, np.int64(0), 1, 0.0, left
        size = pick(s, windows, r)
        s.sizes[0], s.counts[0] = size, 1
        return 1, np.int64(0), np.int64(0), 0, float(size) * stands(size, p), 0.0

    @cold_piece
    def wanting(s, entries, q):
        """Whether bounds of the splits of something that appears are to be asked for."""
        for e in range(entries):
            if not known(s.sizes[e], q):
                s.count[WANTED] = s.sizes[e]
                return True
        return False

    @piece
    def book(s, gone, i, j, entries, q):
        """Bring the counts of single particles up to date."""
        if gone & 1:
            leave(s, i)
        if gone & 2:
            leave(s, j)
        for e in range(entries):
            enter(s, s.sizes[e], s.counts[e], q)

    @piece
    def exchange(s, w, windows, r, p, q):
        """Carry out process `r`: 0, or the reason to return, with nothing changed."""
        a, b, c, d = s.rng[0], s.rng[1], s.rng[2], s.rng[3]
        entries, i, j, gone, come, left = result(s, w, windows, r, p, q)
        highest = np.int64(0)
        for e in range(entries):
            highest = max(highest, s.sizes[e])
        if highest >= LIMIT:
            return TOO_LARGE
        out, cut = s.clock[MASS_OUT], s.events[windows.cut[1]]
        if highest > windows.cut[0]:
            entries = cut_off(s, windows, entries, p)
        reason = 0
        if lones > 0 and wanting(s, entries, q.lone):
            reason = SPLITS
        elif not update(s, w, gone, entries, p):
            reason = GROW
        if reason != 0:
            s.rng[0], s.rng[1], s.rng[2], s.rng[3] = a, b, c, d
            s.clock[MASS_OUT], s.events[windows.cut[1]] = out, cut
            return reason
        if lones > 0:
            book(s, gone, i, j, entries, q.lone)
        for e in range(entries):
            s.count[LARGEST] = max(s.count[LARGEST], s.sizes[e])
        s.clock[MASS_IN] += come
        s.clock[MASS_OUT] += left
        s.attempts[windows.cut[1]] += s.events[windows.cut[1]] - cut
        s.events[r] += 1
        s.count[SINCE] += 1
        return 0

    @piece
    def fire(s, w, windows, p, q):
        kind = s.count[KIND]
        alive = s.count[FIRST] >= 0 if kind == PAIR else s.count[LONE] >= 0 or kind == SOURCE
        if alive:
            r = s.count[PROCESS]
            if r < 0:
                encounter = kind == PAIR
                r = choose_pair(s, w, windows, factor, q) if encounter else choose(s, windows, q)
                if r <= -2:
                    return BAD_SHARE if r == -4 else BAD_FACTOR
                s.count[PROCESS] = r
            if r >= 0:
                reason = exchange(s, w, windows, r, p, q)
                if reason != 0:
                    return reason
                if kind == PAIR:
                    s.count[EVENTS] += 1
                    s.missed[BY_KERNEL] += s.missed[IN_DOUBT]
                elif kind == ALONE:
                    s.missed[BY_SPLITS] += s.missed[SPLIT_IN_DOUBT]
        s.clock[TIME] = s.clock[PENDING]
        s.count[PHASE] = DRAW
        return 0

    return fire
