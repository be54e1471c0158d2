"""Rates and their bounds: thinning, and what is noted of a rate that is above its bound or none."""

from __future__ import annotations

from smolux.jit.compile import cold_piece, piece

from .state import (
    BAD_FACTOR,
    CULPRIT,
    FLOOR,
    IN_DOUBT,
    LARGEST,
    PROCESS,
    REPAIRS,
    VALUE,
    WORST_I,
    WORST_J,
)

#: what a value may be above its bound by rounding
ROUNDING = 1.0 + 1e-12


@piece
def thinned(s, r, value, bound, share):
    """Keep process `r` by its true factor, or none (-1); `share` is uniform below the bound of it.

    A factor above its bound or without meaning is noted, and the reason to return with a minus is
    what comes back.
    """
    if not 0.0 <= value <= bound * ROUNDING:
        s.clock[VALUE] = value
        s.count[PROCESS] = r
        return -BAD_FACTOR
    return r if share < value else -1


@cold_piece
def repair(s, i, j, value, bound):
    """Note a rate above its bound and raise the bound for the rest of the run.

    Until then pairs of a rate K above their bound B were candidates at the rate c B and all
    accepted, so that collisions were missing at the rate c (K - B). Each such collision that takes
    place adds ``K/B - 1`` to the estimate of those missed. Its expectation is right, whatever sizes
    came and went and whenever the bound was raised: what is counted at the rate c B with these
    marks grows on average by the integral of ``c B (K/B - 1)``, which is what was missing.
    """
    s.missed[IN_DOUBT] = value / bound - 1.0
    s.count[REPAIRS] += 1
    s.count[WORST_I], s.count[WORST_J] = i, j
    s.clock[FLOOR] = max(s.clock[FLOOR], 1.1 * value)


@cold_piece
def note_bad(s, i, j, value):
    """Note a rate that is negative, infinite or undefined: the run cannot go on."""
    s.count[WORST_I], s.count[WORST_J], s.count[CULPRIT] = i, j, 0
    s.clock[VALUE] = value


@piece
def note_largest(s, size):
    """Keep the bound of the sizes present above a new size."""
    if size > s.count[LARGEST]:
        s.count[LARGEST] = size
