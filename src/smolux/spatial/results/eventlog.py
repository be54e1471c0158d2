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
    """Events of a run, from a loop that has room for a few at a time.

    Parameters
    ----------
    room : int
    axes : int
        Of the box, if many reflections in a row are to be counted; 0 if each is to be kept.
    """

    #: events after which it is seen whether some can be counted instead
    _MANY = 1 << 20

    def __init__(self, room: int, axes: int) -> None:
        self.room: tuple[NDArray[Any], ...] = (
            np.empty(room),
            np.empty(room, np.int32),
            np.empty(room, np.int32),
        )
        self._axes = axes
        self._old: list[Log] = []
        self._new: list[Log] = []
        self.events = self._fresh = 0

    def take(self, log: Log) -> None:
        """Put the log of an earlier run before all others."""
        self._old.append(log)
        self.events += len(log.time) + int(log.more.sum())

    def keep(self, count: int) -> None:
        """Take the first events out of the room."""
        if count:
            self._new.append(Log.of(*(array[:count].copy() for array in self.room)))
            self.events += count
            self._fresh += count
            if self._axes and self._fresh >= self._MANY:
                self._old.append(counted(_joined(self._new), self._axes))
                self._new, self._fresh = [], 0

    def log(self) -> Log:
        """Return all events so far; those at one time in the order in which they happened."""
        return _joined([*self._old, *self._new])


def _joined(logs: list[Log]) -> Log:
    if not logs:
        return Log.of(np.empty(0), np.empty(0, np.int32), np.empty(0, np.int32))
    columns = zip(*(vars(log).values() for log in logs), strict=True)
    return Log(*(np.concatenate(column) for column in columns))


#: reflections in a row that are worth counting
_ROW = 16
#: intervals of this many times the shortest one are no longer even, and rounding of times
_UNEVEN, _ROUNDING = 1.5, 1e-15


def counted(log: Log, axes: int) -> Log:
    """Count reflections of a cluster along an axis, with no merge of any in between.

    The first stays as an entry, and an even number of those after it are counted there: after these
    the cluster is again where it was, and moves as then.
    """
    place = np.flatnonzero((log.second < 0) & (log.second >= -axes))
    keys = np.stack([np.cumsum(log.merges)[place], log.first[place], log.second[place]])
    order = np.lexsort(keys)  # stable: those of one kind remain in the order of time
    place, keys = place[order], keys[:, order]
    time = log.time[place]
    same = (np.diff(keys, axis=1) == 0).all(axis=0)
    # what was reflected elsewhere meanwhile, under the name of another disc, has a longer interval
    row = np.cumsum(np.append(True, ~same))
    interval = np.where(same, np.diff(time), np.inf)
    shortest = np.full(row[-1] + 1 if len(row) else 1, np.inf)
    np.minimum.at(shortest, row[1:], interval)
    even = interval <= _UNEVEN * shortest[row[1:]] + _ROUNDING * time[1:]
    starts = np.flatnonzero(np.append(True, ~(same & even))) if len(place) else place
    length = np.diff(np.append(starts, len(place)))
    starts, length = starts[length > _ROW], length[length > _ROW]
    more = (length - 1) // 2 * 2
    log.more[place[starts]], log.until[place[starts]] = more, time[starts + more]
    kept = np.ones(len(log.time), bool)
    offset = np.arange(more.sum()) - np.repeat(np.cumsum(more) - more, more)
    kept[place[np.repeat(starts + 1, more) + offset]] = False
    return Log(*(column[kept] for column in vars(log).values()))
