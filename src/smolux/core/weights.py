"""Simulated particles that stand for more or less than one: rate, outcome and counting, compiled.

A simulated particle of size l stands for ``1 / w(l)`` particles. An event of the sizes i and j
takes place ``W / (w(i) w(j))`` times as often as by the kernel. Then i is taken out with
probability ``w(i) / W``, j with ``w(j) / W``, and of the size k that appears c times there are
``c w(k) / W`` on average. All is rounded by one uniform number each, so that sums that are whole
stay whole: in mass flow exactly one particle goes and one comes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from smolux.jit.compile import cold_piece, piece, user_piece

from . import rng
from .record import find_bin, power

#: sums closer to a whole number than this are that number
_WHOLE = 1e-9


def make_rate(
    rate: Callable[..., Any],
    weight: Callable[..., Any],
    rate_ratio: Callable[..., Any] | None,
    own: int,
) -> Callable[..., Any]:
    """Bind the simulated rate.

    Parameters
    ----------
    rate : callable
        The compiled rate of the kernel, which takes the first `own` parameters.
    weight : callable
        ``weight(size, *q)``, plain, with the other parameters.
    rate_ratio : callable, optional
        ``rate_ratio(i, j, *q)``, plain: a short form of what the rate is multiplied by.
    own : int
    """
    inner = user_piece(weight if rate_ratio is None else rate_ratio)

    @piece
    def short(i, j, *p):
        return rate(i, j, *p[:own]) * float(inner(i, j, *p[own:]))

    @piece
    def general(i, j, *p):
        one, two = float(inner(i, *p[own:])), float(inner(j, *p[own:]))
        top = max(one, two, float(inner(i + j, *p[own:])))
        return rate(i, j, *p[:own]) * (top / (one * two))

    return general if rate_ratio is None else short


def make_weight(weight: Callable[..., Any], own: int) -> Callable[..., Any]:
    """Bind ``w(size, p)`` of a whole size and all parameters."""
    inner = user_piece(weight)

    @piece
    def value(size, p):
        return float(inner(float(size), *p[own:]))

    return value


@piece
def nearly_whole(x):
    """Replace a number by the whole one that it is but for rounding."""
    near = math.floor(x + 0.5)
    return near if abs(x - near) < _WHOLE else x


def make_rounding(weight: Callable[..., Any]) -> Callable[..., Any]:
    """Bind the rounding of what appears: ``rounded(s, entries, top, p)``, how many are left."""

    @cold_piece
    def drawn(s, entries, top, p):
        u = rng.uniform(s.rng)
        total, before, kept = 0.0, np.int64(0), 0
        for e in range(entries):
            total += s.counts[e] * (weight(s.sizes[e], p) / top)
            upto = np.int64(math.floor(nearly_whole(total) + u))
            if upto > before:
                s.sizes[kept], s.counts[kept] = s.sizes[e], upto - before
                kept += 1
            before = upto
        return kept

    @piece
    def rounded(s, entries, top, p):
        if entries == 1:  # the common case, in which there may be nothing to round
            x = s.counts[0] * (weight(s.sizes[0], p) / top)
            if x == math.floor(x):
                s.counts[0] = np.int64(x)
                return 1 if x > 0.0 else 0
        return drawn(s, entries, top, p)

    return rounded


def make_outcome(outcome: Callable[..., Any], weight: Callable[..., Any]) -> Callable[..., Any]:
    """Bind what becomes of a pair: the number of entries, and which of both goes (bits 1 and 2)."""
    rounded = make_rounding(weight)

    @piece
    def weighted(r, i, j, s, p, q):
        entries, _ = outcome(r, i, j, s, p, q)
        one, two, both = weight(i, p), weight(j, p), weight(i + j, p)
        top = max(one, two, both)
        joined = entries == 1 and s.counts[0] == 1 and s.sizes[0] == i + j
        if not joined or both < top:  # else there is nothing to round
            entries = rounded(s, entries, top, p)
        stays = 1.0 - one / top
        stay = nearly_whole(stays + (1.0 - two / top))
        u = rng.uniform(s.rng)
        first = int(u < stays)
        second = int(u < stay) + int(u + 1.0 < stay) - first
        return entries, 3 - first - 2 * second

    return weighted


def make_stands(weight: Callable[..., Any] | None) -> Callable[..., Any]:
    """Bind ``stands(size, p)``: how many particles a simulated one stands for."""
    if weight is None:

        @piece
        def one(size, p):
            return 1.0

        return one

    @piece
    def stands(size, p):
        return 1.0 / weight(size, p)

    return stands


def make_replacement(weight: Callable[..., Any] | None) -> Callable[..., Any]:
    """Bind the rounding of what appears in place of one particle, ``(s, entries, size, p)``."""
    if weight is None:

        @piece
        def as_it_is(s, entries, size, p):
            return entries

        return as_it_is
    rounded = make_rounding(weight)

    @piece
    def replaced(s, entries, size, p):
        if entries == 0:
            return np.int64(0)
        return np.int64(rounded(s, entries, weight(size, p), p))

    return replaced


def make_tally(weight: Callable[..., Any]) -> Callable[..., Any]:
    """Bind the counting of particles that stand for ``1 / w``; see `tally_one` of the record."""

    @cold_piece
    def tally(t, grid, size, count, p):
        if size < t.counts.shape[0]:
            t.counts[size] += count
            return
        stood = count / weight(size, p)
        t.bins[find_bin(grid, size)] += stood
        x = float(size)
        for o in range(grid.orders.shape[0]):
            t.sums[o] += stood * power(x, grid.orders[o])

    return tally
