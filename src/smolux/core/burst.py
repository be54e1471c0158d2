"""Plain events in a row, with what changes held in registers.

Between two events that need the whole loop, most are plain: rates that do not vary with time, and
an outcome of one kind of particle, within the bounds in force. In these rows an event costs half
of what it costs when every count is written to the state and read again. The events are the same,
drawn from the same random numbers: whatever is not plain is left pending for the loop.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

from smolux.jit.compile import piece

from . import rng
from .state import (
    BAD_RATE,
    BOTH,
    DOUBLE_AT,
    EVENTS,
    EXCESS,
    FIRE,
    FIRST,
    LIMIT,
    PARTICLES,
    PENDING,
    PHASE,
    PROCESS,
    REPAIRS,
    SECOND,
    SINCE,
    TIME,
    TRIALS,
    WINDOW,
)

#: a shorter row is not worth its beginning
_LEAST = 8
# What `Burst.replace` says of an event.
NOT_PLAIN, PLAIN, LAST = 0, 1, 2


class Burst(NamedTuple):
    """What a method brings for bursts; `held` is a tuple of those of its numbers that change.

    Attributes
    ----------
    row : ``row(s, w)``
        How many events `Pieces.prepare` will find nothing to do for, if they are plain.
    hold : ``hold(s, w, factor)``
        Take what changes out of the state; the rates are `factor` times those of the kernel.
    find : ``find(s, w, p, factor, limit, held, particles, trials, *words)``
        As `Pieces.draw`: the waiting time, the slots of the pair (-1: nothing happens then) and
        its sizes, the candidates looked at so far and the four words of the random generator.
    replace : ``replace(w, held, first, second, gone, size, count)``
        Take one of the pair or both out (bits 1 and 2) and put `count` particles of a size in.
        Returns `PLAIN`, or `LAST` if `Pieces.prepare` must look at the store after this event, or
        `NOT_PLAIN`, with nothing changed, if the store lacks room or the size breaks the bounds in
        force; and `held` as it is after the event.
    release : ``release(s, held)``
        Write what is held to the state.
    """

    row: Any
    hold: Any
    find: Any
    replace: Any
    release: Any


def make_draw_one(find: Callable[..., Any]) -> Callable[..., Any]:
    """Bind the drawing of one event by `Burst.find`, for `Pieces.draw`."""

    @piece
    def draw_one(s, w, p, factor, limit, held):
        a, b, c, d = s.rng[0], s.rng[1], s.rng[2], s.rng[3]
        wait, s.count[FIRST], s.count[SECOND], _, _, s.count[TRIALS], a, b, c, d = find(
            s, w, p, factor, limit, held, s.count[PARTICLES], s.count[TRIALS], a, b, c, d
        )
        s.rng[0], s.rng[1], s.rng[2], s.rng[3] = a, b, c, d
        return wait

    return draw_one


@lru_cache(maxsize=64)
def _make_choose(pairs: int) -> Any:
    @piece
    def choose(windows, window, share):
        """Choose the process by a uniform number below the sum of rates; -1 if rounding has none.

        The rates do not vary, so the bounds are the rates.
        """
        bound = windows.bounds[window, 0]
        r = 0
        while r < pairs - 1 and share >= bound:
            share -= bound
            r += 1
            bound = windows.bounds[window, r]
        return r if share < bound else -1

    return choose


def make_burst(
    brought: Burst, outcome: Callable[..., Any], pairs: int, random: bool
) -> Callable[..., Any]:
    """Bind a burst to the outcomes of `pairs` processes; `random` if they draw random numbers.

    Returns
    -------
    callable
        ``burst(s, w, windows, p, q, until, stop)``: 0, with an event pending if one was found that
        is not plain or comes after `until`, or the reason to return.
    """
    row, hold, find, replace, release = brought
    choose = _make_choose(pairs)

    @piece
    def burst(s, w, windows, p, q, until, stop):
        window = s.count[WINDOW]
        n = s.count[PARTICLES]
        left = min(n - max(s.count[DOUBLE_AT], 1) - 1, row(s, w))
        if left < _LEAST or windows.edges[window + 1] < math.inf or s.clock[EXCESS] > 0.0:
            return 0
        events, trials, repairs = s.count[EVENTS], s.count[TRIALS], s.count[REPAIRS]
        time, factor = s.clock[TIME], windows.total[window]
        held, reason = hold(s, w, factor), 0
        a, b, c, d = s.rng[0], s.rng[1], s.rng[2], s.rng[3]
        last = events + left
        while events < last and trials + events < stop:
            wait, first, second, i, j, trials, a, b, c, d = find(
                s, w, p, factor, math.inf, held, n, trials, a, b, c, d
            )
            if math.isnan(wait):
                reason = BAD_RATE
                break
            pending, r, done = time + wait, -1, NOT_PLAIN
            if first >= 0 and pending <= until:
                r = 0
                if pairs > 1:
                    u, a, b, c, d = rng.uniform_of(a, b, c, d)
                    r = choose(windows, window, u * factor)
                    first = first if r >= 0 else -1
            if r >= 0:
                if random:
                    s.rng[0], s.rng[1], s.rng[2], s.rng[3] = a, b, c, d
                entries, gone = outcome(r, i, j, s, p, q)
                size, count = s.sizes[0], s.counts[0]
                if entries == 1 and gone > 0 and size < LIMIT and s.count[REPAIRS] == repairs:
                    done, held = replace(w, held, first, second, gone, size, count)
                if random and done != NOT_PLAIN:  # else the loop draws the same numbers again
                    a, b, c, d = s.rng[0], s.rng[1], s.rng[2], s.rng[3]
            if done == NOT_PLAIN:
                s.count[FIRST], s.count[SECOND], s.count[PROCESS] = first, second, r
                s.clock[PENDING] = pending
                s.count[PHASE] = FIRE
                break
            n += count - (2 if gone == BOTH else 1)
            events += 1
            s.events[r] += 1
            time = pending
            if done == LAST:
                break
        s.rng[0], s.rng[1], s.rng[2], s.rng[3] = a, b, c, d
        s.count[SINCE] += events - s.count[EVENTS]
        s.count[PARTICLES], s.count[EVENTS], s.count[TRIALS] = n, events, trials
        s.clock[TIME] = time
        release(s, held)
        return reason

    return burst
