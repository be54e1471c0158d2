"""What happens when the pending event comes, whatever its kind: one `fire` for all loops.

A loop of encounters alone knows one kind of events, `make_encounters`; those of single particles
and of sources join them in `smolux.core.superposition`. What only systems with such events keep,
`Books`, is left out of the loops of the others when they are compiled.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from smolux.jit.compile import piece

from . import rng
from .bounds import ROUNDING, note_bad, thinned
from .state import (
    BAD_SHARE,
    BY_KERNEL,
    CLOCKS,
    DRAW,
    EVENTS,
    FIRST,
    GROW,
    IN_DOUBT,
    LARGEST,
    LIMIT,
    MASS_IN,
    MASS_OUT,
    PENDING,
    PHASE,
    PROCESS,
    SINCE,
    SPLITS,
    TIME,
    TOO_LARGE,
    WINDOW,
)


class Kinds(NamedTuple):
    """The kinds of events of a loop, of one of which the next is pending.

    Attributes
    ----------
    alive : ``alive(s)``
        Whether anything happens when it comes.
    choose : ``choose(s, w, windows, q)``
        The process that takes place, -1 for none, or with a minus the reason to return.
    result : ``result(s, w, windows, r, p, q)``
        Write what process `r` makes into ``s.sizes`` and ``s.counts``. Returns how many entries,
        the sizes of what is there and may vanish, which of both does (bits 1 and 2), and the mass
        that comes in and goes out.
    note : ``note(s)``
        Count the event, which has taken place.
    """

    alive: Any
    choose: Any
    result: Any
    note: Any


class Books(NamedTuple):
    """What is kept where encounters are not all that happens, see `smolux.core.superposition`.

    Attributes
    ----------
    cut_off : ``cut_off(s, windows, entries, p)``
        Take out what appears beyond the limit; how many entries are left.
    wanting : ``wanting(s, entries, q)``
        Whether bounds of the splits of something that appears are to be asked for.
    enter : ``enter(s, gone, i, j, entries, q)``
        Bring the counts of single particles up to date.
    singles : int
        How many processes of single particles there are; without any, of these only `cut_off` is.
    """

    cut_off: Any
    wanting: Any
    enter: Any
    singles: int


@lru_cache(maxsize=64)
def make_choose_process(
    pairs: int,
    factor: Callable[..., Any],
    pair: Any = None,
    share: Any = None,
    mixture: Any = None,
) -> Callable[..., Any]:
    """Bind the choice of the process of an encounter, of the first `pairs` ones.

    ``factor(r, t, q)`` is the rate of process `r` as a multiple of the kernel, `pair` that of the
    method, and ``share(r, (i, j), q)`` the share of the encounters of two sizes in which process
    `r` takes place; None if that is all of them. ``mixture(i, j, t, q)`` is the rate of two sizes
    as a multiple of that by which they were drawn, if it varies in time.
    """
    if share is not None:
        choose = make_choose_process(pairs, factor, pair, None, mixture)

        @piece
        def choose_and_share(s, w, windows, q):
            """Choose the process, or none, also by the share of these sizes."""
            r = choose(s, w, windows, q)
            if r < 0:
                return r
            i, j = pair(s, w)
            value = share(r, (i, j), q.shares)
            if not 0.0 <= value <= ROUNDING:
                note_bad(s, i, j, value)
                s.count[PROCESS] = r
                return -BAD_SHARE
            return r if rng.uniform(s.rng) < value else -1

        return choose_and_share

    mixed = mixture is not None

    @piece
    def choose_process(s, w, windows, q):
        """Choose the process, or none: thinning by the true factor at the time of the event."""
        window = s.count[WINDOW]
        if pairs == 1 and windows.edges[window + 1] == math.inf:
            return 0
        excess = 0.0
        for r in range(pairs):
            excess += s.clock[CLOCKS + r]
        x = rng.uniform(s.rng) * (windows.total[window] + excess)
        r = 0
        bound = windows.bounds[window, 0] + s.clock[CLOCKS]
        while r < pairs - 1 and x >= bound:
            x -= bound
            r += 1
            bound = windows.bounds[window, r] + s.clock[CLOCKS + r]
        value = factor(r, s.clock[PENDING], q.factors)
        if mixed:
            i, j = pair(s, w)
            value *= mixture(i, j, s.clock[PENDING], q.factors[-1])
        # x is uniform below the bound, and serves again
        return thinned(s, r, value, bound, x)

    return choose_process


@lru_cache(maxsize=64)
def make_encounters(
    pair: Callable[..., Any],
    outcome: Callable[..., Any],
    factor: Callable[..., Any],
    pairs: int,
    share: Callable[..., Any] | None = None,
    mixture: Callable[..., Any] | None = None,
) -> Kinds:
    """Bind encounters.

    Parameters
    ----------
    pair : callable
        Of the method, see `smolux.core.loop.Pieces`.
    outcome : callable
        ``outcome(r, i, j, s, p, q)``: writes what process `r` makes of the sizes `i` and `j` into
        ``s.sizes`` and ``s.counts``; returns how many entries, and which of both vanishes (bits 1
        and 2).
    factor, pairs, share
        See `make_choose_process`.
    """

    @piece
    def alive(s):
        return s.count[FIRST] >= 0

    @piece
    def result(s, w, windows, r, p, q):
        i, j = pair(s, w)
        entries, gone = outcome(r, i, j, s, p, q)
        return entries, i, j, gone, 0.0, 0.0

    @piece
    def note(s):
        s.count[EVENTS] += 1
        s.missed[BY_KERNEL] += s.missed[IN_DOUBT]
        s.missed[IN_DOUBT] = 0.0

    return Kinds(alive, make_choose_process(pairs, factor, pair, share, mixture), result, note)


@lru_cache(maxsize=64)
def _make_exchange(
    result: Callable[..., Any], update: Callable[..., Any], random: bool, books: Books | None
) -> Callable[..., Any]:
    keeps = books is not None
    cut_off, wanting, enter, singles = books or Books(None, None, None, 0)

    @piece
    def exchange(s, w, windows, r, p, q):
        """Carry out process `r`: 0, or the reason to return, with nothing changed."""
        if random:  # the same numbers again, should there be no room
            a, b, c, d = s.rng[0], s.rng[1], s.rng[2], s.rng[3]
        entries, i, j, gone, come, left = result(s, w, windows, r, p, q)
        highest = np.int64(0)
        for e in range(entries):
            highest = max(highest, s.sizes[e])
        if highest >= LIMIT:
            return TOO_LARGE
        if keeps:
            out, cut = s.clock[MASS_OUT], s.events[windows.cut[1]]
            if highest > windows.cut[0]:
                entries = cut_off(s, windows, entries, p)
        reason = 0
        if singles > 0 and wanting(s, entries, q.unary):
            reason = SPLITS
        elif not update(s, w, gone, entries, p):
            reason = GROW
        if reason != 0:
            if random:
                s.rng[0], s.rng[1], s.rng[2], s.rng[3] = a, b, c, d
            if keeps:
                s.clock[MASS_OUT], s.events[windows.cut[1]] = out, cut
            return reason
        if singles > 0:
            enter(s, gone, i, j, entries, q.unary)
        if keeps:
            for e in range(entries):
                s.count[LARGEST] = max(s.count[LARGEST], s.sizes[e])
            s.clock[MASS_IN] += come
            s.clock[MASS_OUT] += left
            s.attempts[windows.cut[1]] += s.events[windows.cut[1]] - cut
        s.events[r] += 1
        s.count[SINCE] += 1
        return 0

    return exchange


@lru_cache(maxsize=64)
def make_fire(
    kinds: Kinds, update: Callable[..., Any], random: bool, books: Books | None = None
) -> Callable[..., Any]:
    """Bind what happens when the pending event comes: 0 or the reason to return.

    Parameters
    ----------
    kinds : Kinds
        Of events.
    update : callable
        Of the method, see `smolux.core.loop.Pieces`.
    random : bool
        Whether the result of an event draws random numbers.
    books : Books, optional
        What is kept beside; None if encounters are all that happens.
    """
    alive, choose, result, note = kinds
    exchange = _make_exchange(result, update, random, books)

    @piece
    def fire(s, w, windows, p, q):
        if alive(s):
            r = s.count[PROCESS]
            if r < 0:
                r = choose(s, w, windows, q)
                if r < -1:
                    return -r
                s.count[PROCESS] = r
            if r >= 0:
                reason = exchange(s, w, windows, r, p, q)
                if reason != 0:
                    return reason
                note(s)
        s.clock[TIME] = s.clock[PENDING]
        s.count[PHASE] = DRAW
        return 0

    return fire
