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
def cluster_of(f, i):
    """Cluster of a disc."""
    return f.block[f.disc[i, BLOCK], CLUSTER]


@piece
def link(f, h, c):
    """Put a half-edge into the list of a cluster."""
    group, link = f.group, f.link
    top = group[c, EDGE]
    link[h, BEFORE] = -1
    link[h, AFTER] = top
    if top >= 0:
        link[top, BEFORE] = h
    else:
        group[c, LAST_EDGE] = h
    group[c, EDGE] = h


@piece
def unlink(f, h, c):
    """Take a half-edge out of the list of a cluster."""
    link, group = f.link, f.group
    before, after = link[h, BEFORE], link[h, AFTER]
    if before >= 0:
        link[before, AFTER] = after
    else:
        group[c, EDGE] = after
    if after >= 0:
        link[after, BEFORE] = before
    else:
        group[c, LAST_EDGE] = before


@piece
def add(f, i, j, a, b):
    """List a pair of discs of two clusters."""
    pair, count = f.pair, f.count
    p = count[FREE]
    if p >= 0:
        count[FREE] = f.link[2 * p, AFTER]
    elif count[USED] < pair.shape[0]:
        p = count[USED]
        count[USED] = p + 1
    else:
        count[FULL] = PAIR
        return
    pair[p, ONE], pair[p, TWO] = i, j
    link(f, 2 * p, a)
    link(f, 2 * p + 1, b)
    count[PAIRS] += 1


@piece
def remove(f, p, a, b):
    """Strike a pair off; what was predicted for it is out of date."""
    count = f.count
    unlink(f, 2 * p, a)
    unlink(f, 2 * p + 1, b)
    f.pair[p, VERSION] += 1
    f.link[2 * p, AFTER] = count[FREE]
    count[FREE] = p
    count[PAIRS] -= 1


@piece
def remove_all(f, c):
    """Strike all pairs of a cluster off."""
    link, pair = f.link, f.pair
    h = f.group[c, EDGE]
    while h >= 0:
        p = h >> 1
        after = link[h, AFTER]
        if after == h ^ 1:  # a pair inside the cluster
            after = link[after, AFTER]
        remove(f, p, cluster_of(f, pair[p, ONE]), cluster_of(f, pair[p, TWO]))
        h = after


@piece
def splice(f, a, b):
    """Give all pairs of cluster `b` to cluster `a`."""
    group, link = f.group, f.link
    if group[b, EDGE] < 0:
        return
    if group[a, EDGE] < 0:
        group[a, EDGE], group[a, LAST_EDGE] = group[b, EDGE], group[b, LAST_EDGE]
    else:
        top = group[a, EDGE]
        link[group[b, LAST_EDGE], AFTER] = top
        link[top, BEFORE] = group[b, LAST_EDGE]
        group[a, EDGE] = group[b, EDGE]
    group[b, EDGE] = group[b, LAST_EDGE] = -1
