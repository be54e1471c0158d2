"""A binary heap of contacts and reflections, with entries that may be out of date."""

from __future__ import annotations

from ...core.compile import cold_piece, piece
from .flight import (
    EVENT,
    FULL,
    HEAP,
    NAME,
    ONE,
    STAMP,
    TWO,
    VERSION,
    WHAT,
    WHICH,
)


@cold_piece
def earlier_of_equals(f, a, b):
    """Which of two events at one time comes first: contacts by their discs, then reflections."""
    if a < 0 or b < 0:
        return a > b
    i, j = f.disc[f.pair[a, ONE], NAME], f.disc[f.pair[a, TWO], NAME]
    k, m = f.disc[f.pair[b, ONE], NAME], f.disc[f.pair[b, TWO], NAME]
    return (min(i, j), max(i, j)) < (min(k, m), max(k, m))


@piece
def precedes(f, t, a, u, b):
    """Whether an event comes before another."""
    return t < u or (t == u and earlier_of_equals(f, a, b))


@piece
def sift_down(f, k, n, t, what, which):
    """Put an event into the heap at place `k` or below."""
    while True:
        child = 2 * k + 1
        if child >= n:
            break
        right = child + 1
        if right < n and precedes(
            f, f.when[right], f.event[right, WHAT], f.when[child], f.event[child, WHAT]
        ):
            child = right
        if not precedes(f, f.when[child], f.event[child, WHAT], t, what):
            break
        f.when[k], f.event[k, WHAT], f.event[k, WHICH] = (
            f.when[child],
            f.event[child, WHAT],
            f.event[child, WHICH],
        )
        k = child
    f.when[k], f.event[k, WHAT], f.event[k, WHICH] = t, what, which


@piece
def is_current(f, what, which):
    """Whether nothing has changed since an event was predicted."""
    return f.pair[what, VERSION] == which if what >= 0 else f.group[-1 - what, STAMP] == which


@cold_piece
def compact(f):
    """Throw out what is out of date; ask for more room if that does not free a quarter."""
    kept = 0
    for k in range(f.count[HEAP]):
        if is_current(f, f.event[k, WHAT], f.event[k, WHICH]):
            f.when[kept], f.event[kept, WHAT], f.event[kept, WHICH] = (
                f.when[k],
                f.event[k, WHAT],
                f.event[k, WHICH],
            )
            kept += 1
    for k in range(kept // 2 - 1, -1, -1):
        sift_down(f, k, kept, f.when[k], f.event[k, WHAT], f.event[k, WHICH])
    f.count[HEAP] = kept
    if 4 * kept > 3 * f.when.shape[0]:
        f.count[FULL] = EVENT


@piece
def push(f, t, what, which):
    """Add an event."""
    if f.count[HEAP] == f.when.shape[0]:
        compact(f)
        if f.count[FULL]:
            return
    k = f.count[HEAP]
    f.count[HEAP] = k + 1
    while k > 0:
        up = (k - 1) // 2
        if not precedes(f, t, what, f.when[up], f.event[up, WHAT]):
            break
        f.when[k], f.event[k, WHAT], f.event[k, WHICH] = (
            f.when[up],
            f.event[up, WHAT],
            f.event[up, WHICH],
        )
        k = up
    f.when[k], f.event[k, WHAT], f.event[k, WHICH] = t, what, which


@piece
def pop(f):
    """Take out the first event, which the caller has read."""
    n = f.count[HEAP] - 1
    f.count[HEAP] = n
    if n > 0:
        sift_down(f, 0, n, f.when[n], f.event[n, WHAT], f.event[n, WHICH])
