"""The loop of the windowed method.

A window ends before any cluster has moved half a skin since it was listed. Clusters that might
in the next window are listed anew at its start, slow ones every few windows only.
"""

from __future__ import annotations

import math

import numpy as np

from smolux.jit.compile import cold_piece, entry, piece

from .flight import (
    AT_REST,
    BATCH,
    BLOCK,
    BLOCKS,
    BUDGET,
    BUDGET_OF_WAY,
    CHAIN,
    CHECKED,
    CLUSTER,
    CLUSTERS,
    DISC,
    DISCS,
    DONE,
    END,
    EVENT,
    FIRST,
    FULL,
    HEAP,
    LATEST,
    LISTED,
    LISTED_IN,
    LONELY,
    LONGEST,
    MARK_CHECKED,
    MARK_LISTED,
    MARK_PREDICTED,
    MASS,
    NAME,
    NO_EVENTS,
    NO_PAIRS,
    PACKED,
    PAIR,
    PAIRS,
    PREDICTED,
    REBUILT,
    RELABELLED,
    RESKIN,
    SCALE,
    SINCE,
    SKIN,
    STAMP,
    START,
    THICKEST,
    TIME,
    USUAL,
    WAY,
    WHAT,
    WHICH,
    WINDOW,
    WINDOWS,
)
from .geometry import FILLED, larger, power, shift, smaller
from .heap import is_current, pop
from .listing import bring, empty, list_blocks, rebin_chain
from .pairs import remove_all, splice
from .predicting import look_ahead, next_wall, predict_all, predict_listed, speed

#: differences of velocity below this share of the largest speed come from rounding
REST = 1e-13
#: blocks that are listed between two returns
SLICE = 500_000
#: clusters are numbered anew when this many times fewer are left
FEWER = 3
#: all blocks are listed, which is cheaper for each, if more than this share is due
MOST = 0.35
#: windows after which discs are no longer in the order of space
FRESH = 8
#: a step of the skin, and how far its costs may be from balance
STEP, TOO_SMALL, TOO_LARGE = 1.5, 2.0, 0.3
#: costs of a listing for each cell looked at, of a look at a pair and of a prediction
LIST_COST, CHECK_COST, PREDICT_COST = 1.3, 1.0, 12.0


@piece
def foresee(f, c, t):
    """Predict all that concerns a cluster."""
    none = np.int64(0)
    look_ahead(f, c, c + 1, none)
    predict_all(f, c, c + 1, none, t)


@cold_piece
def strike(f, c):
    """Strike all pairs of a cluster off."""
    remove_all(f, c)


@piece
def relist_all(f, work, near):
    """List everything, and predict."""
    t, none, all_ = f.clock[TIME], np.int64(0), np.int64(f.body.shape[0])
    empty(f, t)
    f.count[REBUILT] += 1
    list_blocks(f, none, none, np.int64(f.place.shape[0]), t, none, work, near)
    if f.count[FULL] == 0:
        look_ahead(f, none, all_, none)
        predict_listed(f, t)


@piece
def relist_due(f, work, near):
    """List the clusters that were marked for it, and predict."""
    d = len(f.axes)
    way = 2 * d + WAY
    body, group = f.body, f.group
    t, batch, none = f.clock[TIME], 2 * f.count[BATCH], np.int64(-1)
    all_ = np.int64(body.shape[0])
    for c in range(all_):
        if group[c, LISTED_IN] == batch:
            remove_all(f, c)
            bring(f, c, t)
            body[c, way] = 0.0
            rebin_chain(f, np.int64(group[c, START]), none, t)
    list_blocks(f, all_, none, none, t, batch + 1, work, near)
    look_ahead(f, np.int64(0), all_, batch + 1)
    predict_all(f, np.int64(0), all_, batch + 1, t)


@piece
def fastest(f):
    """Largest speed, and whether nothing moves relative to anything else."""
    d = len(f.axes)
    mass = 2 * d + MASS
    body = f.body
    top, still = 0.0, True
    for c in range(body.shape[0]):
        if body[c, mass] > 0.0:
            top = larger(top, speed(f, c))
    for k in range(d):
        low, high = math.inf, -math.inf
        for c in range(body.shape[0]):
            if body[c, mass] > 0.0:
                low, high = smaller(low, body[c, d + k]), larger(high, body[c, d + k])
        spread = high - low if f.period[k] > 0.0 else larger(high, -low)
        still = still and spread <= REST * f.clock[SCALE]
    return top, still


@piece
def judge_skin(f):
    """Whether another skin would cost less; write it, and begin to count anew."""
    d = len(f.axes)
    count, clock = f.count, f.clock
    listed = count[LISTED] - count[MARK_LISTED]
    if listed < larger(2 * f.place.shape[0], 1000):
        return False
    often = LIST_COST * power(3, f.axes) * listed
    # how many are looked at depends on the skin as much as the cells do
    part = 1.5 * clock[SKIN] / (1.5 * clock[SKIN] + clock[USUAL])
    part = larger(d * part - 1.0, 0.0) / (d - 1)
    wide = CHECK_COST * part * (count[CHECKED] - count[MARK_CHECKED])
    wide += PREDICT_COST * (count[PREDICTED] - count[MARK_PREDICTED])
    count[MARK_LISTED] = count[LISTED]
    count[MARK_CHECKED] = count[CHECKED]
    count[MARK_PREDICTED] = count[PREDICTED]
    skin = clock[SKIN]
    if often > TOO_SMALL * wide and 2 * count[PAIRS] * power(STEP, f.axes) < f.half_edge.shape[0]:
        clock[SKIN] = smaller(skin * STEP, clock[THICKEST])
    elif often < TOO_LARGE * wide:
        clock[SKIN] = skin / STEP
    return clock[SKIN] != skin


@cold_piece
def open_window(f, patience, work, near):
    """Choose the end of a window and list what needs it; return a code."""
    d = len(f.axes)
    since, mass, way = 2 * d + SINCE, 2 * d + MASS, 2 * d + WAY
    body, group, count, clock = f.body, f.group, f.count, f.clock
    t = clock[TIME]
    v, still = fastest(f)
    if still:
        return AT_REST
    if (t - clock[LATEST]) * v > patience * clock[LONGEST]:
        return LONELY
    if judge_skin(f) or FEWER * f.count[CLUSTERS] < body.shape[0]:
        return RESKIN
    count[WINDOWS] += 1
    count[BATCH] += 1
    limit = clock[BUDGET_OF_WAY]
    length = limit / v
    due = 0
    for c in range(body.shape[0]):
        if body[c, mass] > 0.0:
            u = speed(f, c)
            moved = body[c, way] + u * (t - body[c, since])
            if moved + u * length > limit:
                group[c, LISTED_IN] = 2 * count[BATCH]
                due += group[c, BLOCKS]
    clock[WINDOW] = t + length
    if due > MOST * f.place.shape[0] and f.count[WINDOWS] - f.count[PACKED] > FRESH:
        return RESKIN  # all blocks are listed anyway: first into the order of space
    if due > MOST * f.place.shape[0]:
        relist_all(f, work, near)
    elif due > 0:
        relist_due(f, work, near)
    return room(f)


@piece
def room(f):
    """Return a code if something was full."""
    if f.count[FULL] == PAIR:
        return NO_PAIRS
    return NO_EVENTS if f.count[FULL] == EVENT else DONE


@piece
def absorb(f, a, b, image):
    """Make cluster `b`, at the same time, part of cluster `a`; pairs are left alone."""
    d = len(f.axes)
    mass = 2 * d + MASS
    block, group, body, bound = f.block, f.group, f.body, f.bound
    ma, mb = body[a, mass], body[b, mass]
    for k in range(d):
        move = body[b, k] - body[a, k] + image[k]
        q = np.int64(group[b, START])
        while q >= 0:
            f.place[q, k] += move
            q = np.int64(block[q, CHAIN])
        bound[a, k] = smaller(bound[a, k], bound[b, k] + move)
        bound[a, d + k] = larger(bound[a, d + k], bound[b, d + k] + move)
        mean = (ma * body[a, d + k] + mb * body[b, d + k]) / (ma + mb)
        body[a, d + k] = mean
    q = np.int64(group[b, START])
    while q >= 0:
        block[q, CLUSTER] = a
        q = np.int64(block[q, CHAIN])
    block[group[a, END], CHAIN] = group[b, START]
    group[a, END] = group[b, END]
    f.count[RELABELLED] += group[b, BLOCKS]
    group[a, BLOCKS] += group[b, BLOCKS]
    group[a, DISCS] += group[b, DISCS]
    body[a, mass] = ma + mb
    body[b, mass] = 0.0
    group[b, STAMP] += 1


@piece
def image_of(f, i, j, t, image):
    """Write what brings disc `j` to its image nearest to disc `i`."""
    d = len(f.axes)
    disc, block, body, rel, place = f.disc, f.block, f.body, f.rel, f.place
    g, h = disc[i, BLOCK], disc[j, BLOCK]
    m, n = block[g, CLUSTER], block[h, CLUSTER]
    for k in range(d):
        x = rel[j, k] + place[h, k] + body[n, k]
        x -= rel[i, k] + place[g, k] + body[m, k]
        image[k] = shift(x, f.period[k])


@piece
def merge(f, p, t, work, near):
    """Make one cluster of two; return their discs in contact."""
    d = len(f.axes)
    mass, way = 2 * d + MASS, 2 * d + WAY
    body, disc, group, half_edge, block = f.body, f.disc, f.group, f.half_edge, f.block
    i, j = np.int64(half_edge[2 * p, DISC]), np.int64(half_edge[2 * p + 1, DISC])
    if disc[j, NAME] < disc[i, NAME]:
        i, j = j, i
    first, second = disc[i, NAME], disc[j, NAME]
    a, b = (
        np.int64(block[disc[i, BLOCK], CLUSTER]),
        np.int64(block[disc[j, BLOCK], CLUSTER]),
    )
    if group[b, DISCS] > group[a, DISCS]:
        a, b, i, j = b, a, j, i
    bring(f, a, t)
    bring(f, b, t)
    image_of(f, i, j, t, work[0])
    small = np.int64(group[b, START])
    limit = f.clock[BUDGET_OF_WAY]
    mine, other = body[a, way], body[b, way]
    ma, mb = body[a, mass], body[b, mass]
    square = 0.0
    for k in range(d):
        mean = (ma * body[a, d + k] + mb * body[b, d + k]) / (ma + mb)
        square += mean * mean
    ahead = math.sqrt(square) * (f.clock[WINDOW] - t)
    # the way of the new cluster is that of the part that has moved most since its listing
    keep_small, keep_large = other + ahead <= limit, mine + ahead <= limit
    if not keep_small:
        strike(f, b)
    if not keep_large:
        strike(f, a)
    absorb(f, a, b, work[0])
    splice(f, a, b)
    body[a, way] = larger(mine if keep_large else 0.0, other if keep_small else 0.0)
    if not (keep_small and keep_large):
        f.count[BATCH] += 1
        begin = small if keep_large else np.int64(group[a, START])
        stop = small if keep_small else np.int64(-1)
        rebin_chain(f, begin, stop, t)
        list_blocks(f, np.int64(0), begin, stop, t, 2 * f.count[BATCH] + 1, work, near)
    foresee(f, a, t)
    return first, second


@piece
def reflect(f, c, t):
    """Turn a cluster back at a wall; return one of its discs, and the axis as it is logged."""
    d = len(f.axes)
    body, bound = f.body, f.bound
    _, axis = next_wall(f, c)
    bring(f, c, t)
    fills = bound[c, d + axis] - bound[c, axis] >= f.length[axis] * (1.0 - FILLED)
    body[c, d + axis] = 0.0 if fills else -body[c, d + axis]
    foresee(f, c, t)
    return f.disc[f.block[f.group[c, START], FIRST], NAME], np.int32(
        -1 - axis - (d if fills else 0)
    )


@entry
def fly(f, log, until, target, patience, budget, work, near):
    """Go on until there are `target` clusters, to a time or until Python is needed.

    Returns a code, which says why, and the number of events that were logged.
    """
    when, event, count, clock = f.when, f.event, f.count, f.clock
    done, listed = 0, count[LISTED]
    while count[CLUSTERS] > target and clock[TIME] < until:
        if clock[TIME] >= clock[WINDOW]:
            if count[LISTED] - listed > SLICE:
                return BUDGET, done
            code = open_window(f, patience, work, near)
            if code != DONE:
                return code, done
        end = smaller(clock[WINDOW], until)
        while count[HEAP] > 0 and when[0] <= end:
            if done == budget or done == log.time.shape[0]:
                return BUDGET, done
            t, what, which = when[0], np.int64(event[0, WHAT]), event[0, WHICH]
            pop(f)
            if not is_current(f, what, which):
                continue
            clock[TIME] = t
            if what >= 0:
                first, second = merge(f, what, t, work, near)
                count[CLUSTERS] -= 1
                clock[LATEST] = t
            else:
                first, second = reflect(f, -1 - what, t)
            log.time[done], log.first[done], log.second[done] = t, first, second
            done += 1
            code = room(f)
            if code != DONE or count[CLUSTERS] <= target:
                return code, done
        clock[TIME] = end
    return DONE, done
