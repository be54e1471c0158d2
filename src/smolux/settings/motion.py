"""How far discs are moved, and what is observed on the way."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from .arguments import Arguments
from .kinds import Called, Number, Seconds, Times, Whole, setting


@dataclass(frozen=True)
class SpatialSettings(Arguments):
    """The arguments of `smolux.spatial.simulate` beside system and method, as it describes them."""

    until: float | None = setting(
        Number(lambda t: 0 < t < math.inf, "a positive number, or left out", optional=True), None
    )
    clusters: int = setting(Whole(1), 1)
    times: tuple[float, ...] | None = setting(Times(optional=True, start=True), None)
    max_events: int | None = setting(Whole(1, optional=True), None)
    time_limit: float | None = setting(Seconds(optional=True), None)
    progress: Callable[[Any], None] | None = setting(Called("a function of a Progress"), None)

    def limits(self) -> tuple[float, float, float]:
        """Return the last time, the number of events and the seconds; infinite if left out."""
        given = (self.until, self.max_events, self.time_limit)
        until, events, seconds = (math.inf if x is None else float(x) for x in given)
        return until, events, seconds
