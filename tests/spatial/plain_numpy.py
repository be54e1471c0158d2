"""An event-driven simulation in plain NumPy, all pairs at each event; shares no code with it."""

from __future__ import annotations

import itertools

import numpy as np


def wall_touch(x, v, radius, lengths, periodic):
    """Time to the next touch of a wall, the disc and the axis."""
    with np.errstate(divide="ignore", invalid="ignore"):
        to = np.where(v > 0, (lengths - radius[:, None] - x) / v, (radius[:, None] - x) / v)
    to[(v == 0) | periodic[None, :]] = np.inf
    disc, axis = np.unravel_index(np.argmin(to), to.shape)
    return max(to[disc, axis], 0.0), disc, axis


def pair_touch(x, v, radius, label, images):
    """Time to the next contact of discs of two clusters, from all images, and the two discs."""
    i, j = np.triu_indices(len(x), 1)
    apart = label[i] != label[j]
    i, j = i[apart], j[apart]
    best = (np.inf, -1, -1)
    w = v[j] - v[i]
    a = (w * w).sum(1)
    for image in images:
        dx = x[j] - x[i] + image
        b = (dx * w).sum(1)
        c = (dx * dx).sum(1) - (radius[i] + radius[j]) ** 2
        root = b * b - a * c
        meets = (b < 0) & (root >= 0)
        t = np.full(len(b), np.inf)
        t[meets] = np.maximum(c[meets] / (np.sqrt(root[meets]) - b[meets]), 0.0)
        k = np.argmin(t)
        if t[k] < best[0]:
            best = (t[k], i[k], j[k])
    return best


def merges(system, horizon=np.inf):
    """List of (time, first, second) until one cluster is left or a time is reached."""
    x, v = system.position.copy(), system.velocity.copy()
    lengths, periodic = np.array(system.box.lengths), system.box.periodic
    label = np.arange(len(x))
    x = np.where(periodic, np.mod(x, lengths), x)
    reach = [(-1, 0, 1) if p else (0,) for p in periodic]
    images = [np.array(k) * lengths for k in itertools.product(*reach)]
    time, found = 0.0, []
    while len(np.unique(label)) > 1 and time < horizon:
        wall, disc, axis = wall_touch(x, v, system.radius, lengths, periodic)
        pair, i, j = pair_touch(x, v, system.radius, label, images)
        # wrapped positions and the images around them hold for half a box of flight
        reach = 0.25 * lengths.min() / max(np.abs(v).max(), 1e-300)
        dt = min(wall, pair, reach)
        x += v * dt
        time += dt
        x = np.where(periodic, np.mod(x, lengths), x)
        if dt == pair:
            both = (label == label[i]) | (label == label[j])
            v[both] = (system.mass[both] @ v[both]) / system.mass[both].sum()
            label[both] = label[i]
            found.append((time, int(i), int(j)))
        elif dt == wall:
            v[label == label[disc], axis] *= -1
    return found
