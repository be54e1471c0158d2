"""What is known to come: contacts of pairs, walls, the end of a cluster's way."""

from __future__ import annotations

import math

import numpy as np

from ...core.compile import cold_piece, piece
from .flight import (
    AFTER,
    BLOCK,
    BUDGET_OF_WAY,
    CLUSTER,
    DISC,
    EDGE,
    HORIZON,
    LISTED_IN,
    MASS,
    PREDICTED,
    SINCE,
    SPREAD,
    STAMP,
    VERSION,
    WAY,
)
from .geometry import contact_time, shift, smaller, wall_time
from .heap import push
from .pairs import cluster_of, remove


def bind(d):
    """Bind the pieces for `d` dimensions."""
    since, mass, way, horizon = 2 * d + SINCE, 2 * d + MASS, 2 * d + WAY, 2 * d + HORIZON

    @piece
    def speed(f, c):
        square = 0.0
        for k in range(d):
            square += f.body[c, d + k] * f.body[c, d + k]
        return math.sqrt(square)

    @piece
    def predict(f, p, t):
        """Predict the contact of a pair, and remember it if nothing is known to come before."""
        half_edge, disc, block, radius, body, rel, place = (
            f.half_edge,
            f.disc,
            f.block,
            f.radius,
            f.body,
            f.rel,
            f.place,
        )
        i, j = half_edge[2 * p, DISC], half_edge[2 * p + 1, DISC]
        g, h = disc[i, BLOCK], disc[j, BLOCK]
        m, n = block[g, CLUSTER], block[h, CLUSTER]
        spread = f.count[SPREAD]
        s = radius[i * spread] + radius[j * spread]
        dm, dn = t - body[m, since], t - body[n, since]
        a, b, c = 0.0, 0.0, -s * s
        for k in range(d):
            vm, vn = body[m, d + k], body[n, d + k]
            x = rel[j, k] + place[h, k] + body[n, k] + vn * dn
            x -= rel[i, k] + place[g, k] + body[m, k] + vm * dm
            x += shift(x, f.period[k])
            w = vn - vm
            a += w * w
            b += x * w
            c += x * x
        f.count[PREDICTED] += 1
        half_edge[2 * p, VERSION] += 1
        touch = t + contact_time(a, b, c)
        if touch <= smaller(body[m, horizon], body[n, horizon]):
            push(f, touch, p, half_edge[2 * p, VERSION])

    @piece
    def next_wall(f, c):
        """Time at which a cluster touches a wall, and the axis; without a later change."""
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
        it.
        """
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

    @cold_piece
    def predict_all(f, c, stop, batch, every, t):
        """Predict all contacts of clusters; pairs inside them are struck off.

        Of clusters as in `look_ahead`. If these are `every` cluster, each pair is met twice, and
        predicted once.
        """
        group, half_edge = f.group, f.half_edge
        while c < stop:
            h = np.int64(-1)
            if batch == 0 or group[c, LISTED_IN] == batch:
                h = np.int64(group[c, EDGE])
            while h >= 0:
                p, after = h >> 1, np.int64(half_edge[h, AFTER])
                if every > 0:
                    if h & 1 == 0:
                        predict(f, p, t)
                elif cluster_of(f, half_edge[2 * p, DISC]) == cluster_of(
                    f, half_edge[2 * p + 1, DISC]
                ):
                    if after == h ^ 1:
                        after = np.int64(half_edge[after, AFTER])
                    remove(f, p, np.int32(c), np.int32(c))
                else:
                    predict(f, p, t)
                h = after
            c += 1

    return speed, next_wall, look_ahead, predict_all
