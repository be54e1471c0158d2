"""Putting discs into the order of space, and those of a cluster that are neighbours into blocks."""

from __future__ import annotations

import math

import numpy as np

from smolux.jit.compile import entry, piece

from .flight import (
    BLOCK,
    BLOCKS,
    CHAIN,
    CLUSTER,
    DISCS,
    END,
    FIRST,
    NAME,
    SINCE,
    START,
)


@piece
def cell_of_disc(x, i, length, period, cells):
    """Return the cell of a disc, wrapped into the box."""
    cell = np.int64(0)
    for k in range(x.shape[1]):
        y, n = x[i, k], cells[k]
        if period[k] > 0.0:
            y -= period[k] * math.floor(y / period[k])
        cell = cell * n + min(max(np.int64(y / length[k] * n), 0), n - 1)
    return cell


@entry
def positions(f, t, x):
    """Write where the discs are at a time, in the order of the flight."""
    body = f.body
    d = x.shape[1]
    for i in range(x.shape[0]):
        b = f.disc[i, BLOCK]
        c = f.block[b, CLUSTER]
        dt = t - body[c, 2 * d + SINCE]
        for k in range(d):
            x[i, k] = f.rel[i, k] + f.place[b, k] + (body[c, k] + body[c, d + k] * dt)


@piece
def same_block(x, i, j, label, span):
    """Whether two discs of a cell may share a block: of one cluster, and of one image of it."""
    if label[i] != label[j]:
        return False
    near = True
    for k in range(x.shape[1]):
        near = near and abs(x[i, k] - x[j, k]) <= span
    return near


@entry
def order(x, label, length, period, cells, span, counts, perm, opens):
    """Sort discs by cell and cluster; mark those that open a block, and count these.

    A block holds discs of one cluster in one cell, none further than `span` from its first along
    any axis; with a negative `span` it holds one disc.
    """
    n = x.shape[0]
    counts[:] = 0
    for i in range(n):
        counts[cell_of_disc(x, i, length, period, cells) + 1] += 1
    for c in range(counts.shape[0] - 1):
        counts[c + 1] += counts[c]
    for i in range(n):
        c = cell_of_disc(x, i, length, period, cells)
        perm[counts[c]] = i
        counts[c] += 1
    # now a cell starts where the cell before ends
    start = 0
    for c in range(counts.shape[0] - 1):
        stop = counts[c]
        for m in range(start + 1, stop):
            i, k = perm[m], m
            while k > start and label[perm[k - 1]] > label[i]:
                perm[k] = perm[k - 1]
                k -= 1
            perm[k] = i
        start = stop
    blocks, lead, cell = 0, -1, -1
    for m in range(n):
        i = perm[m]
        own = cell_of_disc(x, i, length, period, cells)
        if lead < 0 or own != cell or not same_block(x, lead, i, label, span):
            lead, cell = i, own
            opens[m] = True
            blocks += 1
        else:
            opens[m] = False
    return blocks


@piece
def close(f, b, x, perm):
    """Put the place of a block into the middle of its discs."""
    block = f.block
    for k in range(x.shape[1]):
        low, high = math.inf, -math.inf
        for m in range(block[b, FIRST], block[b + 1, FIRST]):
            low, high = min(low, x[perm[m], k]), max(high, x[perm[m], k])
        middle = 0.5 * (low + high)
        f.place[b, k] = middle
        f.half[b, k] = 0.5 * (high - low) * (1.0 + 1e-6) if high > low else 0.0
        for m in range(block[b, FIRST], block[b + 1, FIRST]):
            f.rel[m, k] = x[perm[m], k] - middle


@entry
def pack(f, x, label, names, perm, opens, new_label):
    """Fill discs, blocks and chains of a flight; clusters are numbered as they are met.

    `new_label` is -1 and becomes the new number of each cluster. Returns the number of clusters.
    """
    block, disc, group = f.block, f.disc, f.group
    blocks, clusters = 0, 0
    for m in range(perm.shape[0]):
        i = perm[m]
        disc[m, NAME] = names[i]
        if opens[m]:
            block[blocks, FIRST] = m
            c = new_label[label[i]]
            if c < 0:
                c = clusters
                new_label[label[i]] = c
                clusters += 1
                group[c, START] = blocks
                group[c, BLOCKS] = 0
                group[c, DISCS] = 0
            else:
                block[group[c, END], CHAIN] = blocks
            group[c, END] = blocks
            block[blocks, CHAIN] = -1
            block[blocks, CLUSTER] = c
            group[c, BLOCKS] += 1
            blocks += 1
        disc[m, BLOCK] = blocks - 1
        group[block[blocks - 1, CLUSTER], DISCS] += 1
    block[blocks, FIRST] = perm.shape[0]
    for b in range(blocks):
        close(f, b, x, perm)
    return clusters
