"""What an output time records of one replica."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

from smolux.jit.compile import cold_piece, piece

from .slots import octave
from .state import AT, HIGHEST, PER_PROCESS, SCALARS

#: in `PER_PROCESS`
_ATTEMPTS = PER_PROCESS.index("attempts")


@piece
def find_bin(grid, size):
    """Bin of a size: the last edge at or below it."""
    k = grid.first[octave(size)]
    while k + 1 < grid.edges.shape[0] and grid.edges[k + 1] <= size:
        k += 1
    return k


@piece
def power(x, order):
    """Power of a size; the usual whole ones need no call of a function."""
    if order == 0.0:
        return 1.0
    if order == 1.0:
        return x
    if order == 2.0:
        return x * x
    return x**order


@cold_piece
def tally_one(t, grid, size, count, p):
    """Add `count` particles of one size to an observation."""
    if size < t.counts.shape[0]:
        t.counts[size] += count
        return
    t.bins[find_bin(grid, size)] += count
    x = float(size)
    for o in range(grid.orders.shape[0]):
        t.sums[o] += count * power(x, grid.orders[o])


@lru_cache(maxsize=64)
def make_record(visit: Callable[..., Any]) -> Callable[..., Any]:
    """Bind the recording of an observation."""

    @cold_piece
    def record(s, w, t, grid, time, p):
        t.scalars[AT] = time
        t.scalars[HIGHEST] = visit(s, w, t, grid, p)
        k = SCALARS
        for column in grid.counted:
            t.scalars[k] = s.count[column]
            k += 1
        for column in grid.clocked:
            t.scalars[k] = s.clock[column]
            k += 1
        for m in range(grid.processes.shape[0]):
            attempts = grid.processes[m] == _ATTEMPTS
            for r in range(s.events.shape[0]):
                t.processes[m, r] = s.attempts[r] if attempts else s.events[r]

    return record
