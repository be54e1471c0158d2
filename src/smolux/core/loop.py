"""The one event loop.

A method brings nine `Pieces`, a model two; they are bound by closure and inlined. A piece that
needs another one, or the rate, is made by a function that takes it: a compiled function passed as
an argument could not be kept in the cache.

What depends on nothing but other pieces is bound once and kept, here as in the methods: in the next
loop of the process it need not be compiled again.

The loop returns when every output time is recorded, when its budget is spent, or when it needs
Python: a larger store, a bound of the kernel. The pending event is part of the state, so a
trajectory depends neither on the output times nor on where the loop returned.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from smolux.jit.compile import cold_piece, entry, piece

from .after_event import make_after_event
from .burst import Burst
from .record import make_record
from .state import (
    BAD_RATE,
    BUDGET,
    DONE,
    DRAW,
    EVENTS,
    EXCESS,
    FIRE,
    IN_DOUBT,
    NEXT,
    PAUSE,
    PAUSED,
    PENDING,
    PHASE,
    PROCESS,
    TIME,
    TRIALS,
    WINDOW,
)
from .views import state_of, tally_of

#: candidates looked at before the loop may return without an event
PATIENCE = 4096


class Pieces(NamedTuple):
    """What a method brings; `s` is the state and `w` the work arrays of one replica.

    Attributes
    ----------
    view : ``view(work, r)``
        The work arrays of replica `r`.
    draw : ``draw(s, w, p, factor, limit)``
        Choose the next pair into ``count[FIRST]``, ``count[SECOND]`` (-1: nothing happens then)
        and return the waiting time, the rate being `factor` times that of the kernel; NaN if a
        rate of a pair that is present is none, which `note_bad` has noted. A method that looks at
        candidates in turn stops at the first that would come after the `limit` and returns that.
    pair : ``pair(s, w)``
        Sizes of the chosen pair.
    update : ``update(s, w, gone, entries, p)``
        Take the first of the pair out (bit 1 of `gone`) and the second (bit 2), and put the
        `entries` of ``s.sizes``, ``s.counts`` in; False, with nothing changed, if there is no room.
    prepare : ``prepare(s, w, p)``
        Bring bounds up to date; 0 or the reason to return.
    double : ``double(s, w)``
        Put every particle in once more; False, with nothing changed, if there is no room.
    pick : ``pick(s, w, r, c)``
        Place and size of one of the particles in slot `c` of `State.held`, or in this and others;
        each with a chance in proportion to ``s.most[r]`` of its slot.
    select : ``select(s, w, place)``
        Put that particle in the place of the first of the pair.
    visit : ``visit(s, w, t, grid, p)``
        Call the `tally` that `Method.bind` was given for the particles present, with all but
        `s` and `w`, and return the largest size.
    burst : Burst or None
        How the method carries out plain events in a row, if it can.
    """

    view: Any
    draw: Any
    pair: Any
    update: Any
    prepare: Any
    double: Any
    pick: Any
    select: Any
    visit: Any
    burst: Burst | None = None


@piece
def schedule(s, windows, wait):
    """Note when the next event comes, or go to the next window if that begins before."""
    window = s.count[WINDOW]
    pending = s.clock[TIME] + wait
    if pending >= windows.edges[window + 1] and windows.edges[window + 1] < math.inf:
        # the exponential law has no memory: go on afresh from the edge
        s.clock[TIME] = windows.edges[window + 1]
        s.count[WINDOW] = window + 1
        return
    s.clock[PENDING] = pending
    s.count[PROCESS] = -1
    s.count[PHASE] = FIRE


def make_next_event(
    draw: Callable[..., Any], burst: Callable[..., Any] | None = None
) -> Callable[..., Any]:
    """Bind the drawing of the next event: waiting time and window, after a burst of plain ones."""
    if burst is not None:
        draw_next = make_next_event(draw)

        @piece
        def next_event_after_burst(s, w, windows, p, q, until, stop):
            before = s.count[EVENTS]
            reason = burst(s, w, windows, p, q, until, stop)
            if reason != 0 or s.count[PHASE] == FIRE or s.count[EVENTS] > before:
                return reason  # without a pending event, to be prepared for the next
            return draw_next(s, w, windows, p, q, until, stop)

        return next_event_after_burst

    @piece
    def next_event(s, w, windows, p, q, until, stop):
        window = s.count[WINDOW]
        total = windows.total[window] + s.clock[EXCESS]
        s.missed[IN_DOUBT] = 0.0
        wait = math.inf
        if total > 0.0:
            wait = draw(s, w, p, total, math.inf)
        if math.isnan(wait):
            return BAD_RATE
        schedule(s, windows, wait)
        return 0

    return next_event


def make_advance(
    pieces: Pieces, next_event: Callable[..., Any], fire: Callable[..., Any]
) -> Callable[..., Any]:
    """Bind the way of one replica, from event to event.

    Parameters
    ----------
    pieces : Pieces
        Of the method.
    next_event : callable
        As `make_next_event` returns it.
    fire : callable
        As `smolux.core.fire.make_fire` returns it.

    Returns
    -------
    callable
        ``advance(s, w, tally, windows, grid, p, q, budget)``: why it returned.
    """
    prepare, after_event = pieces.prepare, make_after_event(pieces.double)
    record = make_record(pieces.visit)

    @cold_piece
    def advance(s, w, tally, windows, grid, p, q, budget):
        stop = s.count[TRIALS] + s.count[EVENTS] + budget
        while True:
            if s.count[PHASE] == DRAW:
                reason = after_event(s, w)
                if reason != 0:
                    return reason
                reason = prepare(s, w, p)
                if reason != 0:
                    return reason
                if s.count[TRIALS] + s.count[EVENTS] >= stop:
                    return BUDGET
                until = grid.times[min(s.count[NEXT], grid.times.shape[0] - 1)]
                reason = next_event(s, w, windows, p, q, until, stop)
                if reason != 0:
                    return reason
                if s.count[PHASE] == DRAW:
                    continue
            while (
                s.count[NEXT] < grid.times.shape[0] and grid.times[s.count[NEXT]] < s.clock[PENDING]
            ):
                k = s.count[NEXT]
                record(s, w, tally_of(tally, k), grid, grid.times[k], p)
                s.count[NEXT] += 1
                if s.count[PAUSE] == 1:
                    return PAUSED
            if s.count[NEXT] >= grid.times.shape[0]:
                return DONE
            reason = fire(s, w, windows, p, q)
            if reason != 0:
                return reason

    return advance


def make_loop(advance: Callable[..., Any], view: Callable[..., Any]) -> Callable[..., Any]:
    """Compile the loop over replicas.

    Parameters
    ----------
    advance : callable
        As `make_advance` returns it.
    view : callable
        Of the method, see `Pieces`.

    Returns
    -------
    callable
        ``loop(state, work, tally, windows, grid, p, q, codes, budget)`` advances every replica
        whose code is not `DONE` and writes why it returned into `codes`.
    """

    def loop(state, work, tally, windows, grid, p, q, codes, budget):
        for r in range(codes.shape[0]):
            if codes[r] == DONE:
                continue
            if budget <= 0:
                codes[r] = BUDGET
                continue
            s, t = state_of(state, r), tally_of(tally, r)
            before = s.count[TRIALS] + s.count[EVENTS]
            codes[r] = advance(s, view(work, r), t, windows, grid, p, q, budget)
            budget -= s.count[TRIALS] + s.count[EVENTS] - before

    return entry(loop)
