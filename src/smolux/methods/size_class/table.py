"""The table of pairs of classes from which the size-class method draws its candidates."""

from __future__ import annotations

import math

import numpy as np

from smolux.core.slots import slot_top
from smolux.core.state import BOUND, LARGEST, MAJORANT, PARTICLES, SINCE
from smolux.jit.compile import cold_piece, piece

from . import alias
from .state import AHEAD, BITS, BLOCK, NEXT, PAIRS, SHARE, SPAN, STALE

#: standard deviations of what comes in for which there is room at most
_WIDEST = 8.0


@cold_piece
def _rates_of_places(w, used):
    """Rate at which one place of each class gets candidates, into `weight`; their sum over all."""
    whole = 0.0
    for k in range(used):
        g = w.queue[k]
        total = 0.0
        for m in range(used):
            if m != k:
                total += w.number[w.queue[m]] * w.high[g, w.queue[m]]
        # a particle does not meet itself: that of a lone giant with itself may exceed all others
        whole += 0.5 * w.number[g] * (total + max(w.number[g] - 1, 0) * w.high[g, g])
        w.weight[k] = total + w.number[g] * w.high[g, g]
    return whole


@cold_piece
def _give_room(s, w, used):
    """Choose for how many particles of each class candidates are drawn until the next table.

    More places cost candidates that find them empty; fewer, a new table as soon as a class is full.
    A table costs about as much as 16 candidates and a quarter of one for each pair of classes. So
    there is room for what will come in, and for its scatter as far as a place costs fewer
    candidates than the chance of a new table. The number of events until the next table weighs its
    cost against candidates lost to particles that have gone.
    """
    since = float(max(s.count[SINCE], 1))
    n, table = float(s.count[PARTICLES]), 16.0 + 0.125 * used * (used + 1)
    events = max(min(math.sqrt(n * table), 0.25 * n, 32.0 * since + 64.0), 1.0)
    w.meta[BLOCK] = np.int64(events)
    w.meta[SPAN] = w.meta[SPAN] // 2 + np.int64(since)
    whole = _rates_of_places(w, used)
    for k in range(used):
        g = w.queue[k]
        # half a particle is added for each class: what is rare and was not seen lately comes too
        come = (w.flow[g] / SHARE + 0.5) / (w.meta[SPAN] + 0.5 * used)
        gain = max(w.number[g] - w.before[g] - math.sqrt(come * since), 0.0) / since
        worth = table * whole / (events * w.weight[k])
        # what meets nothing costs no candidates, and has room for any scatter that is seen
        spread = min(math.sqrt(2.0 * math.log(worth)), _WIDEST) if worth > 1.0 else 0.0
        slack = events * gain + spread * math.sqrt(events * come)
        w.room[g] = w.number[g] + np.int64(slack + 0.5)
        w.before[g] = w.number[g]
        w.flow[g] //= 2


@cold_piece
def _weigh(s, w, used):
    """Enter the pairs of classes and their rates into the table.

    False if a bound is not known, or if their sum is beyond all numbers.
    """
    pairs, total = 0, 0.0
    for k in range(used):
        g = w.queue[k]
        for m in range(k, used):
            h = w.queue[m]
            half = 0.5 if g == h else 1.0
            weight = half * float(w.room[g]) * float(w.room[h]) * w.high[g, h]
            if math.isnan(weight):
                return False
            if weight > 0.0 and (g != h or w.room[g] > 1):  # with room for one, there is no pair
                w.weight[pairs] = weight
                w.classes[pairs] = (g << 16) | h
                total += weight
                pairs += 1
    s.clock[MAJORANT] = total
    w.meta[PAIRS] = pairs
    return total < math.inf


@cold_piece
def _renew(s, w):
    """Make the table of pairs of classes afresh; `BOUND` if a bound is not known yet."""
    used = 0
    for g in range(1, w.number.shape[0]):
        if w.number[g] > 0 or w.flow[g] > 0:
            w.queue[used] = g
            used += 1
        else:
            w.room[g] = w.before[g] = 0
    if used == 0:  # nothing is there, so nothing can be drawn
        s.clock[MAJORANT] = 0.0
        return 0
    largest = w.queue[used - 1]
    present = used - 1
    while w.number[w.queue[present]] == 0 and present > 0:
        present -= 1
    s.count[LARGEST] = slot_top(np.int64(w.queue[present]), w.meta[BITS])
    if math.isnan(w.low[largest, largest]):
        return BOUND
    _give_room(s, w, used)
    if not _weigh(s, w, used):
        return BOUND
    s.count[SINCE] = 0
    w.meta[STALE] = 0
    w.meta[NEXT] = AHEAD
    pairs = w.meta[PAIRS]
    if pairs > 0:
        alias.build(w.weight[:pairs], s.clock[MAJORANT], w.share, w.alias, w.queue)
        for k in range(pairs):  # what is accepted whatever the rate
            w.weight[k] = w.low[w.classes[k] >> 16, w.classes[k] & 0xFFFF]
        alias.pack(pairs, w.share, w.alias, w.classes, w.weight, w.table)
    return 0


@piece
def prepare(s, w, p):
    """Renew the table if it is stale or its time has come."""
    if w.meta[STALE] == 1 or s.count[SINCE] >= w.meta[BLOCK]:
        return _renew(s, w)
    return 0
