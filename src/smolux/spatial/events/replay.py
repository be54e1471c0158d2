"""The motion, from the log alone: what any instant looked like, and what each merge was.

Discs are nodes of a forest. The root of a tree carries velocity and displacement of a cluster, all
others their displacement relative to the node above, which never changes. So a merge costs two
walks to a root, at most ``log2 N`` steps each.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from smolux.jit.compile import entry, piece

from .geometry import add_axis, apart, shift


class Forest(NamedTuple):
    """Clusters as trees of discs."""

    above: np.ndarray
    offset: np.ndarray
    velocity: np.ndarray
    since: np.ndarray
    mass: np.ndarray
    size: np.ndarray
    node: np.ndarray  # number of the cluster in the merger tree
    # for each axis, from when to when reflections were only counted, and the time between two; or
    # empty, if each has an entry
    turns: np.ndarray


class Merges(NamedTuple):
    """What each merge was."""

    parents: np.ndarray
    sizes: np.ndarray
    masses: np.ndarray
    point: np.ndarray
    speed: np.ndarray
    impact: np.ndarray
    loss: np.ndarray
    gap: np.ndarray


@piece
def find(forest, disc, total):
    """Root of a disc's tree; writes the displacement relative to it."""
    d = total.shape[0]
    for k in range(d):
        total[k] = 0.0
    while forest.above[disc] != disc:
        for k in range(d):
            total[k] += forest.offset[disc, k]
        disc = np.int64(forest.above[disc])
    return disc


@piece
def along(turns, time):
    """Way along an axis at a velocity of one, to and fro while reflections were only counted."""
    start, end, interval = turns[0], turns[1], turns[2]
    if time >= end:
        return time - end
    way = time - start
    way -= 2.0 * interval * math.floor(way / (2.0 * interval))
    return way if way < interval else 2.0 * interval - way


@piece
def moved(forest, root, k, time):
    """For how long a cluster has moved along an axis, since its displacement is known."""
    if forest.turns.shape[0] == 0:
        return time - forest.since[root]
    return along(forest.turns[root, k], time) - along(forest.turns[root, k], forest.since[root])


@piece
def direction(forest, root, k, time):
    """Return -1 if a cluster is on its way back between two walls."""
    if forest.turns.shape[0] == 0 or time >= forest.turns[root, k, 1]:
        return 1.0
    turns = (time - forest.turns[root, k, 0]) / forest.turns[root, k, 2]
    return 1.0 if turns - 2.0 * math.floor(0.5 * turns) < 1.0 else -1.0


@piece
def bring(forest, root, time):
    """Bring a cluster to a time."""
    for k in range(forest.offset.shape[1]):
        forest.offset[root, k] += forest.velocity[root, k] * moved(forest, root, k, time)
    forest.since[root] = time


@piece
def describe(forest, merges, m, x, radius, period, ends, gap, a, b, work):
    """Write down what a merge is, before it happens; the two discs touch at `ends`."""
    i, j = ends
    mu = forest.mass[a] * forest.mass[b] / (forest.mass[a] + forest.mass[b])
    sums = apart(0.0)
    for k in range(x.shape[1]):
        sums = add_axis(sums, gap[k], forest.velocity[b, k] - forest.velocity[a, k])
    square, _, distance, cross = sums[:4]
    distance = math.sqrt(distance)
    share = radius[i] / (radius[i] + radius[j])
    for k in range(x.shape[1]):
        merges.point[m, k] = x[i, k] + work[0, k] + forest.offset[a, k] + share * gap[k]
        if period[k] > 0.0:
            merges.point[m, k] -= period[k] * math.floor(merges.point[m, k] / period[k])
    merges.parents[m, 0], merges.parents[m, 1] = forest.node[a], forest.node[b]
    merges.sizes[m, 0], merges.sizes[m, 1] = forest.size[a], forest.size[b]
    merges.masses[m, 0], merges.masses[m, 1] = forest.mass[a], forest.mass[b]
    merges.speed[m] = math.sqrt(square)
    merges.impact[m] = math.sqrt(cross / square) if square > 0 else 0.0
    merges.loss[m] = 0.5 * mu * square
    merges.gap[m] = distance - radius[i] - radius[j]


@piece
def join(forest, a, b, image, work):
    """Hang the smaller tree under the root of the larger one; return that root."""
    sign = 1.0
    if forest.size[b] > forest.size[a]:
        a, b, sign = b, a, -1.0
    ma, mb = forest.mass[a], forest.mass[b]
    for k in range(forest.offset.shape[1]):
        v = (ma * forest.velocity[a, k] + mb * forest.velocity[b, k]) / (ma + mb)
        forest.velocity[a, k] = v
        forest.offset[b, k] += sign * image[k] - forest.offset[a, k]
    forest.mass[a] = ma + mb
    forest.size[a] += forest.size[b]
    forest.above[b] = a
    return a


@entry
def replay(
    forest, merges, x, radius, period, time, first, second, more, until, start, stop, nodes, work
):
    """Go through events; return the number of nodes of the merger tree, `nodes` of them before."""
    n, d = x.shape
    gap, image = work[2], work[3]
    for e in range(start, stop):
        i, j = np.int64(first[e]), np.int64(second[e])
        a = find(forest, i, work[0])
        bring(forest, a, time[e])
        if j < 0:
            axis = (-1 - j) % d
            forest.velocity[a, axis] *= 0.0 if -1 - j >= d else -1.0
            if more[e] > 0:
                forest.turns[a, axis, 0], forest.turns[a, axis, 1] = time[e], until[e]
                forest.turns[a, axis, 2] = (until[e] - time[e]) / more[e]
            continue
        b = find(forest, j, work[1])
        bring(forest, b, time[e])
        for k in range(d):
            one = x[i, k] + work[0, k] + forest.offset[a, k]
            other = x[j, k] + work[1, k] + forest.offset[b, k]
            image[k] = shift(other - one, period[k])
            gap[k] = other - one + image[k]
        describe(forest, merges, nodes - n, x, radius, period, (i, j), gap, a, b, work)
        forest.node[join(forest, a, b, image, work)] = nodes
        nodes += 1
    return nodes


@entry
def positions(forest, x, time, out, velocity, label, least, work):
    """Write position, velocity and cluster of all discs at a time; clusters by `least` disc."""
    n, d = x.shape
    least[:] = -1
    for i in range(n):
        root = find(forest, i, work[0])
        if least[root] < 0:
            least[root] = i
        label[i] = least[root]
        for k in range(d):
            v = forest.velocity[root, k]
            shifted = forest.offset[root, k] + v * moved(forest, root, k, time)
            out[i, k] = x[i, k] + work[0, k] + shifted
            velocity[i, k] = v * direction(forest, root, k, time)
