"""Which pairs may meet: blocks are binned, and pairs nearer than the skin listed.

A pair that is not listed had a gap of a skin when one of its clusters was listed last, and
neither has moved half a skin since its own listing: it cannot have met.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.compile import cold_piece, piece
from .flight import (
    CELL,
    CHAIN,
    CHECKED,
    CLUSTER,
    EDGE,
    FIRST,
    FREE,
    HEAP,
    LAST_EDGE,
    LISTED,
    LISTED_IN,
    MASS,
    NEXT,
    PAIRS,
    SINCE,
    SKIN,
    SPREAD,
    USED,
    WAY,
    WIDEST,
)
from .geometry import shift
from .pairs import add


def bind(d):
    """Bind the pieces for `d` dimensions."""

    @piece
    def centre(f, b, k, t):
        """Component of the centre of a block at a time."""
        c = f.block[b, CLUSTER]
        moved = f.body[c, k] + f.body[c, d + k] * (t - f.body[c, 2 * d + SINCE])
        return f.place[b, k] + moved

    @piece
    def bring(f, c, t):
        """Bring a cluster to a time."""
        dt = t - f.body[c, 2 * d + SINCE]
        square = 0.0
        for k in range(d):
            v = f.body[c, d + k]
            f.body[c, k] += v * dt
            square += v * v
        f.body[c, 2 * d + WAY] += math.sqrt(square) * dt
        f.body[c, 2 * d + SINCE] = t

    @piece
    def cell_at(f, b, t):
        """Cell that holds the centre of a block."""
        cell = np.int64(0)
        for k in range(d):
            x, length, n = centre(f, b, k, t), f.length[k], f.cells[k]
            if f.period[k] > 0.0:
                x -= length * math.floor(x / length)
            cell = cell * n + min(max(np.int64(x / length * n), 0), n - 1)
        return cell

    @piece
    def insert(f, b, cell):
        """Put a block into a cell."""
        f.block[b, CELL] = cell
        f.block[b, NEXT] = f.head[cell]
        f.head[cell] = b

    @piece
    def rebin(f, b, t):
        """Put a block into the cell where it is now."""
        cell, old = cell_at(f, b, t), f.block[b, CELL]
        if cell == old:
            return
        q = f.head[old]
        if q == b:
            f.head[old] = f.block[b, NEXT]
        else:
            while f.block[q, NEXT] != b:
                q = f.block[q, NEXT]
            f.block[q, NEXT] = f.block[b, NEXT]
        insert(f, b, cell)

    @piece
    def list_discs(f, b, q, dx):
        """List the pairs of discs of two blocks that are nearer than a skin."""
        a, c = f.block[b, CLUSTER], f.block[q, CLUSTER]
        spread = f.count[SPREAD]
        for i in range(f.block[b, FIRST], f.block[b + 1, FIRST]):
            for j in range(f.block[q, FIRST], f.block[q + 1, FIRST]):
                square = 0.0
                for k in range(d):
                    x = dx[k] + f.rel[j, k] - f.rel[i, k]
                    x += shift(x, f.period[k])
                    square += x * x
                near = f.radius[i * spread] + f.radius[j * spread] + f.clock[SKIN]
                if square < near * near:
                    add(f, i, j, a, c)
        f.count[CHECKED] += (f.block[b + 1, FIRST] - f.block[b, FIRST]) * (
            f.block[q + 1, FIRST] - f.block[q, FIRST]
        )

    @piece
    def look(f, b, q, t, x, dx, reach):
        """List the pairs of two blocks, unless all are too far."""
        square = 0.0
        for k in range(d):
            dx[k] = centre(f, q, k, t) - x[k]
            gap = dx[k] + shift(dx[k], f.period[k])
            gap = max(abs(gap) - f.half[b, k] - f.half[q, k], 0.0)
            square += gap * gap
        f.count[CHECKED] += 1
        if square < reach * reach:
            list_discs(f, b, q, dx)

    @piece
    def search(f, b, t, batch, work):
        """List pairs of a block with those of other clusters, except of those listed in a batch."""
        x, dx = work[0], work[1]
        own = f.block[b, CLUSTER]
        reach = f.clock[WIDEST] + f.clock[SKIN]
        for k in range(d):
            x[k] = centre(f, b, k, t)
        f.count[LISTED] += 1
        for code in range(3**d):
            cell, rest, steps, stride = np.int64(0), np.int64(f.block[b, CELL]), code, np.int64(1)
            for m in range(d):
                k = d - 1 - m
                n = f.cells[k]
                at = rest % n
                rest //= n
                step = steps % 3 - 1
                steps //= 3
                at += step
                if f.period[k] > 0.0:
                    if (n == 1 and step != 0) or (n == 2 and step < 0):
                        cell = -1
                        break
                    at = at + n if at < 0 else at - n if at >= n else at
                elif at < 0 or at >= n:
                    cell = -1
                    break
                cell += at * stride
                stride *= n
            if cell < 0:
                continue
            q = np.int64(f.head[cell])
            while q >= 0:
                c = f.block[q, CLUSTER]
                if batch < 0:  # all blocks are listed: each pair once
                    skip = q <= b
                else:
                    skip = f.group[c, LISTED_IN] == batch
                if c != own and not skip:
                    look(f, b, q, t, x, dx, reach)
                q = np.int64(f.block[q, NEXT])

    @piece
    def fold(f, t):
        """Bring all blocks to a time, so that clusters have no displacement."""
        for b in range(f.place.shape[0]):
            for k in range(d):
                f.place[b, k] = centre(f, b, k, t)
        for c in range(f.body.shape[0]):
            if f.body[c, 2 * d + MASS] > 0.0:
                bring(f, c, t)
                for k in range(d):
                    f.bound[c, k] += f.body[c, k]
                    f.bound[c, d + k] += f.body[c, k]
                    f.body[c, k] = 0.0

    @cold_piece
    def list_blocks(f, b, stop, t, batch, work):
        """List blocks, which are in their cells: a chain from `b` up to, not with, `stop`.

        With a negative `batch` all of them, one after the other.
        """
        while b != stop:
            search(f, b, t, batch, work)
            b = b + 1 if batch < 0 else np.int64(f.block[b, CHAIN])

    @cold_piece
    def empty(f, t):
        """Bring all to a time, strike all pairs off and put all blocks into their cells."""
        fold(f, t)
        f.count[FREE], f.count[USED], f.count[PAIRS], f.count[HEAP] = -1, 0, 0, 0
        for c in range(f.body.shape[0]):
            f.group[c, EDGE] = f.group[c, LAST_EDGE] = -1
            f.body[c, 2 * d + WAY] = 0.0
        f.head[:] = -1
        for b in range(f.place.shape[0] - 1, -1, -1):
            insert(f, b, cell_at(f, b, t))

    @cold_piece
    def rebin_chain(f, b, stop, t):
        """Put the blocks of a chain from `b` up to, not with, `stop` into their cells of now."""
        while b != stop:
            rebin(f, b, t)
            b = np.int64(f.block[b, CHAIN])

    return bring, empty, list_blocks, rebin_chain
