"""Replaying a run from its log: any instant, every merge, the series."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smolux.spatial.system import System

from .trace import Log, Series, empty_series, observe

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass
class Merging:
    """What each of M merges was.

    Attributes
    ----------
    parents : ndarray of int, shape (M, 2)
        Nodes of the merger tree: 0 .. N - 1 are the discs, N + m is what merge m made.
    sizes, masses : ndarray of shape (M, 2)
        Discs and mass of the two clusters.
    point : ndarray of shape (M, d)
        Where they touched.
    speed, impact : ndarray of shape (M,)
        Relative speed; distance of the line of relative motion of one of the two discs in contact
        from the centre of the other.
    loss : ndarray of shape (M,)
        Kinetic energy lost.
    gap : ndarray of shape (M,)
        Distance of the surfaces at the recorded time: zero but for rounding.
    """

    parents: Int
    sizes: Int
    masses: Float
    point: Float
    speed: Float
    impact: Float
    loss: Float
    gap: Float


class Replay:
    """Goes through a log from its start."""

    def __init__(self, system: System, log: Log) -> None:
        from smolux.spatial.events import replay

        n, d = system.position.shape
        self.system, self.log, self._compiled = system, log, replay
        self.event, self.nodes = 0, n
        self.forest = replay.Forest(
            np.arange(n, dtype=np.int32),
            np.zeros((n, d)),
            system.velocity.copy(),
            np.zeros(n),
            system.mass.copy(),
            np.ones(n, np.int32),
            np.arange(n, dtype=np.int32),
            np.zeros((n if log.more.any() else 0, d, 3)),
        )
        count = int(log.merges.sum())
        self.merging = Merging(
            np.empty((count, 2), np.int32),
            np.empty((count, 2), np.int32),
            np.empty((count, 2)),
            np.empty((count, d)),
            *(np.empty(count) for _ in range(4)),
        )
        self._work = np.empty((4, d))

    def to(self, until: float) -> None:
        """Go on through all events up to a time, that time included."""
        stop = int(np.searchsorted(self.log.time, until, side="right"))
        merges = self._compiled.Merges(*vars(self.merging).values())
        system, log = self.system, self.log
        self.nodes = self._compiled.replay(
            self.forest, merges, system.position, system.radius, system.box.periods, log.time,
            log.first, log.second, log.more, log.until, self.event, stop, self.nodes, self._work,
        )  # fmt: skip
        self.event = stop

    def clusters(self) -> tuple[Int, Float, Float]:
        """Return discs, mass and velocity of every cluster."""
        forest = self.forest
        roots = np.flatnonzero(forest.above == np.arange(len(forest.above)))
        return forest.size[roots], forest.mass[roots], forest.velocity[roots]

    def positions(self, time: float) -> tuple[Float, Float, NDArray[np.int32]]:
        """Return position, velocity and cluster of every disc at a time, to which it has gone."""
        n, d = self.system.position.shape
        x, v = np.empty((n, d)), np.empty((n, d))
        label, least = np.empty(n, np.int32), np.empty(n, np.int32)
        self._compiled.positions(
            self.forest, self.system.position, time, x, v, label, least, self._work
        )
        return x, v, label


def history(system: System, log: Log, times: Float, reached: float) -> tuple[Merging, Series]:
    """Describe every merge, and observe at the output times up to that which was reached."""
    replay = Replay(system, log)
    series = empty_series(times, len(system), system.dimension)
    for k, time in enumerate(times):
        if time > reached:
            break
        replay.to(float(time))
        observe(series, k, *replay.clusters())
    replay.to(np.inf)
    return replay.merging, series


def replayed(system: System, log: Log, time: float) -> dict[str, Any]:
    """Return position, velocity and cluster of all discs at a time."""
    replay = Replay(system, log)
    replay.to(time)
    x, v, label = replay.positions(time)
    return {"position": x, "velocity": v, "cluster": label}
