"""Parting discs that overlap after a step: a constrained minimisation, or moves of whole clusters.

All lengths are in units of the sum of radii of a pair, so that one set of coefficients fits all.
"""

from __future__ import annotations

import math

import numpy as np

from smolux.jit.compile import cold_piece, piece

from .geometry import larger, shift, smaller
from .minimising import FAILED, FULL, LINKED, PARTED, RELOAD, load, minimise, root
from .steps import (
    CONTACTS,
    EDGES,
    ITERATIONS,
    MINIMISATIONS,
    NEARS,
    SKIN,
    SLOTS,
    TOUCHED,
    WAY,
    look,
)

#: outer loops over new contacts
_PASSES = 30


@piece
def overlap_of(s, i, j, n):
    """Overlap of two discs over the sum of radii; writes the vector between them."""
    d = len(s.axes)
    a, b = s.label[i], s.label[j]
    square = 0.0
    for k in range(d):
        dx = s.x[j, k] + s.off[b, k] - s.x[i, k] - s.off[a, k]
        n[k] = dx + shift(dx, s.period[k])
        square += n[k] * n[k]
    return 1.0 - math.sqrt(square) / (s.radius[i] + s.radius[j])


@cold_piece
def adopt(s, begin, tolerance, n):
    """Keep contacts that are new: of clusters that do not touch yet, or with a true overlap."""
    kept = begin
    for q in range(begin, s.count[CONTACTS]):
        i, j = s.contact[q, 0], s.contact[q, 1]
        apart = root(s, s.label[i]) != root(s, s.label[j])
        if apart or overlap_of(s, i, j, n) > tolerance:
            s.contact[kept, 0], s.contact[kept, 1] = i, j
            kept += 1
    s.count[CONTACTS] = kept
    for q in range(begin, kept):
        for side in range(2):
            c = s.label[s.contact[q, side]]
            if s.comp[c] < 0:
                s.comp[c] = c
                s.touched[s.count[TOUCHED]] = c
                s.count[TOUCHED] += 1
        a, b = root(s, s.label[s.contact[q, 0]]), root(s, s.label[s.contact[q, 1]])
        s.comp[larger(a, b)] = smaller(a, b)
    return kept - begin


@cold_piece
def part_rigid(s, recipe, n):
    """Move clusters apart, contact by contact, each by the mass of the other one."""
    d = len(s.axes)
    for t in range(s.count[TOUCHED]):
        s.drift[s.touched[t], d] = 0.0  # the way of each
    s.count[MINIMISATIONS] += 1
    for _ in range(recipe.iterations):
        worst = 0.0
        s.count[ITERATIONS] += 1
        for q in range(s.count[CONTACTS]):
            i, j = s.contact[q, 0], s.contact[q, 1]
            over = overlap_of(s, i, j, n)
            worst = larger(worst, over)
            if over > 0.0:
                a, b = s.label[i], s.label[j]
                # of the separation, which becomes the sum of radii
                scale = over / (1.0 - over)
                share = s.mass[b] / (s.mass[a] + s.mass[b])
                length = over * (s.radius[i] + s.radius[j])
                for k in range(d):
                    s.off[a, k] -= share * scale * n[k]
                    s.off[b, k] += (1.0 - share) * scale * n[k]
                s.drift[a, d] += share * length
                s.drift[b, d] += (1.0 - share) * length
        if worst <= recipe.overlap:
            way = 0.0
            for t in range(s.count[TOUCHED]):
                way = larger(way, s.drift[s.touched[t], d])
            s.clock[WAY] += way
            return PARTED if s.clock[WAY] <= 0.5 * s.clock[SKIN] else RELOAD
    return FAILED


@cold_piece
def commit(s, local):
    """Put discs where the minimisation left them, centres of mass where they were."""
    d = len(s.axes)
    for t in range(s.count[TOUCHED]):
        for k in range(d + 1):
            s.drift[s.touched[t], k] = 0.0
    for t in range(s.count[TOUCHED]):
        s.drift[root(s, s.touched[t]), d] += s.mass[s.touched[t]]
    way = 0.0
    for a in range(s.count[SLOTS]):
        if local.active[a]:
            i = local.disc[a]
            c, square = s.label[i], 0.0
            top = root(s, c)
            share = s.inertia[i] / s.drift[top, d]
            for k in range(d):
                move = local.y[a, k] - local.loaded[a, k]
                s.x[i, k] += move
                s.drift[top, k] -= share * move
                s.low[c, k] = smaller(s.low[c, k], s.x[i, k] - s.room[i])
                s.high[c, k] = larger(s.high[c, k], s.x[i, k] + s.room[i])
                square += move * move
            way = larger(way, square)
    pushed = 0.0
    for t in range(s.count[TOUCHED]):
        c, square = s.touched[t], 0.0
        for k in range(d):
            move = s.drift[root(s, c), k]
            s.off[c, k] += move
            square += move * move
        pushed = larger(pushed, square)
    s.clock[WAY] += math.sqrt(way) + math.sqrt(pushed)
    return PARTED if s.clock[WAY] <= 0.5 * s.clock[SKIN] else RELOAD


@piece
def part_non_rigid(s, local, recipe, begin, n):
    """Minimise from the contacts there are."""
    if not load(s, local, recipe, begin):
        return FULL
    s.count[MINIMISATIONS] += 1
    code = minimise(s, local, recipe, n)
    return commit(s, local) if code == PARTED else code


@cold_piece
def part(s, local, recipe, n):
    """Part all that overlap, and what they then overlap, until nothing new does."""
    begin = np.int64(0)
    for _ in range(_PASSES):
        if adopt(s, begin, recipe.overlap, n) == 0:
            return PARTED
        if recipe.rigid:
            code = part_rigid(s, recipe, n)
        else:
            code = part_non_rigid(s, local, recipe, begin, n)
        if code != PARTED:
            return code
        begin = np.int64(s.count[CONTACTS])
        look(s)
    return FAILED


@piece
def link(s, i, j, multiplier):
    """Store a link by two half-edges, as far as there is room."""
    e = s.count[EDGES]
    if e + 2 > s.edge_to.shape[0]:
        return
    for one, other in ((i, j), (j, i)):
        s.edge_to[e], s.edge_next[e], s.edge_force[e] = other, s.edge[one], multiplier
        s.edge[one] = e
        e += 1
    s.count[EDGES] = e


@cold_piece
def settle(s, local, good):
    """Keep what a minimisation found, or put all discs back."""
    d = len(s.axes)
    for p in range(s.count[NEARS] if good else 0):
        if local.near[p, 2] == LINKED:
            e = local.near[p, 3]
            if e < 0:
                i, j = local.disc[local.near[p, 0]], local.disc[local.near[p, 1]]
                link(s, i, j, local.multiplier[p])
            else:
                s.edge_force[e] = s.edge_force[e ^ 1] = local.multiplier[p]
    for a in range(s.count[SLOTS]):
        i = local.disc[a]
        s.slot[i] = -1
        if not good:
            for k in range(d):
                s.x[i, k] = local.start[a, k]
    for t in range(s.count[TOUCHED]):
        s.comp[s.touched[t]] = -1
    s.count[SLOTS] = s.count[NEARS] = s.count[TOUCHED] = s.count[CONTACTS] = 0
