"""How a method holds its particles, and how an event changes them: the same for all methods.

A place is a whole number by which a store finds one of its particles. Those of the pending event
are ``count[FIRST]`` and ``count[SECOND]``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from smolux.jit.compile import cold_piece, piece

from .burst import Burst
from .loop import Pieces
from .rows import empty, fill_from_source, leave, share_out
from .state import BOTH, FIRST, ONE, PARTICLES, SECOND


class Store(NamedTuple):
    """What a method says of its store; `s` is the state and `w` the work arrays of one replica.

    How many particles there are, ``count[PARTICLES]``, is counted for all stores alike.

    Attributes
    ----------
    view : ``view(work, r)``
        The work arrays of replica `r`.
    size : ``size(s, w, place)``
        Size of a particle.
    pick : ``pick(s, w, r, c)``
        See `smolux.core.loop.Pieces`.
    room : ``room(s, w, gone, entries, p)``
        Make ready for the `entries` of ``s.sizes``, ``s.counts``, with the pair still there; False,
        with no particle changed, if the store has to grow.
    take : ``take(s, w, place)``
        Take a particle out. Those with a later place may be found at other places then, among
        those that it was stored with.
    put : ``put(s, w, size, count, i, j, p)``
        Put `count` particles of one size in. The sizes `i` and `j` are of those that were taken out
        before, zero if there are none: what is summed over particles may change by all at once.
    double : ``double(s, w)``
        Put every particle in once more; False, with nothing changed, if there is no room.
    visit : ``visit(s, w, t, grid, p)``
        See `smolux.core.loop.Pieces`.
    exchange : ``exchange(s, w)``, optional
        Put the only entry in the place of both of the pair; False, with nothing changed, if it does
        not go that way.
    load : ``load(w, place)``, optional
        Add the row of a particle to ``w.mixed``, if particles have rows, see `smolux.core.rows`;
        `take` and `double` move rows with their particles, and `put` gives each of the new ones
        ``w.row``.
    """

    view: Callable[..., Any]
    size: Callable[..., Any]
    pick: Callable[..., Any]
    room: Callable[..., Any]
    take: Callable[..., Any]
    put: Callable[..., Any]
    double: Callable[..., Any]
    visit: Callable[..., Any]
    exchange: Callable[..., Any] | None = None
    load: Callable[..., Any] | None = None


@piece
def select(s, w, place):
    """Make a particle the one that vanishes."""
    s.count[FIRST] = place


@piece
def _never(s, w):
    return False


@lru_cache(maxsize=64)
def _make_pair(size: Callable[..., Any]) -> Callable[..., Any]:
    @piece
    def pair(s, w):
        """Sizes of the chosen pair."""
        return size(s, w, s.count[FIRST]), size(s, w, s.count[SECOND])

    return pair


@lru_cache(maxsize=64)
def _make_double(doubled: Callable[..., Any]) -> Callable[..., Any]:
    @piece
    def double(s, w):
        if not doubled(s, w):
            return False
        s.count[PARTICLES] *= 2
        return True

    return double


@lru_cache(maxsize=64)
def _make_update(
    size: Callable[..., Any],
    room: Callable[..., Any],
    take: Callable[..., Any],
    put: Callable[..., Any],
    exchange: Callable[..., Any],
    bind: Callable[..., Any],
) -> Callable[..., Any]:
    @bind
    def update(s, w, gone, entries, p):
        """Take out what vanishes and put in what appears; False if there is no room."""
        if not room(s, w, gone, entries, p):
            return False
        if entries == 0:  # what is gone is accounted for beside what appears
            s.sizes[0], s.counts[0] = 1, 0
            entries = 1
        a, b = s.count[FIRST], s.count[SECOND]
        if gone == BOTH and entries == 1 and exchange(s, w):
            s.count[PARTICLES] += s.counts[0] - 2
            return True
        i = j = np.int64(0)
        if gone == BOTH:
            i, j = size(s, w, a), size(s, w, b)
            take(s, w, max(a, b))  # the later place first: the other one is found where it was
            take(s, w, min(a, b))
            s.count[PARTICLES] -= 2
        elif gone > 0:
            place = a if gone == ONE else b
            i = size(s, w, place)
            take(s, w, place)
            s.count[PARTICLES] -= 1
        for e in range(entries):
            s.count[PARTICLES] += s.counts[e]
            put(s, w, s.sizes[e], s.counts[e], i, j, p)
            i = j = np.int64(0)
        return True

    return update


@lru_cache(maxsize=64)
def _make_carrying_update(
    size: Callable[..., Any],
    room: Callable[..., Any],
    take: Callable[..., Any],
    put: Callable[..., Any],
    load: Callable[..., Any],
) -> Callable[..., Any]:
    @piece
    def update(s, w, gone, entries, p):
        """As without rows; what those that vanish had is shared out to those that appear."""
        if not room(s, w, gone, entries, p):
            return False
        a, b = s.count[FIRST], s.count[SECOND]
        i = j = np.int64(0)
        empty(w)
        if gone == BOTH:
            i, j = size(s, w, a), size(s, w, b)
            load(w, a)
            load(w, b)
            take(s, w, max(a, b))
            take(s, w, min(a, b))
            s.count[PARTICLES] -= 2
        elif gone > 0:
            place = a if gone == ONE else b
            i = size(s, w, place)
            load(w, place)
            take(s, w, place)
            s.count[PARTICLES] -= 1
        total = i + j
        if gone == 0 and entries > 0:
            total = s.sizes[0]
            fill_from_source(s, w, total)
        for e in range(entries):
            s.count[PARTICLES] += s.counts[e]
            for _ in range(s.counts[e]):
                share_out(s, w, s.sizes[e], total)
                total -= s.sizes[e]
                put(s, w, s.sizes[e], np.int64(1), i, j, p)
                i = j = np.int64(0)
        if total > 0:
            leave(w, total)
        return True

    return update


def pieces_of(
    store: Store, draw: Any, prepare: Any, burst: Burst | None = None, *, cold: bool = False
) -> Pieces:
    """Return what a loop needs of a store and of how pairs are drawn from it.

    A `cold` update is not inlined into the loop: its calls are few beside what it does.
    """
    if store.load is not None:
        update = _make_carrying_update(store.size, store.room, store.take, store.put, store.load)
    else:
        update = _make_update(
            store.size,
            store.room,
            store.take,
            store.put,
            store.exchange or _never,
            cold_piece if cold else piece,
        )
    return Pieces(
        store.view,
        draw,
        _make_pair(store.size),
        update,
        prepare,
        _make_double(store.double),
        store.pick,
        select,
        store.visit,
        burst,
    )
