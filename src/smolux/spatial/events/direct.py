"""Event after event, all discs moved at each: the loop of the two reference methods."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from smolux.jit.compile import cold_piece, entry, piece

from .geometry import (
    FILLED,
    NARROW,
    add_axis,
    apart,
    contact_time,
    largest,
    other_image,
    power,
    shift,
    smaller,
    wall_time,
)
from .grid import insert, neighbour

# Entries of Discs.clock.
TIME = 0
CLUSTERS = 1
LATEST = 2  # time of the latest merge
EDGE = 3  # until when the pairs looked at suffice
SCALE = 4  # largest speed at the start
CLOCKS = 5

# Why a loop returned.
DONE = 0
BUDGET = 1
AT_REST = 2  # nothing moves, or all together
LONELY = 3  # no merge for too long

#: differences of velocity below this share of the largest speed come from rounding
REST = 1e-13


class Events(NamedTuple):
    """Room for events, see `smolux.spatial.results.trace.Log`."""

    time: np.ndarray
    first: np.ndarray
    second: np.ndarray


class Discs(NamedTuple):
    """Discs on their way, the box, the grid of the cells and some scratch of length d.

    The `axes`, 0 to d - 1, are known to the compiler: loops over axes are unrolled.
    """

    axes: tuple[int, ...]
    clock: np.ndarray
    x: np.ndarray
    v: np.ndarray
    label: np.ndarray
    mass: np.ndarray
    size: np.ndarray
    radius: np.ndarray
    room: np.ndarray
    length: np.ndarray
    period: np.ndarray
    cells: np.ndarray
    head: np.ndarray
    following: np.ndarray
    binned: np.ndarray
    move: np.ndarray
    mean: np.ndarray


@piece
def pair_time(discs, i, j, images):
    """Time to the contact of two discs, from the nearest image or the `images` nearest."""
    d = len(discs.axes)
    s, best = discs.radius[i] + discs.radius[j], math.inf
    for code in range(images):
        sums = apart(s)
        for k in range(d):
            dx = discs.x[j, k] - discs.x[i, k]
            dx += shift(dx, discs.period[k])
            if code & (1 << k):
                dx += other_image(dx, discs.period[k])
            sums = add_axis(sums, dx, discs.v[j, k] - discs.v[i, k])
        best = smaller(best, contact_time(sums, s))
    return best


@piece
def images_of(discs, widest):
    """How many images of a disc to look at, and the gap to any other one along periodic axes."""
    d = len(discs.axes)
    images, gap = 1, math.inf
    for k in range(d):
        period = discs.period[k]
        if period > 0.0 and 0.5 * period - widest < NARROW * widest:
            images = 1 << d
            gap = smaller(gap, period - widest)
        elif period > 0.0:
            gap = smaller(gap, 0.5 * period - widest)
    return images, gap


@piece
def fastest(discs):
    """Largest speed; never grows, as merging averages velocities."""
    d = len(discs.axes)
    square = 0.0
    for i in range(discs.x.shape[0]):
        s = 0.0
        for k in range(d):
            s += discs.v[i, k] ** 2
        square = max(square, s)
    return math.sqrt(square)


@cold_piece
def search_all_pairs(discs, best, widest):
    """Time to the next contact and its discs, over all pairs; `best` and -1 if none is before."""
    first, second = np.int64(-1), np.int64(-1)
    n = discs.x.shape[0]
    # beyond this reach other images than those looked at may come first
    images, reach = images_of(discs, widest)
    if reach < math.inf:
        best = min(best, reach / (2.0 * fastest(discs)))
    for i in range(n):
        for j in range(i + 1, n):
            if discs.label[i] != discs.label[j]:
                t = pair_time(discs, i, j, images)
                if t < best or (t == best and first < 0):
                    best, first, second = t, np.int64(i), np.int64(j)
    return best, first, second


@piece
def bin_all(discs):
    """Put all discs into their cells."""
    d = len(discs.axes)
    discs.head[:] = -1
    for i in range(discs.x.shape[0]):
        for k in range(d):
            x, period = discs.x[i, k], discs.period[k]
            discs.binned[i, k] = x - period * math.floor(x / period) if period > 0.0 else x
        insert(i, discs.binned[i], discs.length, discs.cells, discs.head, discs.following)


@piece
def reach_of_cells(discs, widest):
    """Images to look at, and the gap of two discs at least if their cells are no neighbours."""
    d = len(discs.axes)
    side = math.inf
    for k in range(d):
        if discs.cells[k] > 1:
            side = min(side, discs.length[k] / discs.cells[k])
    # nor may another image come first
    images, gap = images_of(discs, widest)
    return images, min(side - widest, gap)


@cold_piece
def search_cells(discs, best, widest):
    """Time to the next contact and its discs, over pairs in neighbouring cells; else as above."""
    clock = discs.clock
    images, gap = reach_of_cells(discs, widest)
    if clock[TIME] >= clock[EDGE]:
        bin_all(discs)
        # the gap closes at twice the largest speed at most
        clock[EDGE] = clock[TIME] + gap / (2.0 * fastest(discs))
    best = min(best, clock[EDGE] - clock[TIME])
    first, second = np.int64(-1), np.int64(-1)
    for i in range(discs.x.shape[0]):
        for code in range(power(3, discs.axes)):
            c = neighbour(discs.binned[i], code, discs.length, discs.period, discs.cells)
            j = np.int64(discs.head[c] if c >= 0 else -1)
            while j >= 0:
                if j > i and discs.label[i] != discs.label[j]:
                    t = pair_time(discs, i, j, images)
                    earlier = first < 0 or (first == i and j < second)
                    if t < best or (t == best and earlier):
                        best, first, second = t, np.int64(i), j
                j = np.int64(discs.following[j])
    return best, first, second


@piece
def next_wall(discs):
    """Time to the next touch of a wall, the disc and the axis."""
    d = len(discs.axes)
    best, disc, axis = math.inf, -1, -1
    for i in range(discs.x.shape[0]):
        for k in range(d):
            if discs.period[k] == 0.0:
                x, room = discs.x[i, k], discs.room[i]
                t = wall_time(x - room, x + room, discs.v[i, k], discs.length[k])
                if t < best:
                    best, disc, axis = t, i, k
    return best, disc, axis


@piece
def still(discs):
    """Whether nothing can meet: no motion along reflecting axes, one along periodic ones."""
    d = len(discs.axes)
    for k in range(d):
        low, high = discs.v[0, k], discs.v[0, k]
        for i in range(discs.x.shape[0]):
            low, high = min(low, discs.v[i, k]), max(high, discs.v[i, k])
        spread = high - low if discs.period[k] > 0.0 else max(high, -low)
        if spread > REST * discs.clock[SCALE]:
            return False
    return True


@piece
def reflect(discs, disc, axis):
    """Turn the cluster of a disc back; return what to log."""
    d = len(discs.axes)
    label, low, high = discs.label[disc], math.inf, -math.inf
    for i in range(discs.x.shape[0]):
        if discs.label[i] == label:
            low = min(low, discs.x[i, axis] - discs.room[i])
            high = max(high, discs.x[i, axis] + discs.room[i])
    fills = high - low >= discs.length[axis] * (1.0 - FILLED)
    for i in range(discs.x.shape[0]):
        if discs.label[i] == label:
            discs.v[i, axis] = 0.0 if fills else -discs.v[i, axis]
    return -1 - axis - (d if fills else 0)


@piece
def merge(discs, first, second):
    """Make one cluster of those of two discs; the larger one keeps its images."""
    d = len(discs.axes)
    a, b = discs.label[first], discs.label[second]
    sign = 1.0
    if discs.size[b] > discs.size[a]:
        a, b, sign = b, a, -1.0
    ma, mb = discs.mass[a], discs.mass[b]
    for k in range(d):
        discs.move[k] = sign * shift(discs.x[second, k] - discs.x[first, k], discs.period[k])
        v = (ma * discs.v[a, k] + mb * discs.v[b, k]) / (ma + mb)
        discs.mean[k] = v
    for i in range(discs.x.shape[0]):
        label = discs.label[i]
        if label in (a, b):
            for k in range(d):
                discs.v[i, k] = discs.mean[k]
                if label == b:
                    discs.x[i, k] += discs.move[k]
            discs.label[i] = a
    discs.mass[a] = ma + mb
    discs.size[a] += discs.size[b]


@piece
def move_all(discs, dt):
    """Move all discs on."""
    for i in range(discs.x.shape[0]):
        for k in range(len(discs.axes)):
            discs.x[i, k] += discs.v[i, k] * dt


def bind(search):
    """Bind the loop of a reference method to its search for the next contact."""

    def advance(discs, log, until, target, patience, budget):
        clock = discs.clock
        widest, longest = 2.0 * largest(discs.radius), largest(discs.length)
        done = 0
        while clock[CLUSTERS] > target and clock[TIME] < until:
            if done == budget or done == log.time.shape[0]:
                return BUDGET, done
            if still(discs):
                return AT_REST, done
            if (clock[TIME] - clock[LATEST]) * fastest(discs) > patience * longest:
                return LONELY, done
            wall, disc, axis = next_wall(discs)
            left = until - clock[TIME]
            dt, first, second = search(discs, min(wall, left), widest)
            move_all(discs, dt)
            clock[TIME] = until if dt == left else clock[TIME] + dt
            if first >= 0:
                merge(discs, first, second)
                clock[CLUSTERS] -= 1
                clock[LATEST] = clock[TIME]
            elif dt == wall:
                # of the discs of a cluster always the same
                first = np.int64(discs.label[disc])
                second = np.int64(reflect(discs, disc, axis))
            else:  # only the pairs to look at change
                continue
            log.time[done] = clock[TIME]
            log.first[done], log.second[done] = first, second
            done += 1
        return DONE, done

    return entry(advance)


by_all_pairs = bind(search_all_pairs)
by_cells = bind(search_cells)
