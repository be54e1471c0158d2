"""The loop of the windowed method.

A window ends before any cluster has moved half a skin since it was listed. Those that might in the
next one are listed anew at its start, slow ones every few windows only.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.compile import cold_piece, entry, piece
from . import listing
from .flight import (
    AFTER,
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
    DISCS,
    DONE,
    EDGE,
    END,
    EVENT,
    FIRST,
    FULL,
    HEAP,
    HORIZON,
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
    ONE,
    PAIR,
    PREDICTED,
    REBUILT,
    RELABELLED,
    RESKIN,
    SCALE,
    SINCE,
    SKIN,
    SPREAD,
    STAMP,
    START,
    THICKEST,
    TIME,
    TWO,
    USED,
    VERSION,
    WAY,
    WHAT,
    WHICH,
    WINDOW,
    WINDOWS,
)
from .geometry import FILLED, contact_time, shift, wall_time
from .heap import is_current, pop, push
from .pairs import remove, remove_all, splice

#: differences of velocity below this share of the largest speed come from rounding
REST = 1e-13
#: blocks that are listed between two returns
SLICE = 500_000
#: a step of the skin, and how far its costs may be from balance
STEP, TOO_SMALL, TOO_LARGE = 1.5, 2.0, 0.3
#: costs of a listing, of a look at a pair and of a prediction, in arbitrary units
LIST_COST, CHECK_COST, PREDICT_COST = 12.0, 1.0, 5.0


def bind(d):
    """Bind the loop for `d` dimensions."""
    bring, empty, list_blocks, rebin_chain = listing.bind(d)
    since, mass, way, horizon = 2 * d + SINCE, 2 * d + MASS, 2 * d + WAY, 2 * d + HORIZON

    @piece
    def speed(f, c):
        square = 0.0
        for k in range(d):
            square += f.body[c, d + k] ** 2
        return math.sqrt(square)

    @piece
    def predict(f, p, t):
        """Predict the contact of a pair, and remember it if nothing is known to come before."""
        i, j = f.pair[p, ONE], f.pair[p, TWO]
        g, h = f.disc[i, BLOCK], f.disc[j, BLOCK]
        m, n = f.block[g, CLUSTER], f.block[h, CLUSTER]
        spread = f.count[SPREAD]
        s = f.radius[i * spread] + f.radius[j * spread]
        dm, dn = t - f.body[m, since], t - f.body[n, since]
        a, b, c = 0.0, 0.0, -s * s
        for k in range(d):
            vm, vn = f.body[m, d + k], f.body[n, d + k]
            x = f.rel[j, k] + f.place[h, k] + f.body[n, k] + vn * dn
            x -= f.rel[i, k] + f.place[g, k] + f.body[m, k] + vm * dm
            x += shift(x, f.period[k])
            w = vn - vm
            a += w * w
            b += x * w
            c += x * x
        f.count[PREDICTED] += 1
        touch = t + contact_time(a, b, c)
        if touch <= min(f.body[m, horizon], f.body[n, horizon]):
            push(f, touch, p, f.pair[p, VERSION])

    @piece
    def next_wall(f, c):
        """Time at which a cluster touches a wall, and the axis; without a later change."""
        best, axis = math.inf, 0
        for k in range(d):
            if f.period[k] == 0.0:
                x = f.body[c, k]
                t = wall_time(
                    f.bound[c, k] + x, f.bound[c, d + k] + x, f.body[c, d + k], f.length[k]
                )
                if t < best:
                    best, axis = t, k
        return f.body[c, since] + best, axis

    @cold_piece
    def look_ahead(f, c):
        """Set until when a cluster flies freely: up to a wall, or to the end of its way."""
        left = f.clock[BUDGET_OF_WAY] - f.body[c, way]
        v = speed(f, c)
        end = f.body[c, since] + left / v if v > 0.0 else math.inf
        f.group[c, STAMP] += 1
        wall, _ = next_wall(f, c)
        if wall <= end:
            push(f, wall, -1 - c, f.group[c, STAMP])
            end = wall
        f.body[c, horizon] = end

    @cold_piece
    def predict_all(f, c, t):
        """Predict all contacts of a cluster; pairs inside it are struck off. Of all, if c < 0."""
        h = np.int64(0)
        if c >= 0:
            h = np.int64(f.group[c, EDGE])
        elif f.count[USED] == 0:
            h = np.int64(-1)
        while h >= 0:
            p, after = h >> 1, np.int64(f.link[h, AFTER])
            if c < 0:
                after = h + 2 if h + 2 < 2 * f.count[USED] else np.int64(-1)
            elif (
                f.block[f.disc[f.pair[p, ONE], BLOCK], CLUSTER]
                == f.block[f.disc[f.pair[p, TWO], BLOCK], CLUSTER]
            ):
                if after == h ^ 1:
                    after = np.int64(f.link[after, AFTER])
                remove(f, p, c, c)
                h = after
                continue
            f.pair[p, VERSION] += 1
            predict(f, p, t)
            h = after

    @cold_piece
    def strike(f, c):
        """Strike all pairs of a cluster off."""
        remove_all(f, c)

    @piece
    def relist_all(f, work):
        """List everything, and predict."""
        t = f.clock[TIME]
        empty(f, t)
        f.count[REBUILT] += 1
        list_blocks(f, np.int64(0), np.int64(f.place.shape[0]), t, np.int64(-1), work)
        for c in range(f.body.shape[0]):
            if f.body[c, mass] > 0.0:
                look_ahead(f, c)
        if f.count[FULL] == 0:
            predict_all(f, np.int64(-1), t)

    @piece
    def relist_due(f, work):
        """List the clusters that were marked for it, and predict."""
        t, number, none = f.clock[TIME], 2 * f.count[BATCH], np.int64(-1)
        for c in range(f.body.shape[0]):
            if f.group[c, LISTED_IN] == number:
                strike(f, c)
                bring(f, c, t)
                f.body[c, way] = 0.0
                rebin_chain(f, np.int64(f.group[c, START]), none, t)
        for c in range(f.body.shape[0]):
            if f.group[c, LISTED_IN] == number:
                list_blocks(f, np.int64(f.group[c, START]), none, t, number + 1, work)
                f.group[c, LISTED_IN] = number + 1
                look_ahead(f, c)
        for c in range(f.body.shape[0]):
            if f.group[c, LISTED_IN] == number + 1:
                predict_all(f, np.int64(c), t)

    @piece
    def fastest(f):
        """Largest speed, and whether nothing moves relative to anything else."""
        square, still = 0.0, True
        for c in range(f.body.shape[0]):
            if f.body[c, mass] > 0.0:
                square = max(square, speed(f, c) ** 2)
        for k in range(d):
            low, high = math.inf, -math.inf
            for c in range(f.body.shape[0]):
                if f.body[c, mass] > 0.0:
                    low, high = min(low, f.body[c, d + k]), max(high, f.body[c, d + k])
            spread = high - low if f.period[k] > 0.0 else max(high, -low)
            still = still and spread <= REST * f.clock[SCALE]
        return math.sqrt(square), still

    @piece
    def judge_skin(f):
        """Whether another skin would cost less; write it, and begin to count anew."""
        listed = f.count[LISTED] - f.count[MARK_LISTED]
        if listed < max(2 * f.place.shape[0], 1000):
            return False
        often = LIST_COST * listed
        wide = CHECK_COST * (f.count[CHECKED] - f.count[MARK_CHECKED])
        wide += PREDICT_COST * (f.count[PREDICTED] - f.count[MARK_PREDICTED])
        f.count[MARK_LISTED] = f.count[LISTED]
        f.count[MARK_CHECKED] = f.count[CHECKED]
        f.count[MARK_PREDICTED] = f.count[PREDICTED]
        skin = f.clock[SKIN]
        if often > TOO_SMALL * wide:
            f.clock[SKIN] = min(skin * STEP, f.clock[THICKEST])
        elif often < TOO_LARGE * wide:
            f.clock[SKIN] = skin / STEP
        return f.clock[SKIN] != skin

    @cold_piece
    def open_window(f, patience, work):
        """Choose the end of a window and list what needs it; return a code."""
        t = f.clock[TIME]
        v, still = fastest(f)
        if still:
            return AT_REST
        if (t - f.clock[LATEST]) * v > patience * f.clock[LONGEST]:
            return LONELY
        if judge_skin(f):
            return RESKIN
        f.count[WINDOWS] += 1
        f.count[BATCH] += 1
        limit = f.clock[BUDGET_OF_WAY]
        length = limit / v
        due = 0
        for c in range(f.body.shape[0]):
            if f.body[c, mass] > 0.0:
                u = speed(f, c)
                moved = f.body[c, way] + u * (t - f.body[c, since])
                if moved + u * length > limit:
                    f.group[c, LISTED_IN] = 2 * f.count[BATCH]
                    due += f.group[c, BLOCKS]
        f.clock[WINDOW] = t + length
        if 2 * due > f.place.shape[0]:
            relist_all(f, work)
        elif due > 0:
            relist_due(f, work)
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
        ma, mb = f.body[a, mass], f.body[b, mass]
        for k in range(d):
            move = f.body[b, k] - f.body[a, k] + image[k]
            q = np.int64(f.group[b, START])
            while q >= 0:
                f.place[q, k] += move
                q = np.int64(f.block[q, CHAIN])
            f.bound[a, k] = min(f.bound[a, k], f.bound[b, k] + move)
            f.bound[a, d + k] = max(f.bound[a, d + k], f.bound[b, d + k] + move)
            mean = (ma * f.body[a, d + k] + mb * f.body[b, d + k]) / (ma + mb)
            f.body[a, d + k] = mean
        q = np.int64(f.group[b, START])
        while q >= 0:
            f.block[q, CLUSTER] = a
            q = np.int64(f.block[q, CHAIN])
        f.block[f.group[a, END], CHAIN] = f.group[b, START]
        f.group[a, END] = f.group[b, END]
        f.count[RELABELLED] += f.group[b, BLOCKS]
        f.group[a, BLOCKS] += f.group[b, BLOCKS]
        f.group[a, DISCS] += f.group[b, DISCS]
        f.body[a, mass] = ma + mb
        f.body[b, mass] = 0.0
        f.group[b, STAMP] += 1

    @piece
    def image_of(f, i, j, t, image):
        """Write what brings disc `j` to its image nearest to disc `i`."""
        g, h = f.disc[i, BLOCK], f.disc[j, BLOCK]
        m, n = f.block[g, CLUSTER], f.block[h, CLUSTER]
        for k in range(d):
            x = f.rel[j, k] + f.place[h, k] + f.body[n, k]
            x -= f.rel[i, k] + f.place[g, k] + f.body[m, k]
            image[k] = shift(x, f.period[k])

    @piece
    def merge(f, p, t, work):
        """Make one cluster of two; return their discs in contact."""
        i, j = np.int64(f.pair[p, ONE]), np.int64(f.pair[p, TWO])
        if f.disc[j, NAME] < f.disc[i, NAME]:
            i, j = j, i
        first, second = f.disc[i, NAME], f.disc[j, NAME]
        a, b = (
            np.int64(f.block[f.disc[i, BLOCK], CLUSTER]),
            np.int64(f.block[f.disc[j, BLOCK], CLUSTER]),
        )
        if f.group[b, DISCS] > f.group[a, DISCS]:
            a, b, i, j = b, a, j, i
        bring(f, a, t)
        bring(f, b, t)
        image_of(f, i, j, t, work[0])
        small = np.int64(f.group[b, START])
        limit = f.clock[BUDGET_OF_WAY]
        mine, other = f.body[a, way], f.body[b, way]
        ma, mb = f.body[a, mass], f.body[b, mass]
        square = 0.0
        for k in range(d):
            square += ((ma * f.body[a, d + k] + mb * f.body[b, d + k]) / (ma + mb)) ** 2
        ahead = math.sqrt(square) * (f.clock[WINDOW] - t)
        # a cluster has moved as far as its part that has moved most since it was listed
        keep_small, keep_large = other + ahead <= limit, mine + ahead <= limit
        if not keep_small:
            strike(f, b)
        if not keep_large:
            strike(f, a)
        absorb(f, a, b, work[0])
        splice(f, a, b)
        f.body[a, way] = max(mine if keep_large else 0.0, other if keep_small else 0.0)
        if not (keep_small and keep_large):
            f.count[BATCH] += 1
            begin = small if keep_large else np.int64(f.group[a, START])
            stop = small if keep_small else np.int64(-1)
            rebin_chain(f, begin, stop, t)
            list_blocks(f, begin, stop, t, 2 * f.count[BATCH] + 1, work)
        look_ahead(f, a)
        predict_all(f, a, t)
        return first, second

    @piece
    def reflect(f, c, t):
        """Turn a cluster back at a wall; return one of its discs, and the axis as it is logged."""
        _, axis = next_wall(f, c)
        bring(f, c, t)
        fills = f.bound[c, d + axis] - f.bound[c, axis] >= f.length[axis] * (1.0 - FILLED)
        f.body[c, d + axis] = 0.0 if fills else -f.body[c, d + axis]
        look_ahead(f, c)
        predict_all(f, c, t)
        return f.disc[f.block[f.group[c, START], FIRST], NAME], np.int32(
            -1 - axis - (d if fills else 0)
        )

    def fly(f, log, until, target, patience, budget, work):
        done, listed = 0, f.count[LISTED]
        while f.count[CLUSTERS] > target and f.clock[TIME] < until:
            if f.clock[TIME] >= f.clock[WINDOW]:
                if f.count[LISTED] - listed > SLICE:
                    return BUDGET, done
                code = open_window(f, patience, work)
                if code != DONE:
                    return code, done
            end = min(f.clock[WINDOW], until)
            while f.count[HEAP] > 0 and f.when[0] <= end:
                if done == budget or done == log.time.shape[0]:
                    return BUDGET, done
                t, what, which = f.when[0], np.int64(f.event[0, WHAT]), f.event[0, WHICH]
                pop(f)
                if not is_current(f, what, which):
                    continue
                f.clock[TIME] = t
                if what >= 0:
                    first, second = merge(f, what, t, work)
                    f.count[CLUSTERS] -= 1
                    f.clock[LATEST] = t
                else:
                    first, second = reflect(f, -1 - what, t)
                log.time[done], log.first[done], log.second[done] = t, first, second
                done += 1
                code = room(f)
                if code != DONE or f.count[CLUSTERS] <= target:
                    return code, done
            f.clock[TIME] = end
        return DONE, done

    return entry(fly)
