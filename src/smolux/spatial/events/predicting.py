"""What is known to come: contacts of pairs, walls, the end of a cluster's way."""

from __future__ import annotations

import math

import numpy as np

from smolux.jit.compile import cold_piece, piece

from .flight import (
    AFTER,
    BLOCK,
    BUDGET_OF_WAY,
    CLUSTER,
    DISC,
    EDGE,
    FAR_BLOCK,
    FAR_CLUSTER,
    HALF,
    HORIZON,
    IMAGES,
    LISTED_IN,
    LOT,
    MASS,
    NEAR_BLOCK,
    NEAR_CLUSTER,
    PREDICTED,
    SINCE,
    SPREAD,
    STAMP,
    USED,
    VERSION,
    WAY,
)
from .geometry import add_axis, apart, contact_time, other_image, shift, smaller, wall_time
from .heap import push
from .pairs import drop


@piece
def speed(f, c):
    """Speed of a cluster."""
    d = len(f.axes)
    square = 0.0
    for k in range(d):
        square += f.body[c, d + k] * f.body[c, d + k]
    return math.sqrt(square)


@cold_piece
def from_other_images(f, p, t):
    """Time to the contact of a pair, from all images but the nearest one."""
    d = len(f.axes)
    since = 2 * d + SINCE
    half_edge, disc, body = f.half_edge, f.disc, f.body
    i, j = np.int64(half_edge[2 * p, DISC]), np.int64(half_edge[2 * p + 1, DISC])
    g, h = disc[i, BLOCK], disc[j, BLOCK]
    m, n = f.block[g, CLUSTER], f.block[h, CLUSTER]
    s = f.radius[i * f.count[SPREAD]] + f.radius[j * f.count[SPREAD]]
    best = math.inf
    for code in range(1, f.count[IMAGES]):
        sums = apart(s)
        for k in range(d):
            vm, vn = body[m, d + k], body[n, d + k]
            x = f.rel[j, k] + f.place[h, k] + body[n, k] + vn * (t - body[n, since])
            x -= f.rel[i, k] + f.place[g, k] + body[m, k] + vm * (t - body[m, since])
            x += shift(x, f.period[k])
            if code & (1 << k):
                x += other_image(x, f.period[k])
            sums = add_axis(sums, x, vn - vm)
        best = smaller(best, contact_time(sums, s))
    return best


@piece
def predict(f, p, t):
    """Predict the contact of a pair, and remember it if nothing is known to come before."""
    d = len(f.axes)
    since, horizon = 2 * d + SINCE, 2 * d + HORIZON
    half_edge, disc, block, radius, body, rel, place = (
        f.half_edge,
        f.disc,
        f.block,
        f.radius,
        f.body,
        f.rel,
        f.place,
    )
    # unsigned: no check for a negative index
    i, j = np.uint32(half_edge[2 * p, DISC]), np.uint32(half_edge[2 * p + 1, DISC])
    g, h = np.uint32(disc[i, BLOCK]), np.uint32(disc[j, BLOCK])
    m, n = np.uint32(block[g, CLUSTER]), np.uint32(block[h, CLUSTER])
    spread = f.count[SPREAD]
    s = radius[i * spread] + radius[j * spread]
    dm, dn = t - body[m, since], t - body[n, since]
    sums = apart(s)
    for k in range(d):
        vm, vn = body[m, d + k], body[n, d + k]
        x = rel[j, k] + place[h, k] + body[n, k] + vn * dn
        x -= rel[i, k] + place[g, k] + body[m, k] + vm * dm
        x += shift(x, f.period[k])
        sums = add_axis(sums, x, vn - vm)
    f.count[PREDICTED] += 1
    half_edge[2 * p, VERSION] += 1
    wait = contact_time(sums, s)
    if f.count[IMAGES] > 1:
        wait = smaller(wait, from_other_images(f, p, t))
    touch = t + wait
    if touch <= smaller(body[m, horizon], body[n, horizon]):
        push(f, touch, p, half_edge[2 * p, VERSION])


@piece
def next_wall(f, c):
    """Time at which a cluster touches a wall, and the axis; without a later change."""
    d = len(f.axes)
    since = 2 * d + SINCE
    body, bound = f.body, f.bound
    best, axis = math.inf, 0
    for k in range(d):
        if f.period[k] == 0.0:
            x = body[c, k]
            t = wall_time(bound[c, k] + x, bound[c, d + k] + x, body[c, d + k], f.length[k])
            if t < best:
                best, axis = t, k
    return body[c, since] + best, axis


@cold_piece
def look_ahead(f, c, stop, batch):
    """Set until when clusters fly freely: up to a wall, or to the end of their way.

    Of all clusters ``c .. stop - 1`` that are there and, if `batch` is not zero, were listed in
    that batch.
    """
    d = len(f.axes)
    since, mass, way, horizon = 2 * d + SINCE, 2 * d + MASS, 2 * d + WAY, 2 * d + HORIZON
    group, body = f.group, f.body
    while c < stop:
        if body[c, mass] > 0.0 and (batch == 0 or group[c, LISTED_IN] == batch):
            left = f.clock[BUDGET_OF_WAY] - body[c, way]
            v = speed(f, c)
            end = body[c, since] + left / v if v > 0.0 else math.inf
            group[c, STAMP] += 1
            wall, _ = next_wall(f, c)
            if wall <= end:
                push(f, wall, -1 - c, group[c, STAMP])
                end = wall
            body[c, horizon] = end
        c += 1


@piece
def fetch(f, lot, count):
    """Find blocks and clusters of pairs, in passes: none waits for the memory of another."""
    half_edge, disc, block = f.half_edge, f.disc, f.block
    for k in range(count):
        h = lot[k, HALF]
        lot[k, NEAR_BLOCK] = disc[np.uint32(half_edge[h, DISC]), BLOCK]
        lot[k, FAR_BLOCK] = disc[np.uint32(half_edge[h ^ 1, DISC]), BLOCK]
    for k in range(count):
        lot[k, NEAR_CLUSTER] = block[np.uint32(lot[k, NEAR_BLOCK]), CLUSTER]
        lot[k, FAR_CLUSTER] = block[np.uint32(lot[k, FAR_BLOCK]), CLUSTER]


@cold_piece
def predict_listed(f, t):
    """Predict all contacts after everything was listed anew."""
    lot, p = f.lot, np.int64(0)
    while p < f.count[USED]:
        count = smaller(f.count[USED] - p, LOT)
        for k in range(count):
            lot[k, HALF] = 2 * (p + k)
        fetch(f, lot, count)
        for k in range(count):
            predict(f, p + k, t)
        p += count


@cold_piece
def predict_all(f, c, stop, batch, t):
    """Predict all contacts of clusters, as in `look_ahead`; strike off pairs inside them."""
    group, half_edge, lot = f.group, f.half_edge, f.lot
    while c < stop:
        h = np.int64(-1)
        if batch == 0 or group[c, LISTED_IN] == batch:
            h = np.int64(group[c, EDGE])
        while h >= 0:
            count = 0
            while h >= 0 and count < LOT:
                lot[count, HALF] = h
                h = np.int64(half_edge[h, AFTER])
                count += 1
            fetch(f, lot, count)
            for k in range(count):
                if lot[k, NEAR_CLUSTER] == lot[k, FAR_CLUSTER]:
                    drop(f, lot[k, HALF], np.int32(c))
                else:
                    predict(f, lot[k, HALF] >> 1, t)
        c += 1
