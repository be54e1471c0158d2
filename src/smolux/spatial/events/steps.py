"""Time steps: clusters fly, walls turn them back, pairs that may overlap are looked at.

A cluster is an offset, added to the places of its discs, so that moving it costs nothing by disc.
Pairs of discs of different clusters nearer than a skin are listed. How far any disc can have moved
since is the *way*: a pair with the gap g need not be looked at before the way has grown by g / 2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from smolux.jit.compile import cold_piece, piece

from .geometry import FILLED, larger, power, shift, smaller
from .grid import insert, neighbour

# Entries of Steps.clock.
TIME = 0
WAY = 1  # since the last listing
SKIN = 2
DUE = 3  # way at which the next pair is to be looked at
LATEST = 4  # time of the latest merge
SCALE = 5  # largest speed at the start
WIDEST = 6
REACH = 7  # diameters up to which discs know of each other in a minimisation
THINNEST = 8
THICKEST = 9
CLOCKS = 10

# Entries of Steps.count.
CLUSTERS = 0
PAIRS = 1
EDGES = 2
STEPS = 3
FAILURES = 4
MINIMISATIONS = 5
ITERATIONS = 6
LISTINGS = 7
CHECKED = 8  # distances in the latest listing
WORK = 9  # pairs looked at since
TOUCHED = 10
CONTACTS = 11
SLOTS = 12
NEARS = 13
COUNTS = 14


class Steps(NamedTuple):
    """Discs, clusters, lists, and what a step needs to be taken back.

    The `axes`, 0 to d - 1, are known to the compiler: loops over axes are unrolled.
    """

    axes: tuple[int, ...]
    clock: np.ndarray
    count: np.ndarray  # type: ignore[assignment]
    length: np.ndarray
    period: np.ndarray
    # by disc
    x: np.ndarray
    radius: np.ndarray
    room: np.ndarray
    inertia: np.ndarray  # mass of a disc
    label: np.ndarray
    member: np.ndarray  # the next one of a cluster, in a ring
    binned: np.ndarray
    following: np.ndarray
    edge: np.ndarray  # the first half-edge
    slot: np.ndarray
    # by cluster
    off: np.ndarray
    v: np.ndarray
    low: np.ndarray
    high: np.ndarray
    mass: np.ndarray
    size: np.ndarray
    alive: np.ndarray
    rank: np.ndarray  # place in alive
    saved_off: np.ndarray
    saved_v: np.ndarray
    comp: np.ndarray
    drift: np.ndarray
    touched: np.ndarray
    # the grid
    cells: np.ndarray
    head: np.ndarray
    owner: np.ndarray
    # pairs that may overlap, contacts of a step, half-edges of links
    pair: np.ndarray
    due: np.ndarray
    contact: np.ndarray
    edge_to: np.ndarray
    edge_next: np.ndarray
    edge_force: np.ndarray


NONE, MIXED = -1, -2


@piece
def apart(s, i, j):
    """Distance of two discs, of the nearest images."""
    d = len(s.axes)
    a, b = s.label[i], s.label[j]
    square = 0.0
    for k in range(d):
        dx = s.x[j, k] + s.off[b, k] - s.x[i, k] - s.off[a, k]
        dx += shift(dx, s.period[k])
        square += dx * dx
    return math.sqrt(square)


@cold_piece
def fold(s):
    """Bring all discs to where they are, and find the bounds of clusters anew."""
    d = len(s.axes)
    n = s.x.shape[0]
    for i in range(n):
        c = s.label[i]
        for k in range(d):
            s.x[i, k] += s.off[c, k]
    for q in range(s.count[CLUSTERS]):
        c = s.alive[q]
        for k in range(d):
            s.off[c, k] = 0.0
            s.low[c, k], s.high[c, k] = math.inf, -math.inf
    for i in range(n):
        c = s.label[i]
        for k in range(d):
            s.low[c, k] = smaller(s.low[c, k], s.x[i, k] - s.room[i])
            s.high[c, k] = larger(s.high[c, k], s.x[i, k] + s.room[i])


@piece
def lay_grid(s, side):
    """Choose cells no narrower than `side`, as far as there is room for them, and empty them."""
    cells = np.int64(1)
    for k in range(len(s.axes)):
        s.cells[k] = larger(np.int64(s.length[k] / side), 1)
        while cells * s.cells[k] > s.head.shape[0]:
            s.cells[k] = larger(s.cells[k] // 2, 1)
        cells *= s.cells[k]
    s.head[:cells], s.owner[:cells] = -1, NONE


@piece
def bin_all(s, around):
    """Put all discs into their cells; note the cluster to which a cell belongs."""
    for i in range(s.x.shape[0]):
        for k in range(len(s.axes)):
            x, period = s.x[i, k], s.period[k]
            s.binned[i, k] = x - period * math.floor(x / period) if period > 0.0 else x
    for i in range(s.x.shape[0]):
        insert(i, s.binned[i], s.length, s.cells, s.head, s.following)
        c = neighbour(s.binned[i], (around - 1) // 2, s.length, s.period, s.cells)
        own = s.owner[c]
        s.owner[c] = s.label[i] if own == NONE or own == s.label[i] else MIXED


@cold_piece
def list_pairs(s):
    """List the pairs nearer than the skin; False if there is no room."""
    fold(s)
    skin, around = s.clock[SKIN], power(3, s.axes)
    # cells so wide that neighbours hold all discs that a disc may come to know of
    lay_grid(s, s.clock[REACH] * s.clock[WIDEST] + skin)
    bin_all(s, around)
    found, checked = 0, 0
    for i in range(s.x.shape[0]):
        for code in range(around):
            c = neighbour(s.binned[i], code, s.length, s.period, s.cells)
            if c < 0 or s.owner[c] == s.label[i]:
                continue
            j = np.int64(s.head[c])
            while j > i:  # a list goes from large numbers to small ones
                checked += 1
                if s.label[j] != s.label[i]:
                    gap = apart(s, i, j) - s.radius[i] - s.radius[j]
                    if gap < skin:
                        if found == s.due.shape[0]:
                            return False
                        s.pair[found, 0], s.pair[found, 1] = i, j
                        s.due[found] = 0.5 * gap
                        found += 1
                j = np.int64(s.following[j])
    s.count[PAIRS], s.count[CHECKED], s.count[WORK] = found, checked, 0
    s.count[LISTINGS] += 1
    s.clock[WAY], s.clock[DUE] = 0.0, -math.inf
    return True


@piece
def choose_skin(s):
    """Make listing and looking cost about the same, from what the last window cost."""
    listing = s.count[CHECKED] + 3 * s.x.shape[0]
    skin = s.clock[SKIN]
    if s.count[WORK] < listing and s.count[CHECKED] < 40 * s.x.shape[0]:
        skin *= 1.25
    elif s.count[WORK] > 2 * listing:
        skin /= 1.3
    s.clock[SKIN] = smaller(larger(skin, s.clock[THINNEST]), s.clock[THICKEST])


@cold_piece
def look(s):
    """Add pairs that overlap to the contacts; strike off those of one cluster."""
    way = s.clock[WAY]
    if way < s.clock[DUE]:
        return
    due, p, found, seen = math.inf, 0, s.count[CONTACTS], 0
    while p < s.count[PAIRS]:
        if s.due[p] <= way:
            seen += 1
            i, j = s.pair[p, 0], s.pair[p, 1]
            if s.label[i] == s.label[j]:
                last = s.count[PAIRS] - 1
                s.count[PAIRS] = last
                s.pair[p, 0], s.pair[p, 1] = s.pair[last, 0], s.pair[last, 1]
                s.due[p] = s.due[last]
                continue
            gap = apart(s, i, j) - s.radius[i] - s.radius[j]
            s.due[p] = way + 0.5 * gap
            if gap < 0.0:
                if found == s.contact.shape[0]:
                    break
                s.contact[found, 0], s.contact[found, 1] = i, j
                found += 1
        due = smaller(due, s.due[p])
        p += 1
    s.clock[DUE] = due
    s.count[CONTACTS] = found
    s.count[WORK] += seen + s.count[PAIRS] // 4


@piece
def reflect(s, c, k, dt, log, done, time):
    """Bring a cluster back between the walls of an axis; return the log's length, and a push.

    A cluster that a minimisation has pushed into a wall is moved further than it flew.
    """
    d = len(s.axes)
    length, v = s.length[k], s.v[c, k]
    low, high = s.low[c, k] + s.off[c, k], s.high[c, k] + s.off[c, k]
    free = length - (high - low)
    if free <= FILLED * length:
        move, new = 0.5 * free - low, 0.0
    else:
        y = low - 2.0 * free * math.floor(low / (2.0 * free))
        move = (2.0 * free - y if y > free else y) - low
        new = abs(v) if low < 0.0 else -abs(v)
    s.off[c, k] += move
    s.v[c, k] = new
    if new != v:
        log.time[done], log.first[done] = time, c
        log.second[done] = -1 - k - (d if new == 0.0 else 0)
        done += 1
    return done, larger(abs(move) - 2.0 * abs(v) * dt, 0.0)


@piece
def fly(s, dt, fastest, log, done):
    """Move all clusters over a step; return the log's length."""
    d = len(s.axes)
    time, pushed = s.clock[TIME] + dt, 0.0
    for q in range(s.count[CLUSTERS]):
        c = s.alive[q]
        for k in range(d):
            s.saved_off[c, k], s.saved_v[c, k] = s.off[c, k], s.v[c, k]
            s.off[c, k] += s.v[c, k] * dt
            if s.period[k] == 0.0 and (
                s.low[c, k] + s.off[c, k] < 0.0 or s.high[c, k] + s.off[c, k] > s.length[k]
            ):
                done, push = reflect(s, c, k, dt, log, done, time)
                pushed = larger(pushed, push)
    s.clock[WAY] += fastest * dt + math.sqrt(d) * pushed
    return done


@piece
def take_back(s):
    """Undo the flight of a step."""
    d = len(s.axes)
    for q in range(s.count[CLUSTERS]):
        c = s.alive[q]
        for k in range(d):
            s.off[c, k], s.v[c, k] = s.saved_off[c, k], s.saved_v[c, k]


@cold_piece
def merge(s, i, j):
    """Make one cluster of those of two discs; the smaller one comes to the larger one."""
    d = len(s.axes)
    if s.size[s.label[j]] > s.size[s.label[i]]:
        i, j = j, i
    a, b = s.label[i], s.label[j]
    ma, mb = s.mass[a], s.mass[b]
    for k in range(d):
        dx = s.x[j, k] + s.off[b, k] - s.x[i, k] - s.off[a, k]
        move = s.off[b, k] - s.off[a, k] + shift(dx, s.period[k])
        m = np.int64(j)
        for _ in range(s.size[b]):
            s.x[m, k] += move
            m = np.int64(s.member[m])
        s.low[a, k] = smaller(s.low[a, k], s.low[b, k] + move)
        s.high[a, k] = larger(s.high[a, k], s.high[b, k] + move)
        s.v[a, k] = (ma * s.v[a, k] + mb * s.v[b, k]) / (ma + mb)
    m = np.int64(j)
    for _ in range(s.size[b]):
        s.label[m] = a
        m = np.int64(s.member[m])
    s.member[i], s.member[j] = s.member[j], s.member[i]
    s.mass[a] = ma + mb
    s.size[a] += s.size[b]
    last = s.alive[s.count[CLUSTERS] - 1]
    s.alive[s.rank[b]], s.rank[last] = last, s.rank[b]
    s.count[CLUSTERS] -= 1
