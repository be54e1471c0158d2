"""Single particles: their rates, what comes of them, and how the next one is drawn.

The particles are counted in slots of sizes, an eighth of an octave each, and every slot remembers
the largest rate of what was in it since it was last empty. So the sum of the rates of all is known
to within what rates differ in a slot, whatever a few large particles do. A slot is drawn by its
sum, with what the store holds together with it (`smolux.core.pick`), a particle of that by the
largest rates of their slots, and thinned by its own rate. The bounds are rates of sizes
that are there, not of sizes that were tried: a rate that is not zero at one size only is not
overlooked.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from smolux.jit.compile import cold_piece, piece, user_piece

from . import rng
from .loop import PATIENCE
from .slots import slot_of
from .splits import bind_splits
from .state import (
    CLOCKS,
    COUNTED,
    CULPRIT,
    LARGEST,
    PARTICLES,
    SPLITS,
    TRIALS,
    UNARY,
    UNARY_BITS,
    UNARY_PART,
    UNARY_PROCESS,
    UNARY_SIZE,
    VAIN,
    VALUE,
    WANTED,
    WINDOW,
    WORST_I,
    WORST_J,
)

#: candidates in vain, for each particle, after which all are counted afresh
_ENOUGH = 4


class Unary(NamedTuple):
    """A process of single particles, plain; see `smolux.processes.base.UnaryProcess`."""

    law: Callable[..., Any]
    outcome: Callable[..., Any]
    least: int
    splits: bool
    removes: bool


class Rates(NamedTuple):
    """Rates of all processes of single particles, bound; `q` is ``Parameters.unary``.

    Attributes
    ----------
    total : ``total(r, size, s, q)``
        Rate of process `r`, or an upper bound of it if it splits; NaN if there is none.
    known : ``known(size, q)``
        Whether all of them can be told, or bounds of splits are to be asked for.
    part : ``part(r, size, s, q)``
        What becomes of it: for one that splits a fragment, 0 if it comes to nothing, -1 for a rate
        that is none; 1 for others.
    """

    total: Any
    known: Any
    part: Any


def _bind_one(process: Unary) -> Rates:
    if process.splits:
        total, known, part = bind_splits(process.law)
        return Rates(total, known, part)
    law, least = user_piece(process.law), process.least

    @cold_piece
    def rate(size, s, q):
        return float(law(float(size), *q[0])) if size >= least else 0.0

    @piece
    def always(size, q):
        return True

    @piece
    def whole(size, s, q):
        return np.int64(1)

    return Rates(rate, always, whole)


def bind_rates(processes: Sequence[Unary]) -> Rates:
    """Bind the rates of all processes; without any, what is never called."""
    if not processes:
        return Rates(None, None, None)
    first = _bind_one(processes[0])
    if len(processes) == 1:

        @piece
        def last_total(r, size, s, q):
            return first.total(size, s, q[0])

        @piece
        def last_known(size, q):
            return first.known(size, q[0])

        @piece
        def last_part(r, size, s, q):
            return first.part(size, s, q[0])

        return Rates(last_total, last_known, last_part)
    others = bind_rates(processes[1:])

    @piece
    def total(r, size, s, q):
        if r == 0:
            return first.total(size, s, q[0])
        return others.total(r - 1, size, s, q[1:])

    @piece
    def known(size, q):
        return first.known(size, q[0]) and others.known(size, q[1:])

    @piece
    def part(r, size, s, q):
        if r == 0:
            return first.part(size, s, q[0])
        return others.part(r - 1, size, s, q[1:])

    return Rates(total, known, part)


def bind_outcomes(processes: Sequence[Unary]) -> Any:
    """Bind ``outcome(r, size, part, s)``, and whether mass leaves by it."""
    if not processes:

        @piece
        def none(r, size, part, s):
            return 0, False

        return none
    first, removes = piece(processes[0].outcome), processes[0].removes
    if len(processes) == 1:

        @piece
        def last(r, size, part, s):
            return first(size, part, s.sizes, s.counts), removes

        return last
    others = bind_outcomes(processes[1:])

    @piece
    def outcome(r, size, part, s):
        if r == 0:
            return first(size, part, s.sizes, s.counts), removes
        return others(r - 1, size, part, s)

    return outcome


class Ledger(NamedTuple):
    """The counts of the particles in slots.

    Attributes
    ----------
    enter, leave : ``enter(s, size, count, q)``, ``leave(s, size)``
    ready : ``ready(s, w, p, q)``
        Count all if they are not counted: 0, or `SPLITS`.
    """

    enter: Any
    leave: Any
    ready: Any


def make_ledger(rates: Rates, visit: Callable[[Any], Any], count: int) -> Ledger:
    """Bind the counting; without any process, what is never called.

    Parameters
    ----------
    rates : Rates
    visit : callable
        ``visit(tally)`` binds the visit of a method, see `smolux.core.loop.Pieces`, to a tally.
    count : int
        How many processes of single particles there are.
    """
    if count == 0:
        return Ledger(None, None, None)
    total, known = rates.total, rates.known

    @piece
    def add_up(s, c):
        """Sum afresh what changed: nothing drifts."""
        o = c >> UNARY_BITS
        for r in range(count):
            own = 0.0
            for k in range(o << UNARY_BITS, (o + 1) << UNARY_BITS):
                own += s.held[k] * s.most[r, k] if k != COUNTED else 0.0
            s.sums[r, o] = own

    @cold_piece
    def enter(s, size, number, q):
        c = slot_of(size, np.int64(UNARY_BITS))
        for r in range(count):
            value = total(r, size, s, q)
            if 0.0 <= value < math.inf:
                s.most[r, c] = max(value, s.most[r, c])
            else:  # found when the next event is drawn
                s.most[r, c] = math.nan
                s.count[WORST_I], s.count[WORST_J], s.count[CULPRIT] = size, 0, r + 1
                s.clock[VALUE] = value
        s.held[c] += number
        add_up(s, c)

    @cold_piece
    def leave(s, size):
        c = slot_of(size, np.int64(UNARY_BITS))
        s.held[c] -= 1
        if s.held[c] == 0:
            for r in range(count):
                s.most[r, c] = 0.0
        add_up(s, c)

    @cold_piece
    def enter_if_known(s, q, size, number, p):
        """As a tally, which takes what it adds to and what it needs for that first."""
        if known(size, q):
            enter(s, size, number, q)
        else:
            s.count[WANTED] = size

    count_all = visit(enter_if_known)

    @cold_piece
    def ready(s, w, p, q):
        if s.held[COUNTED] == 1:
            return 0
        s.held[:] = 0
        s.most[:, :] = 0.0
        s.sums[:, :] = 0.0
        s.count[WANTED] = s.count[VAIN] = 0
        count_all(s, w, s, q, p)
        if s.count[WANTED] > 0:
            return SPLITS
        s.held[COUNTED] = 1
        return 0

    return Ledger(enter, leave, ready)


def make_unary(pick: Callable[..., Any], rates: Rates, pairs: int, count: int) -> Any:
    """Bind the drawing of the next event of a single particle.

    ``draw(s, w, windows, q, limit)`` returns the waiting time; infinite if it would not be below
    the `limit`, at which something else takes place, and NaN if there is no rate. No particle is
    looked for before it is known that nothing else comes first.
    """
    total, part = rates.total, rates.part

    @piece
    def factor_bound(s, windows, r):
        k = pairs + r
        return windows.bounds[s.count[WINDOW], k] + s.clock[CLOCKS + k]

    @piece
    def find_slot(s, windows, octaves, x):
        """Process and slot where the cumulative sum passes `x`; the last if rounding has none."""
        process, octave, inside = np.int64(0), np.int64(0), False
        for r in range(count):
            factor = factor_bound(s, windows, r)
            for o in range(octaves):
                own = factor * s.sums[r, o]
                if own <= 0.0:
                    continue
                process, octave, inside = np.int64(r), np.int64(o), x < own
                if inside:
                    break
                x -= own
            if inside:
                break
        factor, slot = factor_bound(s, windows, process), np.int64(0)
        for c in range(octave << UNARY_BITS, (octave + 1) << UNARY_BITS):
            value = factor * s.held[c] * s.most[process, c]
            if c > 0 and value > 0.0:
                slot = np.int64(c)
                if inside and x < value:
                    break
                x -= value
        return process, slot

    @piece
    def accepted(s, value, most):
        return value >= most or rng.uniform(s.rng) * most < value

    @piece
    def candidate(s, w, r, c, q):
        """Draw a particle by a slot: whether process `r` takes place, 1 or 0; -1 for no rate."""
        before = s.count[TRIALS]
        s.count[TRIALS] += 1
        one, size = pick(s, w, r, c)
        s.count[UNARY], s.count[UNARY_SIZE], s.count[UNARY_PROCESS] = one, size, r
        s.count[UNARY_PART] = 0
        if accepted(s, total(r, size, s, q), s.most[r, slot_of(size, np.int64(UNARY_BITS))]):
            s.count[UNARY_PART] = part(r, size, s, q)
        s.attempts[pairs + r] += s.count[TRIALS] - before
        return min(s.count[UNARY_PART], np.int64(1))

    @piece
    def draw_unary(s, w, windows, q, limit):
        if s.count[PARTICLES] == 0:
            return math.inf
        octaves = (slot_of(s.count[LARGEST], np.int64(UNARY_BITS)) >> UNARY_BITS) + 1
        rate = 0.0
        for r in range(count):
            own = 0.0
            for o in range(octaves):
                own += s.sums[r, o]
            rate += factor_bound(s, windows, r) * own
        if not rate < math.inf:
            return math.nan
        if rate <= 0.0:
            return math.inf
        wait = 0.0
        for _ in range(PATIENCE):
            wait += rng.exponential(s.rng) / rate
            if wait >= limit:
                return math.inf
            r, c = find_slot(s, windows, octaves, rng.uniform(s.rng) * rate)
            taken = candidate(s, w, r, c, q)
            if taken < 0:
                s.count[CULPRIT] = r + 1
                return math.nan
            if taken > 0:
                return wait
            s.count[VAIN] += 1
            if s.count[VAIN] > _ENOUGH * s.count[PARTICLES] + PATIENCE:
                s.held[COUNTED] = 0  # what had the largest rates may be gone
                break
        s.count[UNARY] = -1
        return wait

    return draw_unary
