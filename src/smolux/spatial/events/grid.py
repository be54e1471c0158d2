"""A grid of cells with a list of discs in each, for two and three dimensions."""

from __future__ import annotations

import math

import numpy as np

from smolux.core.rng import uniform
from smolux.jit.compile import entry, piece


@piece
def cell_along(x, length, cells):
    """Cell of a coordinate along one axis; what lies outside belongs to the outermost one."""
    return min(max(np.int64(x / length * cells), 0), cells - 1)


@piece
def cell_of(x, length, cells):
    """Return the number of the cell that holds a point."""
    c = np.int64(0)
    for k in range(x.shape[0]):
        c = c * cells[k] + cell_along(x[k], length[k], cells[k])
    return c


@piece
def neighbour(x, code, length, period, cells):
    """One of the ``3**d`` cells around that of a point, each but once; -1 if there is none.

    Along a periodic axis of one or two cells, neighbours on both sides are the same cell.
    """
    c = np.int64(0)
    for k in range(x.shape[0]):
        step = code % 3 - 1
        code //= 3
        n = cells[k]
        a = cell_along(x[k], length[k], n) + step
        if period[k] > 0.0:
            if (n == 1 and step != 0) or (n == 2 and step < 0):
                return np.int64(-1)
            a = (a + n) % n
        elif a < 0 or a >= n:
            return np.int64(-1)
        c = c * n + a
    return c


@piece
def separation(x, y, k, period):
    """Component of the shortest vector from one point to another."""
    d = y[k] - x[k]
    if period[k] > 0.0:
        d -= period[k] * math.floor(d / period[k] + 0.5)
    return d


@piece
def first_contact(x, r, centre, radius, length, period, cells, head, following):
    """Return a disc of the grid that a further one overlaps; -1 if there is none."""
    for code in range(3 ** x.shape[1]):
        c = neighbour(centre, code, length, period, cells)
        j = head[c] if c >= 0 else -1
        while j >= 0:
            square = 0.0
            for k in range(x.shape[1]):
                square += separation(centre, x[j], k, period) ** 2
            if square < (radius + r[j]) ** 2:
                return np.int64(j)
            j = following[j]
    return np.int64(-1)


@piece
def insert(i, centre, length, cells, head, following):
    """Put a disc into the list of its cell."""
    c = cell_of(centre, length, cells)
    following[i] = head[c]
    head[c] = i


@entry
def find_overlaps(x, r, length, period, cells, head, following, out):
    """Write pairs that overlap, one for each disc at most, as long as there is room; count them."""
    found = 0
    for i in range(x.shape[0]):
        if found == out.shape[0]:
            break
        j = first_contact(x, r, x[i], r[i], length, period, cells, head, following)
        if j >= 0:
            out[found, 0], out[found, 1] = j, i
            found += 1
        insert(i, x[i], length, cells, head, following)
    return found


@entry
def place(x, r, room, placed, tries, rng, length, period, cells, head, following):
    """Place discs at random, one after the other, where they overlap none; return how many are.

    `room` is what a disc keeps from reflecting walls. Ends when all are placed or after `tries`.
    """
    n, d = x.shape
    for _ in range(tries):
        if placed == n:
            break
        for k in range(d):
            margin = 0.0 if period[k] > 0.0 else room[placed]
            x[placed, k] = margin + (length[k] - 2.0 * margin) * uniform(rng)
        centre = x[placed]
        if first_contact(x, r, centre, r[placed], length, period, cells, head, following) < 0:
            insert(placed, centre, length, cells, head, following)
            placed += 1
    return placed
