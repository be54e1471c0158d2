"""A binary heap of contacts and reflections, with entries that may be out of date."""

from __future__ import annotations

import numpy as np

from smolux.jit.compile import cold_piece, piece

from .flight import (
    DISC,
    EVENT,
    FULL,
    HEAP,
    NAME,
    STAMP,
    VERSION,
    WHAT,
    WHICH,
)
from .geometry import larger, smaller


@cold_piece
def earlier_of_equals(f, a, b):
    """Which of two events at one time comes first: contacts by their discs, then reflections."""
    disc, half_edge = f.disc, f.half_edge
    if a < 0 or b < 0:
        return a > b
    i, j = disc[half_edge[2 * a, DISC], NAME], disc[half_edge[2 * a + 1, DISC], NAME]
    k, m = disc[half_edge[2 * b, DISC], NAME], disc[half_edge[2 * b + 1, DISC], NAME]
    low, other = smaller(i, j), smaller(k, m)
    return low < other or (low == other and larger(i, j) < larger(k, m))


@piece
def precedes(f, t, a, u, b):
    """Whether an event comes before another."""
    return t < u or (t == u and earlier_of_equals(f, a, b))


@piece
def put(f, k, t, what, which):
    """Write an event at a place of the heap."""
    f.when[k], f.event[k, WHAT], f.event[k, WHICH] = t, what, which


@piece
def move(f, k, to):
    """Copy the event at a place of the heap to another one."""
    put(f, to, f.when[k], f.event[k, WHAT], f.event[k, WHICH])


@piece
def sift_down(f, k, n, t, what, which):
    """Put an event into the heap at place `k` or below."""
    when, event = f.when, f.event
    while True:
        child = 2 * k + 1
        if child >= n:
            break
        right = child + 1
        if right < n and precedes(
            f, when[right], event[right, WHAT], when[child], event[child, WHAT]
        ):
            child = right
        if not precedes(f, when[child], event[child, WHAT], t, what):
            break
        move(f, child, k)
        k = child
    put(f, k, t, what, which)


@piece
def is_current(f, what, which):
    """Whether nothing has changed since an event was predicted."""
    return (
        f.half_edge[2 * what, VERSION] == which if what >= 0 else f.group[-1 - what, STAMP] == which
    )


@cold_piece
def compact(f):
    """Throw out what is out of date; ask for more room if that does not free a quarter."""
    event, when, count = f.event, f.when, f.count
    kept = 0
    for k in range(count[HEAP]):
        if is_current(f, np.int64(event[k, WHAT]), event[k, WHICH]):
            move(f, k, kept)
            kept += 1
    for k in range(kept // 2 - 1, -1, -1):
        sift_down(f, k, kept, when[k], event[k, WHAT], event[k, WHICH])
    count[HEAP] = kept
    if 4 * kept > 3 * when.shape[0]:
        count[FULL] = EVENT


@piece
def push(f, t, number, which):
    """Add an event."""
    when, event, count = f.when, f.event, f.count
    what = np.int32(number)
    if count[HEAP] == when.shape[0]:
        compact(f)
        if count[FULL]:
            return
    k = count[HEAP]
    count[HEAP] = k + 1
    while k > 0:
        up = (k - 1) // 2
        if not precedes(f, t, what, when[up], event[up, WHAT]):
            break
        move(f, up, k)
        k = up
    put(f, k, t, what, which)


@piece
def pop(f):
    """Take out the first event, which the caller has read."""
    event = f.event
    n = f.count[HEAP] - 1
    f.count[HEAP] = n
    if n > 0:
        sift_down(f, np.int64(0), n, f.when[n], event[n, WHAT], event[n, WHICH])
