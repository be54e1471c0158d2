"""Single particles: their rates, what comes of them, and how the next one is drawn.

One is drawn with equal chance, and thinned by its rate over the greatest one of the sizes present.
Rates are bounded for ranges of sizes, see `smolux.core.slots`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from . import rng
from .compile import cold_piece, piece, user_piece
from .loop import PATIENCE, ROUNDING, note_bad
from .slots import slot_of
from .state import (
    CHANCE,
    CLOCKS,
    LARGEST,
    LONE,
    LONE_SIZE,
    PARTICLES,
    RAISED,
    REPAIRS,
    TRIALS,
    WINDOW,
    WORST_I,
    WORST_J,
)

#: classes an octave in which the rates of single particles are bounded, as a power of two
CEILING_BITS = 3


class Lone(NamedTuple):
    """A process of single particles, plain; see `smolux.processes.base.LoneProcess`."""

    law: Callable[..., Any]
    outcome: Callable[..., Any]
    least: int
    splits: bool
    removes: bool


def _bind_rate(process: Lone) -> Any:
    """Rate ``(size, u, parameters)`` of one process."""
    law, least = user_piece(process.law), process.least
    if process.splits:

        @cold_piece
        def split(size, u, q):
            if size < 2:
                return 0.0
            i = np.int64(1) + np.int64(u * (size - 1))
            return 0.5 * float(size - 1) * float(law(float(i), float(size - i), *q))

        return split

    @cold_piece
    def rate(size, u, q):
        return float(law(float(size), *q)) if size >= least else 0.0

    return rate


def bind_rates(processes: Sequence[Lone]) -> Any:
    """Bind ``rate(r, size, u, q)`` of all processes of single particles; 0 without any."""
    if not processes:

        @piece
        def none(r, size, u, q):
            return 0.0

        return none
    first = _bind_rate(processes[0])
    if len(processes) == 1:

        @piece
        def last(r, size, u, q):
            return first(size, u, q[0])

        return last
    others = bind_rates(processes[1:])

    @piece
    def rate(r, size, u, q):
        if r == 0:
            return first(size, u, q[0])
        return others(r - 1, size, u, q[1:])

    return rate


def bind_outcomes(processes: Sequence[Lone]) -> Any:
    """Bind ``outcome(r, size, u, s)``, and whether mass leaves by it."""
    if not processes:

        @piece
        def none(r, size, u, s):
            return 0, False

        return none
    first, removes = piece(processes[0].outcome), processes[0].removes
    if len(processes) == 1:

        @piece
        def last(r, size, u, s):
            return first(size, u, s.sizes, s.counts), removes

        return last
    others = bind_outcomes(processes[1:])

    @piece
    def outcome(r, size, u, s):
        if r == 0:
            return first(size, u, s.sizes, s.counts), removes
        return others(r - 1, size, u, s)

    return outcome


def make_lone(lone: Callable[..., Any], rate: Callable[..., Any], pairs: int, count: int) -> Any:
    """Bind the drawing of the next event of a single particle: the waiting time, NaN if no rate."""

    @cold_piece
    def note(s, size, value):
        note_bad(s, size, np.int64(0), value)

    @cold_piece
    def repair(s, size, factor):
        s.count[REPAIRS] += 1
        s.count[WORST_I], s.count[WORST_J] = size, 0
        s.clock[RAISED] = max(s.clock[RAISED], 1.1 * factor - 1.0)

    @piece
    def factor_bound(s, windows, r):
        k = pairs + r
        return windows.bounds[s.count[WINDOW], k] + s.clock[CLOCKS + k]

    @cold_piece
    def draw_lone(s, w, windows, q):
        s.count[LONE] = -1
        n = s.count[PARTICLES]
        if n == 0:
            return math.inf
        slot = slot_of(s.count[LARGEST], np.int64(CEILING_BITS))
        most = 0.0
        for r in range(count):
            most += factor_bound(s, windows, r) * windows.ceiling[r, slot]
        most *= 1.0 + s.clock[RAISED]
        if not most < math.inf:
            note(s, s.count[LARGEST], most)
            return math.nan
        if most <= 0.0:
            return math.inf
        wait = 0.0
        for _ in range(PATIENCE):
            s.count[TRIALS] += 1
            wait += rng.exponential(s.rng)
            one, size = lone(s, w, rng.below(s.rng, n))
            u = rng.uniform(s.rng)
            total = 0.0
            for r in range(count):
                value = rate(r, size, u, q.lone)
                if not 0.0 <= value < math.inf:
                    note(s, size, value)
                    return math.nan
                total += factor_bound(s, windows, r) * value
            if total > most * ROUNDING:
                repair(s, size, total / most * (1.0 + s.clock[RAISED]))
            if rng.uniform(s.rng) * most < total:
                s.count[LONE], s.count[LONE_SIZE] = one, size
                s.clock[CHANCE] = u
                break
        return wait / (float(n) * most)

    return draw_lone
