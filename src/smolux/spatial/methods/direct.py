"""The two reference methods: all pairs at every event, or those in neighbouring cells."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from smolux.spatial.analysis.overlaps import cells_for
from smolux.spatial.results.eventlog import Logger, reasons
from smolux.spatial.results.trace import Trace
from smolux.spatial.system import System

from .base import Run, SpatialMethod

Float = NDArray[np.float64]
Int = NDArray[np.int64]

#: events for which a logger has room between two looks at the run
_ROOM = 4096


class DirectRun(Run):
    """A run of a reference method."""

    def __init__(
        self, system: System, loop: str, cells: NDArray[np.int64], patience: float
    ) -> None:
        from smolux.spatial.events import direct

        n, d = system.position.shape
        contact = system.wall_contact == "surface"
        self.system, self.patience = system, patience
        self._direct, self._loop = direct, getattr(direct, loop)
        fast = float(np.sqrt((system.velocity**2).sum(1).max()))
        self.discs = direct.Discs(
            tuple(range(d)),
            np.array([0.0, n, 0.0, 0.0, fast]),
            system.position.copy(),
            system.velocity.copy(),
            np.arange(n, dtype=np.int32),
            system.mass.copy(),
            np.ones(n, np.int32),
            system.radius,
            system.radius if contact else np.zeros(n),
            np.array(system.box.lengths),
            system.box.periods,
            cells,
            np.empty(int(np.prod(cells)), np.int32),
            np.empty(n, np.int32),
            np.empty((n, d)),
            np.empty(d),
            np.empty(d),
        )
        self.logger = Logger(_ROOM, d)

    @property
    def time(self) -> float:  # type: ignore[override]
        """See `Run`."""
        return float(self.discs.clock[0])

    @property
    def clusters(self) -> int:  # type: ignore[override]
        """See `Run`."""
        return int(self.discs.clock[1])

    @property
    def events(self) -> int:  # type: ignore[override]
        """See `Run`."""
        return self.logger.events

    def advance(self, until: float, clusters: int, budget: int) -> str | None:
        room = self._direct.Events(*self.logger.room)
        # an event takes time of the order of the number of pairs
        few = max(1, min(budget, 100_000_000 // len(self.system) ** 2))
        code, done = self._loop(self.discs, room, until, clusters, self.patience, few)
        self.logger.keep(done)
        return reasons(self._direct).get(code, None) if code != self._direct.DONE else ""

    def trace(self) -> Trace:
        _, least, which = np.unique(self.discs.label, return_index=True, return_inverse=True)
        return Trace(
            self.time, self.discs.x.copy(), self.discs.v.copy(),
            least[which].astype(np.int32), self.logger.log(),
        )  # fmt: skip


@dataclass(frozen=True)
class AllPairs(SpatialMethod):
    """All pairs at every event: ``O(N^2)`` each, ``O(N^3)`` in all. The reference.

    Parameters
    ----------
    patience : float
        The run ends when there was no merge while the fastest cluster would have crossed the box
        so many times.

    References
    ----------
    P. Degond, G. Dimarco, M. Ferreira, S. Hecht, appendix A.
    """

    patience: float = 1e4
    name: ClassVar[str] = "all-pairs"
    title: ClassVar[str] = "all pairs of discs at every event"
    reference: ClassVar[str] = "Degond, Dimarco, Ferreira, Hecht, appendix A"

    def start(self, system: System, times: Float) -> Run:
        cells = np.ones(system.dimension, np.int64)
        return DirectRun(system, "by_all_pairs", cells, self.patience)


@dataclass(frozen=True)
class Cells(SpatialMethod):
    """Pairs in neighbouring cells at every event: ``O(N)`` each.

    Discs are binned anew before one whose cell is no neighbour can have come near: after a gap of
    a cell less a diameter, at twice the largest speed. (The paper's bound, a cell at that speed,
    is not safe.)

    Parameters
    ----------
    patience : float
        As for `AllPairs`.
    side : float, optional
        Least side of the cells in diameters of the largest disc, above 1.

    References
    ----------
    P. Degond, G. Dimarco, M. Ferreira, S. Hecht, section A.6.
    """

    patience: float = 1e4
    side: float = 2.0
    name: ClassVar[str] = "cells"
    title: ClassVar[str] = "pairs of discs in neighbouring cells at every event"
    reference: ClassVar[str] = "Degond, Dimarco, Ferreira, Hecht, section A.6"

    def start(self, system: System, times: Float) -> Run:
        diameter = 2 * float(system.radius.max())
        cells = cells_for(system.box, self.side * diameter, len(system))
        return DirectRun(system, "by_cells", cells, self.patience)
