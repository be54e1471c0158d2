"""The pairs that may meet: listed by cluster, as half-edges."""

from __future__ import annotations

from ...core.compile import piece
from .flight import (
    AFTER,
    BEFORE,
    BLOCK,
    CLUSTER,
    EDGE,
    FREE,
    FULL,
    LAST_EDGE,
    ONE,
    PAIR,
    PAIRS,
    TWO,
    USED,
    VERSION,
)


@piece
def link(f, h, c):
    """Put a half-edge into the list of a cluster."""
    top = f.group[c, EDGE]
    f.link[h, BEFORE] = -1
    f.link[h, AFTER] = top
    if top >= 0:
        f.link[top, BEFORE] = h
    else:
        f.group[c, LAST_EDGE] = h
    f.group[c, EDGE] = h


@piece
def unlink(f, h, c):
    """Take a half-edge out of the list of a cluster."""
    before, after = f.link[h, BEFORE], f.link[h, AFTER]
    if before >= 0:
        f.link[before, AFTER] = after
    else:
        f.group[c, EDGE] = after
    if after >= 0:
        f.link[after, BEFORE] = before
    else:
        f.group[c, LAST_EDGE] = before


@piece
def add(f, i, j, a, b):
    """List a pair of discs of two clusters."""
    p = f.count[FREE]
    if p >= 0:
        f.count[FREE] = f.link[2 * p, AFTER]
    elif f.count[USED] < f.pair.shape[0]:
        p = f.count[USED]
        f.count[USED] = p + 1
    else:
        f.count[FULL] = PAIR
        return
    f.pair[p, ONE], f.pair[p, TWO] = i, j
    link(f, 2 * p, a)
    link(f, 2 * p + 1, b)
    f.count[PAIRS] += 1


@piece
def remove(f, p, a, b):
    """Strike a pair off; what was predicted for it is out of date."""
    unlink(f, 2 * p, a)
    unlink(f, 2 * p + 1, b)
    f.pair[p, VERSION] += 1
    f.link[2 * p, AFTER] = f.count[FREE]
    f.count[FREE] = p
    f.count[PAIRS] -= 1


@piece
def remove_all(f, c):
    """Strike all pairs of a cluster off."""
    h = f.group[c, EDGE]
    while h >= 0:
        p = h >> 1
        after = f.link[h, AFTER]
        if after == h ^ 1:  # a pair inside the cluster
            after = f.link[after, AFTER]
        remove(
            f,
            p,
            f.block[f.disc[f.pair[p, ONE], BLOCK], CLUSTER],
            f.block[f.disc[f.pair[p, TWO], BLOCK], CLUSTER],
        )
        h = after


@piece
def splice(f, a, b):
    """Give all pairs of cluster `b` to cluster `a`."""
    if f.group[b, EDGE] < 0:
        return
    if f.group[a, EDGE] < 0:
        f.group[a, EDGE], f.group[a, LAST_EDGE] = f.group[b, EDGE], f.group[b, LAST_EDGE]
    else:
        top = f.group[a, EDGE]
        f.link[f.group[b, LAST_EDGE], AFTER] = top
        f.link[top, BEFORE] = f.group[b, LAST_EDGE]
        f.group[a, EDGE] = f.group[b, EDGE]
    f.group[b, EDGE] = f.group[b, LAST_EDGE] = -1
