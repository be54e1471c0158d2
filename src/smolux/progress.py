"""How far a run is, as it is told to whoever asks for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Progress:
    """How far a run is.

    Attributes
    ----------
    events : int
        Collisions so far, over all replicas.
    fraction : float
        Share of the simulated time that is done, 0 to 1; with a target error, of all replicas that
        it will take as far as is known, so that it may fall.
    events_per_second : float
    seconds_left : float
        Estimated from the simulated time done so far; NaN when nothing is known yet.
    compile_seconds : float
        Spent on compiling, not counted in the rate.
    bounds_seconds : float
        Processor time spent on bounds and tables of rates, over all threads.
    replicas : int
        Begun so far.
    error, target_error : float
        Half width of the 95 % interval of the target over its mean, when last looked at, and what
        is wanted; NaN if not known.
    """

    events: int
    fraction: float
    events_per_second: float
    seconds_left: float
    compile_seconds: float
    replicas: int = 0
    error: float = np.nan
    target_error: float = np.nan
    bounds_seconds: float = 0.0
