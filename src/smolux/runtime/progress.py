"""How far a computation is, as it is told to whoever asks for it: one shape, whatever it is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, eq=False)
class Progress(float):
    """How far a computation is: a number, the share that is done, that has all else beside it.

    Whatever takes a function `progress` calls it with one of these a few times a second, so that
    one function, or one bar, serves all.

    Attributes
    ----------
    fraction : float
        Share that is done, 0 to 1; NaN if it is not known. With a target error, of all replicas
        that it will take as far as is known, so that it may fall.
    what : str
        What is done, in a word: ``"simulating"``, ``"solving"``, ``"sweeping"``.
    events : int
        What has happened so far: collisions of all replicas, merges and reflections, or steps.
    unit : str
        What these are called: ``"events"``, ``"steps"``, ``"replicas"``.
    events_per_second : float
    seconds_left : float
        Estimated from what is done so far; NaN when nothing is known yet.
    compile_seconds : float
        Spent on compiling, not counted in the rate.
    bounds_seconds : float
        Processor time spent on bounds and tables of rates, over all threads.
    note : str
        Whatever else there is to say, in words, such as how many points of a sweep are done.
    counts : mapping of str to number
        What is known of this computation alone. Each is an attribute, too: ``progress.clusters``.

        - `simulate`: ``replicas`` begun so far; ``error`` and ``target_error``, half width of the
          95 % interval of the target over its mean, when last looked at, and what is wanted; NaN if
          not known.
        - `solve`: ``time`` reached, and ``window``, the number of sizes now.
        - `steady_state`: ``iteration``, ``residual``, ``window`` and ``seconds`` since the start.
        - `sweep`: ``points``, of which ``done`` are finished, ``failed`` ones included.
        - `spatial.simulate`: ``clusters`` left, and the ``time`` simulated.
        - `ensemble`, `efficiency`: ``replicas`` that are done.
    """

    fraction: float
    what: str
    events: int = 0
    unit: str = "events"
    events_per_second: float = 0.0
    seconds_left: float = math.nan
    compile_seconds: float = 0.0
    bounds_seconds: float = 0.0
    note: str = ""
    counts: Mapping[str, Any] = field(default_factory=dict)

    def __new__(cls, fraction: float, *_: Any, **__: Any) -> Progress:
        """Make the number."""
        return super().__new__(cls, fraction)

    def __getattr__(self, name: str) -> Any:
        """Return one of the counts."""
        counts = self.__dict__.get("counts", {})
        if name in counts:
            return counts[name]
        raise AttributeError(f"a Progress of {self.__dict__.get('what', 'nothing')} has no {name}")
