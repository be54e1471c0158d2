"""What is looked at after each event: all that follows from the state a run has come to.

The one place for it, whatever the event was and the method is: that a replica ends as one cluster,
what the population policy does, and whatever else is to stop a run or change its volume.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

from smolux.jit.compile import piece

from .state import COUNTED, DOUBLE_AT, DOUBLINGS, EXTENSIVE, EXTINCT, GROW, PARTICLES, TIME


@lru_cache(maxsize=64)
def make_after_event(double: Callable[..., Any]) -> Callable[..., Any]:
    """Bind ``after_event(s, w)``: 0, or the reason to return.

    It is called with the event complete and before the next one is drawn; also when a run begins or
    goes on, and at the edge of a window of time. So it says what holds now, and twice is as once.
    Between plain events in a row nothing can be said here, see `smolux.core.burst`: they end before
    so few particles are left.

    Parameters
    ----------
    double : callable
        Of the method, see `smolux.core.loop.Pieces`.
    """

    @piece
    def after_event(s, w):
        while 0 < s.count[PARTICLES] <= s.count[DOUBLE_AT]:
            if not double(s, w):
                return GROW
            for column in EXTENSIVE:
                s.clock[column] *= 2.0
            s.count[DOUBLINGS] += 1
            if s.held.shape[0] > 0:
                s.held[COUNTED] = 0
        if s.count[PARTICLES] > 1:
            s.clock[EXTINCT] = math.nan
        elif math.isnan(s.clock[EXTINCT]):
            s.clock[EXTINCT] = s.clock[TIME]
        return 0

    return after_event
