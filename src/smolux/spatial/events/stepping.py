"""The loop of the time-stepping method."""

from __future__ import annotations

import math

from smolux.jit.compile import cold_piece, entry, piece

from .direct import REST
from .geometry import larger, largest, smaller
from .minimising import FULL, PARTED, RELOAD
from .relax import overlap_of, part, settle
from .steps import (
    CLUSTERS,
    CONTACTS,
    FAILURES,
    LATEST,
    REACH,
    SCALE,
    SKIN,
    STEPS,
    TIME,
    WAY,
    WIDEST,
    choose_skin,
    fly,
    list_pairs,
    look,
    merge,
    take_back,
)

# Why the loop returned.
DONE = 0
BUDGET = 1
AT_REST = 2
LONELY = 3
OBSERVE = 4  # the next step would go beyond an output time
NO_PAIRS = 5
NO_NEARS = 6
HOPELESS = 7  # minimisations fail however short the step is

#: a step is halved so often at most
_HALVINGS = 24


@piece
def speeds(s):
    """Return the largest speed, and whether nothing can meet."""
    d = len(s.axes)
    fastest, still = 0.0, True
    for k in range(d):
        low = high = s.v[s.alive[0], k]
        for q in range(s.count[CLUSTERS]):
            v = s.v[s.alive[q], k]
            low, high = smaller(low, v), larger(high, v)
        spread = high - low if s.period[k] > 0.0 else larger(high, -low)
        still = still and spread <= REST * s.clock[SCALE]
    for q in range(s.count[CLUSTERS]):
        square = 0.0
        for k in range(d):
            square += s.v[s.alive[q], k] ** 2
        fastest = larger(fastest, square)
    return math.sqrt(fastest), still


@cold_piece
def merge_all(s, recipe, log, done, time, n):
    """Make one cluster of all that touch; log the first contact of each two.

    Rigid clusters that a third one has pushed apart again do not touch.
    """
    for q in range(s.count[CONTACTS]):
        i, j = s.contact[q, 0], s.contact[q, 1]
        if s.label[i] != s.label[j] and overlap_of(s, i, j, n) >= -recipe.gap:
            merge(s, i, j)
            log.time[done], log.first[done], log.second[done] = time, i, j
            done += 1
            s.clock[LATEST] = time
    return done


@piece
def try_step(s, local, recipe, dt, fastest, log, done, n):
    """Take a step, or none; return what came out and the log's length."""
    begin = done
    done = fly(s, dt, fastest, log, done)
    look(s)
    code = PARTED
    if s.count[CONTACTS] > 0:
        code = part(s, local, recipe, n)
        if code == PARTED:
            done = merge_all(s, recipe, log, done, s.clock[TIME] + dt, n)
        settle(s, local, code == PARTED)
    if code != PARTED:
        take_back(s)
        done = begin
    return code, done


@piece
def too_old(s, way):
    """Whether the lists do not suffice for a step in which the fastest cluster moves so far."""
    clock = s.clock
    # what is left of the half skin is for what a minimisation moves
    spare = 0.5 * (clock[REACH] - 1.0) * clock[WIDEST]
    return clock[WAY] + way > larger(0.25 * clock[SKIN], 0.5 * clock[SKIN] - spare)


@entry
def advance(s, local, recipe, log, step, until, next_time, target, patience, budget, n):
    """Take steps until there are `target` clusters, to a time or until Python is needed.

    Returns a code, which says why, and the number of events that were logged.
    """
    clock, count, d = s.clock, s.count, len(s.axes)
    longest = largest(s.length)
    done, taken, halvings, fresh = 0, 0, 0, False
    while count[CLUSTERS] > target and clock[TIME] < until:
        room = log.time.shape[0] - done
        if taken == budget or room < (d + 1) * count[CLUSTERS]:
            return BUDGET, done
        fastest, still = speeds(s)
        if still:
            return AT_REST, done
        if (clock[TIME] - clock[LATEST]) * fastest > patience * longest:
            return LONELY, done
        dt = step / fastest / 2.0**halvings
        if clock[TIME] + smaller(dt, until - clock[TIME]) > next_time:
            return OBSERVE, done
        last = dt >= until - clock[TIME]
        dt = until - clock[TIME] if last else dt
        if too_old(s, fastest * dt):
            choose_skin(s)
            if not list_pairs(s):
                clock[WAY] = math.inf
                return NO_PAIRS, done
            fresh = True
        code, done = try_step(s, local, recipe, dt, fastest, log, done, n)
        if code == PARTED:
            clock[TIME] = until if last else clock[TIME] + dt
            count[STEPS] += 1
            taken += 1
            halvings = 0
        else:
            # the lists may have been too old: with new ones the same step may do
            clock[WAY] = math.inf
            if code == FULL:
                return NO_NEARS, done
            if code != RELOAD or fresh:
                count[FAILURES] += 1
                halvings += 1
                if halvings > _HALVINGS:
                    return HOPELESS, done
        fresh = False
    return DONE, done
