"""The constrained minimisation: discs that overlap are parted, and their links stay closed.

All lengths are in units of the sum of radii of a pair, so that one set of coefficients fits all.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from smolux.jit.compile import cold_piece, piece

from .geometry import larger, power, shift
from .grid import neighbour
from .steps import (
    CONTACTS,
    ITERATIONS,
    NEARS,
    REACH,
    SLOTS,
)

# What came out of a minimisation.
PARTED = 0
FAILED = 1
RELOAD = 2  # discs moved beyond what the lists allow for
FULL = 3  # no room for more pairs

# Kinds of pairs.
STRANGERS = 0  # of clusters that do not touch
FENCED = 1  # must not overlap
LINKED = 2  # and are drawn to each other

#: iterations between two looks at the coefficients, and the largest coefficient
_TERM, _STIFFEST = 20, 30.0


class Recipe(NamedTuple):
    """Coefficients, tolerances and limits of a method."""

    rigid: bool
    smooth: bool
    adaptive: bool
    alpha: float
    beta: float
    damping: float
    augmentation: float
    overlap: float
    gap: float
    iterations: int
    first: float  # multiplier of a new link: a link is in balance at 1


class Local(NamedTuple):
    """The discs and pairs that a minimisation knows of; those that are not active stay."""

    disc: np.ndarray
    active: np.ndarray
    first: np.ndarray
    y: np.ndarray
    old: np.ndarray
    loaded: np.ndarray
    start: np.ndarray
    force: np.ndarray
    near: np.ndarray  # columns: two slots, kind, half-edge
    multiplier: np.ndarray


@piece
def root(s, c):
    """Return the representative of the clusters that a cluster touches; itself if none."""
    while s.comp[c] >= 0 and s.comp[c] != c:
        c = np.int64(s.comp[c])
    return np.int64(c)


@piece
def slot_of(s, local, i):
    """Return the slot of a disc, a new one if it has none."""
    d = len(s.axes)
    a = np.int64(s.slot[i])
    if a < 0:
        a = np.int64(s.count[SLOTS])
        s.count[SLOTS] += 1
        s.slot[i] = a
        local.disc[a], local.active[a] = i, False
        c = s.label[i]
        for k in range(d):
            local.start[a, k] = s.x[i, k]
            y = s.x[i, k] + s.off[c, k]
            local.y[a, k] = local.old[a, k] = local.loaded[a, k] = y
    return a


@piece
def half_edge(s, i, j):
    """Return the half-edge from one disc to another; -1 if they are not linked."""
    e = s.edge[i]
    while e >= 0 and s.edge_to[e] != j:
        e = s.edge_next[e]
    return e


@cold_piece
def activate(s, local, i):
    """Let a disc move: list what is near it. False if there is no room."""
    d = len(s.axes)
    a = slot_of(s, local, i)
    if local.active[a]:
        return True
    local.active[a] = True
    local.first[a] = s.count[NEARS]
    for code in range(power(3, s.axes)):
        cell = neighbour(s.binned[i], code, s.length, s.period, s.cells)
        j = np.int64(s.head[cell] if cell >= 0 else -1)
        while j >= 0:
            b = np.int64(s.slot[j])
            # pairs with active discs are listed already; the disc itself is active
            if b < 0 or not local.active[b]:
                square, c = 0.0, s.label[j]
                for k in range(d):
                    y = local.y[b, k] if b >= 0 else s.x[j, k] + s.off[c, k]
                    dx = y - local.y[a, k]
                    dx += shift(dx, s.period[k])
                    square += dx * dx
                if square < (s.clock[REACH] * (s.radius[i] + s.radius[j])) ** 2:
                    p = s.count[NEARS]
                    if p == local.multiplier.shape[0]:
                        return False
                    b = slot_of(s, local, j)
                    e = half_edge(s, i, j)
                    same = root(s, s.label[i]) == root(s, c)
                    local.near[p, 0], local.near[p, 1] = a, b
                    local.near[p, 2] = LINKED if e >= 0 else FENCED if same else STRANGERS
                    local.near[p, 3] = e
                    local.multiplier[p] = s.edge_force[e] if e >= 0 else 0.0
                    s.count[NEARS] += 1
            j = np.int64(s.following[j])
    return True


@cold_piece
def load(s, local, recipe, begin):
    """Take up the discs of new contacts, and where all are; False if there is no room."""
    d = len(s.axes)
    for a in range(s.count[SLOTS]):
        i = local.disc[a]
        c = s.label[i]
        for k in range(d):
            y = s.x[i, k] + s.off[c, k]
            local.y[a, k] = local.old[a, k] = local.loaded[a, k] = y
    for q in range(begin, s.count[CONTACTS]):
        for side in range(2):
            if not activate(s, local, np.int64(s.contact[q, side])):
                return False
    for p in range(s.count[NEARS]):
        i, j = local.disc[local.near[p, 0]], local.disc[local.near[p, 1]]
        if local.near[p, 2] == STRANGERS and root(s, s.label[i]) == root(s, s.label[j]):
            local.near[p, 2] = FENCED
    for q in range(begin, s.count[CONTACTS]):
        a, b = s.slot[s.contact[q, 0]], s.slot[s.contact[q, 1]]
        # the pair was listed by the disc that was active first
        if local.first[b] < local.first[a]:
            a, b = b, a
        p = local.first[a]
        while local.near[p, 0] != a or local.near[p, 1] != b:
            p += 1
        local.near[p, 2] = LINKED
        local.multiplier[p] = larger(local.multiplier[p], recipe.first)
    return True


@piece
def forces(s, local, recipe, kappa, beta, n):
    """Update multipliers and forces; return the largest overlap, gap of links, and a check."""
    d = len(s.axes)
    over, gap, check = 0.0, 0.0, 0.0
    y, force = local.y, local.force
    for a in range(s.count[SLOTS]):
        for k in range(d):
            force[a, k] = 0.0
    for p in range(s.count[NEARS]):
        kind = local.near[p, 2]
        if kind == STRANGERS:
            continue
        a, b = local.near[p, 0], local.near[p, 1]
        sigma = s.radius[local.disc[a]] + s.radius[local.disc[b]]
        square = 0.0
        for k in range(d):
            dx = y[b, k] - y[a, k]
            n[k] = dx + shift(dx, s.period[k])
            square += n[k] * n[k]
        square /= sigma * sigma
        check += square
        multiplier = local.multiplier[p]
        if kind == FENCED and square > 1.0 and multiplier == 0.0:
            continue
        h = math.sqrt(square)
        phi = 0.5 * (1.0 - square) if recipe.smooth else 1.0 - h
        multiplier = larger(multiplier + beta * phi, 0.0)
        local.multiplier[p] = multiplier
        hat = larger(multiplier + kappa * phi, 0.0)
        drawn = 1.0 if kind == LINKED else 0.0
        f = drawn - hat if recipe.smooth else drawn - hat / h
        over = larger(over, 1.0 - h)
        if kind == LINKED:
            gap = larger(gap, h - 1.0)
        for k in range(d):
            force[a, k] += f * n[k]
            force[b, k] -= f * n[k]
    return over, gap, check


@cold_piece
def wake(s, local, tolerance):
    """Let discs move that are linked to some that did, or overlap; False if there is no room.

    Elsewhere the links are in balance, by their stored multipliers: nothing would move.
    """
    d = len(s.axes)
    for p in range(s.count[NEARS]):
        kind = local.near[p, 2]
        a, b = local.near[p, 0], local.near[p, 1]
        if kind == STRANGERS or (local.active[a] and local.active[b]):
            continue
        if not local.active[a]:
            a, b = b, a
        i, j = np.int64(local.disc[a]), np.int64(local.disc[b])
        moved, square = 0.0, 0.0
        for k in range(d):
            moved += (local.y[a, k] - local.loaded[a, k]) ** 2
            dx = local.y[b, k] - local.y[a, k]
            square += (dx + shift(dx, s.period[k])) ** 2
        sigma = s.radius[i] + s.radius[j]
        far = kind == LINKED and moved > (0.5 * tolerance * sigma) ** 2
        if (far or square < ((1.0 - tolerance) * sigma) ** 2) and not activate(s, local, j):
            return False
    return True


@piece
def advance(s, local, recipe, alpha):
    """Move active discs by one iteration; return the largest displacement in radii."""
    d = len(s.axes)
    c = 0.5 * recipe.damping
    farthest = 0.0
    for a in range(s.count[SLOTS]):
        if local.active[a]:
            square = 0.0
            for k in range(d):
                y, old = local.y[a, k], local.old[a, k]
                new = (2.0 * y - (1.0 - c) * old + alpha * local.force[a, k]) / (1.0 + c)
                local.old[a, k], local.y[a, k] = y, new
                square += (new - local.loaded[a, k]) ** 2
            farthest = larger(farthest, square / s.radius[local.disc[a]] ** 2)
    return math.sqrt(farthest)


@cold_piece
def minimise(s, local, recipe, n):
    """Iterate until no pair overlaps and all links are closed, to tolerance."""
    alpha, beta, kappa = recipe.alpha, recipe.beta, recipe.augmentation
    before = math.inf
    for it in range(recipe.iterations):
        over, gap, check = forces(s, local, recipe, kappa, beta if it > 0 else 0.0, n)
        s.count[ITERATIONS] += 1
        if not math.isfinite(check):
            return FAILED
        if over < recipe.overlap and gap < recipe.gap:
            return PARTED
        if recipe.adaptive and it % _TERM == _TERM - 1:
            if over > 0.5 * before and kappa < _STIFFEST:
                kappa, beta = 1.5 * kappa, 1.5 * beta
                alpha = recipe.alpha * (1.0 + recipe.augmentation) / (1.0 + kappa)
            before = over
        if not advance(s, local, recipe, alpha) <= s.clock[REACH] - 1.0:
            return FAILED
        if not wake(s, local, recipe.overlap):
            return FULL
    return FAILED
