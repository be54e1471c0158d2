"""Collecting events in pieces, and saying why a loop returned."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .trace import Log

AT_REST = "nothing moves relative to anything else: no two clusters will ever meet"
LONELY = (
    "no two clusters met for so long that they may never meet; for a longer wait raise the "
    "patience of the method"
)


def reasons(module: Any) -> dict[int, str]:
    """Why a run cannot go on, by what its compiled loop returned."""
    return {module.AT_REST: AT_REST, module.LONELY: LONELY}


class Logger:
    """Events of a run, from a loop that has room for a few at a time."""

    def __init__(self, room: int) -> None:
        self.room: tuple[NDArray[Any], ...] = (
            np.empty(room),
            np.empty(room, np.int32),
            np.empty(room, np.int32),
        )
        self._parts: list[tuple[NDArray[Any], ...]] = []
        self.events = 0

    def take(self, log: Log) -> None:
        """Put the log of an earlier run before all others."""
        self._parts.append((log.time, log.first, log.second))
        self.events += len(log.time)

    def keep(self, count: int) -> None:
        """Take the first events out of the room."""
        if count:
            self._parts.append(tuple(array[:count].copy() for array in self.room))
            self.events += count

    def log(self) -> Log:
        """Return all events so far; those at one time in the order in which they happened."""
        if not self._parts:
            return Log(np.empty(0), np.empty(0, np.int32), np.empty(0, np.int32))
        if len(self._parts) > 1:
            self._parts = [tuple(np.concatenate(c) for c in zip(*self._parts, strict=True))]
        return Log(*self._parts[0])
