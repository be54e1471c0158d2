"""The state of the windowed method: discs in blocks, blocks in clusters, pairs, a heap of events.

A *block* is a few neighbouring discs of one cluster, or one disc. Where a disc is at a time t::

    rel[disc] + place[block] + body[cluster, :d] + body[cluster, d:2 d] * (t - since)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# Entries of Flight.clock.
TIME = 0
LATEST = 1  # time of the latest merge
SCALE = 2  # largest speed at the start
SKIN = 3  # pairs whose surfaces are nearer than this are listed
BUDGET_OF_WAY = 4  # way of a cluster until the next listing: half of the skin
WINDOW = 5  # end of the window
LONGEST = 6  # longest side of the box
THICKEST = 7  # the skin is at most this thick
USUAL = 8  # mean diameter
CLOCKS = 9

# Entries of Flight.count.
CLUSTERS = 0
SPREAD = 1  # 0 if all radii are equal: then only one is stored
FREE = 2  # first free pair
USED = 3  # pairs that were ever used
PAIRS = 4  # pairs listed now
HEAP = 5  # entries of the heap
FULL = 6  # what there is no room for: PAIR or EVENT
BATCH = 7  # number of the latest listing of some clusters
WINDOWS = 8
LISTED = 9  # blocks listed
CHECKED = 10  # pairs of blocks and of discs looked at
PREDICTED = 11  # contacts predicted
REBUILT = 12  # listings of everything at once
RELABELLED = 13  # blocks that changed their cluster
MARK_LISTED = 14  # the same when the skin was last judged
MARK_CHECKED = 15
MARK_PREDICTED = 16
PACKED = 17  # window before which discs were put into the order of space
IMAGES = 18  # of a disc to be looked at: 1, or the nearest two along each axis
COUNTS = 19

# Columns of Flight.body after displacement and velocity, which take 2 d.
SINCE = 0  # time of the displacement
HORIZON = 1  # until when contacts are predicted
MASS = 2  # 0: merged into another one
WAY = 3  # of the cluster since its listing
BODY = 4

#: pairs whose discs, blocks and clusters are fetched together
LOT = 32
# Columns of Flight.lot: half-edge, block of each end, cluster of each end.
HALF, NEAR_BLOCK, FAR_BLOCK, NEAR_CLUSTER, FAR_CLUSTER = 0, 1, 2, 3, 4
LOT_COLUMNS = 5

# Values of count[FULL].
PAIR, EVENT = 1, 2

# Why the loop returned.
DONE = 0
BUDGET = 1
AT_REST = 2
LONELY = 3
NO_PAIRS = 4  # no room for pairs
NO_EVENTS = 5  # no room for events
RESKIN = 6  # blocks are to be made anew, for the skin of the clock


# Columns of Flight.disc.
NAME, BLOCK = 0, 1

# Columns of Flight.block: first disc, cluster, next block of the cluster, cell, next block of the
# cell, level of the radius of its discs, counted from the smallest discs on.
FIRST, CLUSTER, CHAIN, CELL, NEXT, LEVEL = 0, 1, 2, 3, 4, 5
BLOCK_COLUMNS = 6

# Columns of Flight.cells after the numbers of cells, which take d: the first place in head, and 1
# if there are more than two cells along each axis.
OFFSET, FORWARD = 0, 1
# Columns of Flight.scale after the cells in a unit of length: the largest diameter, and half the
# largest extension of the centres of a block.
WIDEST, EXTENT = 0, 1

# A bit of Flight.head.
MIXED = np.int32(1 << 30)

# Columns of Flight.group: first and last block, number of blocks and of discs, first and last
# half-edge, number of the latest state, and of the listing: 2 n to be listed in batch n, 2 n + 1
# once batch n is listed.
START, END, BLOCKS, DISCS, EDGE, LAST_EDGE, STAMP, LISTED_IN = 0, 1, 2, 3, 4, 5, 6, 7
GROUP_COLUMNS = 8

# Columns of Flight.half_edge: half-edges before and after in the list of a cluster, the disc. Pair
# p has half-edges 2 p and 2 p + 1; the first has the number of the latest prediction of the pair.
BEFORE, AFTER, DISC, VERSION = 0, 1, 2, 3
EDGE_COLUMNS = 4

# Columns of Flight.event. WHAT is a pair, or -1 - the number of a cluster; an event is out of date
# unless WHICH is the version of the pair or the state of the cluster.
WHAT, WHICH = 0, 1


class Flight(NamedTuple):
    """All clusters on their way.

    Attributes
    ----------
    axes : tuple of d integers
        The axes 0 to d - 1. The compiler knows how many there are, so that loops over axes are
        unrolled.
    clock, count : of shape (CLOCKS,), (COUNTS,)
    length, period : of shape (d,)
        The box.
    cells, scale : of shape (L, d + 2)
        A grid for each level of radii: the cells along each axis, and those in a unit of length.
    rel, radius, disc : of shape (N, d), (N,) or (1,), (N, 2)
        Discs, in the order of space.
    block, place, half : of shape (B + 1, 6), (B, d), (B, d)
        Blocks; half the extension of their centres.
    head : of shape (C,)
        First block of each cell of all grids; with the bit MIXED, if there may be other clusters
        than its own.
    body, bound, group : of shape (G, 2 d + 4), (G, 2 d), (G, 8)
        Clusters; their lower and upper bounds, less the displacement.
    half_edge : of shape (2 P, 4)
    when, event : of shape (E,), (E, 2)
        The heap.
    lot : of shape (LOT, 5)
        Work space.
    """

    axes: tuple[int, ...]
    clock: np.ndarray
    count: np.ndarray  # type: ignore[assignment]
    length: np.ndarray
    period: np.ndarray
    cells: np.ndarray
    scale: np.ndarray
    rel: np.ndarray
    radius: np.ndarray
    disc: np.ndarray
    block: np.ndarray
    place: np.ndarray
    half: np.ndarray
    head: np.ndarray
    body: np.ndarray
    bound: np.ndarray
    group: np.ndarray
    half_edge: np.ndarray
    when: np.ndarray
    event: np.ndarray
    lot: np.ndarray
