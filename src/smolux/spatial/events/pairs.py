"""The pairs that may meet: listed by cluster, as half-edges."""

from __future__ import annotations

from smolux.jit.compile import piece

from .flight import (
    AFTER,
    BEFORE,
    BLOCK,
    CLUSTER,
    DISC,
    EDGE,
    FREE,
    FULL,
    LAST_EDGE,
    PAIR,
    PAIRS,
    USED,
    VERSION,
)

#: before a half-edge that is in no list
GONE = -2


@piece
def cluster_of(f, i):
    """Cluster of a disc."""
    return f.block[f.disc[i, BLOCK], CLUSTER]


@piece
def link(f, h, c):
    """Put a half-edge into the list of a cluster."""
    group, half_edge = f.group, f.half_edge
    top = group[c, EDGE]
    half_edge[h, BEFORE] = -1
    half_edge[h, AFTER] = top
    if top >= 0:
        half_edge[top, BEFORE] = h
    else:
        group[c, LAST_EDGE] = h
    group[c, EDGE] = h


@piece
def unlink(f, h, c):
    """Take a half-edge out of the list of a cluster."""
    half_edge, group = f.half_edge, f.group
    before, after = half_edge[h, BEFORE], half_edge[h, AFTER]
    if before >= 0:
        half_edge[before, AFTER] = after
    else:
        group[c, EDGE] = after
    if after >= 0:
        half_edge[after, BEFORE] = before
    else:
        group[c, LAST_EDGE] = before


@piece
def add(f, i, j, a, b):
    """List a pair of discs of two clusters."""
    half_edge, count = f.half_edge, f.count
    p = count[FREE]
    if p >= 0:
        count[FREE] = f.half_edge[2 * p, AFTER]
    elif 2 * count[USED] + 1 < half_edge.shape[0]:
        p = count[USED]
        count[USED] = p + 1
    else:
        count[FULL] = PAIR
        return
    half_edge[2 * p, DISC], half_edge[2 * p + 1, DISC] = i, j
    link(f, 2 * p, a)
    link(f, 2 * p + 1, b)
    count[PAIRS] += 1


@piece
def remove(f, p, a, b):
    """Strike a pair off; what was predicted for it is out of date."""
    count = f.count
    unlink(f, 2 * p, a)
    unlink(f, 2 * p + 1, b)
    f.half_edge[2 * p, VERSION] += 1
    f.half_edge[2 * p, AFTER] = count[FREE]
    count[FREE] = p
    count[PAIRS] -= 1


@piece
def drop(f, h, c):
    """Take a half-edge of a pair inside a cluster out of its list; strike it off with the other.

    The one that goes first is marked, and keeps its place behind the walk through the list.
    """
    half_edge, count = f.half_edge, f.count
    p = h >> 1
    unlink(f, h, c)
    half_edge[2 * p, VERSION] += 1
    if half_edge[h ^ 1, BEFORE] != GONE:
        half_edge[h, BEFORE] = GONE
    else:
        half_edge[2 * p, AFTER] = count[FREE]
        count[FREE] = p
        count[PAIRS] -= 1


@piece
def remove_all(f, c):
    """Strike all pairs of a cluster off."""
    half_edge = f.half_edge
    h = f.group[c, EDGE]
    while h >= 0:
        p = h >> 1
        after = half_edge[h, AFTER]
        if after == h ^ 1:  # a pair inside the cluster
            after = half_edge[after, AFTER]
        remove(
            f, p, cluster_of(f, half_edge[2 * p, DISC]), cluster_of(f, half_edge[2 * p + 1, DISC])
        )
        h = after


@piece
def splice(f, a, b):
    """Give all pairs of cluster `b` to cluster `a`."""
    group, half_edge = f.group, f.half_edge
    if group[b, EDGE] < 0:
        return
    if group[a, EDGE] < 0:
        group[a, EDGE], group[a, LAST_EDGE] = group[b, EDGE], group[b, LAST_EDGE]
    else:
        top = group[a, EDGE]
        half_edge[group[b, LAST_EDGE], AFTER] = top
        half_edge[top, BEFORE] = group[b, LAST_EDGE]
        group[a, EDGE] = group[b, EDGE]
    group[b, EDGE] = group[b, LAST_EDGE] = -1
