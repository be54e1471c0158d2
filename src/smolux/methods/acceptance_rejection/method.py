"""Acceptance-rejection: pairs of equal chance, thinned by the rate over its bound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from smolux.core.loop import Pieces
from smolux.core.state import (
    FLOOR,
    LARGEST,
    MAJORANT,
    MONOMERS,
    PARTICLES,
    SMALLEST,
    STORED,
    TIME,
    VALUE,
    WORST_I,
    WORST_J,
    State,
)
from smolux.errors import InputError
from smolux.methods.base import Float, Int, Method, Rates, enlarged, spread

from .levels import level_edges, level_of
from .pieces import AHEAD, bind
from .store import APART, HIGH, LOW, Work

#: rates of sizes up to this are tabulated when computing one costs more than reading it
_TABLE = 192


@dataclass(frozen=True)
class AcceptanceRejection(Method):
    """Draw pairs with equal chance; accept with probability ``K(i, j) / K_max``.

    ``K_max`` bounds the kernel over the pairs of sizes present. The cost of an event is the
    inverse of the mean acceptance; the monomers of a shattering event are only counted.

    References
    ----------
    A. L. Garcia et al., Physica A 143, 535 (1987), doi:10.1016/0378-4371(87)90205-5;
    Kalinov et al., Algorithms 1 and 3.
    """

    name: ClassVar[str] = "acceptance-rejection"
    title: ClassVar[str] = "acceptance-rejection"
    reference: ClassVar[str] = "A. L. Garcia et al., Physica A 143, 535 (1987)"

    work_type: ClassVar[type] = Work

    @staticmethod
    def bind(rate: Any, tally: Any) -> Pieces:
        return bind(rate, tally)

    def new_work(
        self, rates: Rates, populations: list[tuple[Int, Int]], state: State, mass: int
    ) -> Work:
        total = np.array([counts.sum() for _, counts in populations])
        monomers = np.array([c[0] if s[0] == 1 else 0 for s, c in populations])
        stored = total - monomers
        # enough without growth: half of the monomers merge in pairs
        capacity = int(np.maximum(stored, total // 2).max())
        array = np.zeros((len(populations), capacity + 8), np.int64)
        for r in np.flatnonzero(stored):
            sizes, counts = populations[r]
            first = int(sizes[0] == 1)
            spread(sizes[first:], counts[first:], array[r, : stored[r]])
        count = state.count
        count[:, MONOMERS], count[:, STORED], count[:, PARTICLES] = monomers, stored, total
        count[:, SMALLEST] = [sizes[0] for sizes, _ in populations]
        count[:, LARGEST] = [sizes[-1] for sizes, _ in populations]
        ahead = np.full((len(populations), 2 * AHEAD), -1.0)
        edges = level_edges()
        levels = len(edges) - 1
        level = np.tile(np.array([levels - 1, 0, levels - 1, 0]), (len(populations), 1))
        apart = np.zeros((len(populations), 5), np.int64)
        table = rates.table(0 if rates.cheap else _TABLE)
        return Work(array, ahead, level, apart, edges, np.full((levels, levels), np.nan), table)

    def grow(self, work: Work, state: State) -> Work:
        return work._replace(sizes=enlarged(work.sizes, 2 * work.sizes.shape[1]))

    def supply_bound(self, work: Work, rates: Rates, state: State, replica: int) -> None:
        """See `Method.supply_bound`; bounds for two octaves are computed together.

        They come in fixed blocks: a bound must not depend on which replica asked first.
        """
        count = state.count[replica]
        low, high = (int(level_of.py_func(work.edges, count[k])) for k in (SMALLEST, LARGEST))
        if work.apart[replica, APART]:
            found = _bound_apart(work, rates, replica, low, high)
            state.clock[replica, MAJORANT] = max(found, state.clock[replica, FLOOR])
        elif np.isnan(work.majorant[low, high]):  # else another replica has asked for it
            block = high - high % 16
            highs = np.arange(max(low, block), min(block + 16, work.majorant.shape[1]))
            work.majorant[low, highs] = _bounds(work, rates, (low, highs), (low, highs))
            found = work.majorant[low, high]
        else:
            return
        smallest, largest = float(count[SMALLEST]), float(count[LARGEST])
        if np.isnan(found):
            raise InputError(
                f"the kernel has no finite bound for the sizes {smallest:.0f} to {largest:.0f}, "
                f"which were reached at t = {state.clock[replica, TIME]:.6g}; limit what grows, as "
                "in exp(min(x, 500)), or end earlier"
            )
        if found == 0.0:  # no candidate would ever find a rate below zero
            value = float(rates.arrays(smallest, largest))
            if not 0.0 <= value < np.inf:
                state.clock[replica, VALUE] = value
                count[WORST_I], count[WORST_J] = smallest, largest

    def held(self, work: Work, state: State, replica: int) -> tuple[Int, Int]:
        count = state.count[replica]
        return np.array([0, count[MONOMERS]]), work.sizes[replica, : count[STORED]]

    def bytes_per_replica(self, particles: int) -> int:
        return 8 * particles

    def carrying(self) -> Method:
        from .carrying import Carrying

        return Carrying()


def _bounds(work: Work, rates: Rates, one: Sequence[Any], other: Sequence[Any]) -> Float:
    """Bound the rates of sizes in some levels with those in others; NaN where there is no bound."""
    a, c = (work.edges[np.asarray(side[0])].astype(float) for side in (one, other))
    b, d = ((work.edges[np.asarray(side[1]) + 1] - 1).astype(float) for side in (one, other))
    a, b, c, d = np.broadcast_arrays(a, b, c, d)
    bound = rates.bounds(a, b, c, d)[1]
    if not rates.rigorous:
        # zeros alone prove nothing: candidates go on coming, at the rate of all sizes so far
        ones = np.ones(d.shape)
        bound = np.where(bound > 0.0, bound, rates.bounds(ones, d, ones, d)[1])
    return np.where(bound == np.inf, np.nan, np.maximum(bound, 0.0))


def _bound_apart(work: Work, rates: Rates, replica: int, low: int, high: int) -> float:
    """Bound the rates of all pairs but one particle with itself, and write for which levels.

    The one is the largest or the smallest, whichever gives the lower bound.
    """
    level = work.level[replica]
    lows, highs = [level[2]], [level[3]]
    if level[2] < 0:
        lows, highs = [low, work.apart[replica, LOW]], [work.apart[replica, HIGH], high]
    bounds = _bounds(work, rates, (lows, highs), (low, high))
    k = 0 if np.isnan(bounds).all() else int(np.nanargmin(bounds))
    level[:] = low, high, lows[k], highs[k]
    return float(bounds[k])
