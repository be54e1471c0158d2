"""Which pairs may meet: blocks are binned, and pairs nearer than the skin listed.

A pair that is not listed had a gap of a skin when one of its clusters was listed last, and
neither has moved half a skin since its own listing: the two cannot have met.
"""

from __future__ import annotations

import math

import numpy as np

from smolux.jit.compile import cold_piece, piece

from .flight import (
    CELL,
    CHAIN,
    CHECKED,
    CLUSTER,
    EDGE,
    EXTENT,
    FIRST,
    FORWARD,
    FREE,
    FULL,
    HEAP,
    LAST_EDGE,
    LEVEL,
    LISTED,
    LISTED_IN,
    MASS,
    MIXED,
    NEXT,
    OFFSET,
    PAIRS,
    SINCE,
    SKIN,
    SPREAD,
    START,
    USED,
    WAY,
    WIDEST,
)
from .geometry import larger, shift, smaller
from .pairs import add


@piece
def centre(f, b, k, t):
    """Component of the centre of a block at a time."""
    d = len(f.axes)
    body = f.body
    c = np.uint32(f.block[b, CLUSTER])  # unsigned: no check for a negative index
    moved = body[c, k] + body[c, d + k] * (t - body[c, 2 * d + SINCE])
    return f.place[b, k] + moved


@piece
def bring(f, c, t):
    """Bring a cluster to a time."""
    d = len(f.axes)
    body = f.body
    dt = t - body[c, 2 * d + SINCE]
    square = 0.0
    for k in range(d):
        v = body[c, d + k]
        body[c, k] += v * dt
        square += v * v
    body[c, 2 * d + WAY] += math.sqrt(square) * dt
    body[c, 2 * d + SINCE] = t


@piece
def folded(f, x, k):
    """Wrap a coordinate into the box, along a periodic axis."""
    length = f.length[k]
    return x - length * math.floor(x / length) if f.period[k] > 0.0 else x


@piece
def within(c, n):
    """Return a cell along an axis; what lies outside belongs to the outermost one."""
    return c if 0 <= c < n else (np.int64(0) if c < 0 else n - 1)


@piece
def cell_along(f, level, x, k):
    """Cell of a coordinate along an axis."""
    return within(np.int64(folded(f, x, k) * f.scale[level, k]), f.cells[level, k])


@piece
def cell_at(f, b, t):
    """Cell that holds the centre of a block."""
    d = len(f.axes)
    level, cell = np.int64(f.block[b, LEVEL]), np.int64(0)
    for k in range(d):
        cell = cell * f.cells[level, k] + cell_along(f, level, centre(f, b, k, t), k)
    return cell + f.cells[level, d + OFFSET]


@piece
def insert(f, b, cell):
    """Put a block into a cell."""
    block, head = f.block, f.head
    q, mixed = head[cell], np.int32(0)
    if q >= 0:
        mixed = q & MIXED
        q ^= mixed
        if block[q, CLUSTER] != block[b, CLUSTER]:
            mixed = MIXED
    block[b, CELL] = cell
    block[b, NEXT] = q
    head[cell] = np.int32(b) | mixed


@piece
def rebin(f, b, t):
    """Put a block into the cell where it is now."""
    head, block = f.head, f.block
    cell, old = cell_at(f, b, t), block[b, CELL]
    if cell == old:
        return
    mixed = head[old] & MIXED
    q, after = head[old] ^ mixed, block[b, NEXT]
    if q == b:
        head[old] = after | mixed if after >= 0 else after
    else:
        while block[q, NEXT] != b:
            q = block[q, NEXT]
        block[q, NEXT] = after
    insert(f, np.int64(b), cell)


@piece
def list_discs(f, b, q, dx):
    """List the pairs of discs of two blocks that are nearer than a skin."""
    d = len(f.axes)
    block, rel, radius = f.block, f.rel, f.radius
    a, c = block[b, CLUSTER], block[q, CLUSTER]
    spread = f.count[SPREAD]
    ones, others = block[b + 1, FIRST] - block[b, FIRST], block[q + 1, FIRST] - block[q, FIRST]
    first, second = np.uint32(block[b, FIRST]), np.uint32(block[q, FIRST])
    for m in range(ones):
        i = np.uint32(first + m)
        for n in range(others):
            j = np.uint32(second + n)
            square = 0.0
            for k in range(d):
                x = dx[k] + rel[j, k] - rel[i, k]
                x += shift(x, f.period[k])
                square += x * x
            near = radius[i * spread] + radius[j * spread] + f.clock[SKIN]
            if square < near * near:
                add(f, i, j, a, c)
    f.count[CHECKED] += ones * others


@piece
def along(f, q, k, t, still, x):
    """Component of what leads to a block, a `still` one at its place."""
    return (f.place[q, k] if still else centre(f, q, k, t)) - x[k]


@piece
def look(f, b, q, t, still, x, dx, reach):
    """List the pairs of two blocks, unless all are too far."""
    d = len(f.axes)
    half = f.half
    square = 0.0
    for k in range(d):
        gap = along(f, q, k, t, still, x)
        gap += shift(gap, f.period[k])
        gap = larger(abs(gap) - half[b, k] - half[q, k], 0.0)
        square += gap * gap
    if square < reach * reach:
        for k in range(d):
            dx[k] = along(f, q, k, t, still, x)
        list_discs(f, b, q, dx)


@piece
def around(f, level, x, k, near):
    """Write the places of the cells around a coordinate along an axis; -1 if there is none.

    Along a periodic axis of one or two cells, neighbours on both sides are the same cell.
    """
    d = len(f.axes)
    n, stride = f.cells[level, k], 1
    for m in range(k + 1, d):
        stride *= f.cells[level, m]
    at = cell_along(f, level, x, k)
    wraps = f.period[k] > 0.0
    near[k, 1] = at * stride
    below, above = at - 1, at + 1
    if wraps:
        below = below if below >= 0 else n - 1 if n > 2 else -1
        above = above if above < n else 0 if n > 1 else -1
        if n == 2:  # the other cell once
            below, above = -1, 1 - at
    elif above == n:
        above = -1
    near[k, 0] = below * stride if below >= 0 else -1
    near[k, 2] = above * stride if above >= 0 else -1


@piece
def look_into(f, b, cell, start, t, batch, forward, x, dx, reach):
    """List pairs of a block with those of a cell, from one of them on if `start` is not -1."""
    block, head = f.block, f.head
    own, still = block[b, CLUSTER], batch == 0
    q = head[cell]
    if q < 0:
        return
    mixed = q & MIXED
    q ^= mixed
    if mixed == 0 and block[q, CLUSTER] == own:
        return
    alone, checked = start < 0, 0
    if start >= 0:
        q = block[start, NEXT]
    while q >= 0:
        c = block[q, CLUSTER]
        if c != own:
            alone = False
            if forward or (q > b if still else f.group[np.uint32(c), LISTED_IN] != batch):
                checked += 1
                look(f, b, np.uint32(q), t, still, x, dx, reach)
        q = block[q, NEXT]
    if alone:  # other clusters have left the cell, or become one with that of the block
        head[cell] ^= MIXED
    f.count[CHECKED] += checked


@cold_piece
def look_at_level(f, b, level, t, batch, x, dx, near):
    """List pairs of a block with those of another level."""
    d = len(f.axes)
    scale, cells, own = f.scale, f.cells, np.int64(f.block[b, LEVEL])
    reach = 0.5 * (scale[own, d + WIDEST] + scale[level, d + WIDEST]) + f.clock[SKIN]
    # a disc may have moved half a skin since it was binned, and lies around the centre of its block
    far = reach + 0.5 * f.clock[SKIN] + scale[level, d + EXTENT]
    near[2, 0], near[2, 1] = 0, 1
    for k in range(d):
        y, n = folded(f, x[k], k), cells[level, k]
        low = np.int64(math.floor((y - far) * scale[level, k]))
        high = np.int64(math.floor((y + far) * scale[level, k]))
        if f.period[k] == 0.0:
            low, high = within(low, n), within(high, n)
        near[k, 0], near[k, 1] = low, smaller(high - low + 1, n)
    for one in range(near[0, 1]):
        first = (near[0, 0] + one) % cells[level, 0]
        for two in range(near[1, 1]):
            row = first * cells[level, 1] + (near[1, 0] + two) % cells[level, 1]
            for three in range(near[2, 1]):
                cell = row
                if d == 3:
                    cell = row * cells[level, 2] + (near[2, 0] + three) % cells[level, 2]
                cell += cells[level, d + OFFSET]
                look_into(f, b, cell, np.int64(-1), t, batch, batch == 0, x, dx, reach)


@piece
def search(f, b, t, batch, work, near):
    """List pairs of a block with those of other clusters, except of those listed in a batch.

    If all blocks are listed, each pair is looked at from one side: the larger discs from the
    smaller ones, those of a level forward, or by numbers.
    """
    d = len(f.axes)
    x, dx = work[0], work[1]
    level, still = np.int64(f.block[b, LEVEL]), batch == 0
    forward = still and f.cells[level, d + FORWARD] == 1
    reach = f.scale[level, d + WIDEST] + f.clock[SKIN]
    offset = f.cells[level, d + OFFSET]
    for k in range(d):
        x[k] = f.place[b, k] if still else centre(f, b, k, t)
        around(f, level, x[k], k, near)
    for one in range(1 if forward else 0, 3):
        for two in range(1 if forward and one == 1 else 0, 3):
            row = near[0, one] + near[1, two] + offset
            if near[0, one] < 0 or near[1, two] < 0:
                continue
            middle = one == 1 and two == 1
            for three in range(0 if d == 3 and not (forward and middle) else 1, d):
                cell = row
                if d == 3:
                    if near[2, three] < 0:
                        continue
                    cell += near[2, three]
                own = forward and middle and (d == 2 or three == 1)
                start = np.int64(b) if own else np.int64(-1)
                look_into(f, b, cell, start, t, batch, forward, x, dx, reach)
    for other in range(level + 1 if still else 0, f.cells.shape[0]):
        if other != level:
            look_at_level(f, b, other, t, batch, x, dx, near)
    f.count[LISTED] += 1


@piece
def fold(f, t):
    """Bring all blocks to a time, so that clusters have no displacement."""
    d = len(f.axes)
    place, body, bound = f.place, f.body, f.bound
    for b in range(place.shape[0]):
        for k in range(d):
            place[b, k] = centre(f, b, k, t)
    for c in range(body.shape[0]):
        if body[c, 2 * d + MASS] > 0.0:
            bring(f, c, t)
            for k in range(d):
                bound[c, k] += body[c, k]
                bound[c, d + k] += body[c, k]
                body[c, k] = 0.0


@cold_piece
def list_blocks(f, groups, b, stop, t, batch, work, near):
    """List blocks, which are in their cells, of the clusters up to a number.

    Of cluster `b` if `groups` is 0: the chain from block `b` up to, not with, `stop`. With
    `batch` zero all blocks, one after the other, else those of clusters to be listed in it.
    """
    group = f.group
    for c in range(larger(groups, 1)):
        if groups > 0:
            if batch > 0 and group[c, LISTED_IN] != batch - 1:
                continue
            b = np.int64(group[c, START])
        while b != stop and f.count[FULL] == 0:
            search(f, b, t, batch, work, near)
            b = b + 1 if batch == 0 else np.int64(f.block[b, CHAIN])
        if groups > 0:
            group[c, LISTED_IN] = batch


@cold_piece
def empty(f, t):
    """Bring all to a time, strike all pairs off and put all blocks into their cells."""
    d = len(f.axes)
    group, body, count = f.group, f.body, f.count
    fold(f, t)
    count[FREE], count[USED], count[PAIRS], count[HEAP] = -1, 0, 0, 0
    for c in range(body.shape[0]):
        group[c, EDGE] = group[c, LAST_EDGE] = -1
        body[c, 2 * d + WAY] = 0.0
    f.head[:] = -1
    for b in range(f.place.shape[0] - 1, -1, -1):
        insert(f, np.int64(b), cell_at(f, b, t))


@piece
def rebin_chain(f, b, stop, t):
    """Put the blocks of a chain from `b` up to, not with, `stop` into their cells of now."""
    while b != stop:
        rebin(f, b, t)
        b = np.int64(f.block[b, CHAIN])
