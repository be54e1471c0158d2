"""Columns of arrays with names, and how those of sub-volumes make that of the whole."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Rule(Enum):
    """How a value of the whole comes of those of its sub-volumes."""

    #: each sub-volume has its own, which ends with it
    APART = "apart"
    #: the whole has its own, and brings it up to date itself
    WHOLE = "whole"
    #: that of any: all have the same
    FIRST = "first"
    #: the sum
    SUM = "sum"
    #: the sum, added to what there was: sub-volumes begin at zero
    ADDED = "added"
    #: the largest: sub-volumes begin with that of the whole
    MAXIMUM = "maximum"


def merged(rule: Rule, before: Any, parts: Sequence[Any]) -> Any:
    """Return the value of the whole, from that before and those of its sub-volumes.

    Parameters
    ----------
    rule : Rule
    before : number or ndarray
    parts : sequence of number or ndarray
    """
    match rule:
        case Rule.FIRST:
            return parts[0]
        case Rule.SUM:
            return sum(parts)
        case Rule.ADDED:
            return sum(parts, start=before)
        case Rule.MAXIMUM:
            return np.maximum.reduce([before, *parts])
    return before


class Columns:
    """The columns of an array of the state, each declared by a call that returns its number.

    The last one may be `each` of the processes.
    """

    def __init__(self) -> None:
        self.names: list[str] = []
        self.rules: list[Rule] = []
        #: columns that grow as the volume does
        self.extensive: list[int] = []
        self._each = False

    def __call__(
        self, name: str, rule: Rule, *, extensive: bool = False, each: bool = False
    ) -> int:
        """Declare the next column."""
        if self._each or name in self.names:
            raise ValueError(f"column {name!r}: comes twice, or after one for each process")
        self.names.append(name)
        self.rules.append(rule)
        self._each = each
        if extensive:
            self.extensive.append(len(self) - 1)
        return len(self) - 1

    def __len__(self) -> int:
        return len(self.names)

    def under(self, rule: Rule, width: int) -> NDArray[np.int64]:
        """Return the columns under a rule, of an array of so many."""
        rules = self.rules + self.rules[-1:] * (width - len(self))
        return np.flatnonzero([each is rule for each in rules])

    def merge(self, whole: NDArray[Any], parts: Sequence[NDArray[Any]]) -> None:
        """Bring the columns of the whole up to date with those of its sub-volumes."""
        for rule in Rule:
            at = self.under(rule, len(whole))
            whole[at] = merged(rule, whole[at], [part[at] for part in parts])
