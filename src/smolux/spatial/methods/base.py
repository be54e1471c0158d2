"""What every spatial method has."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from smolux.spatial.results.trace import Trace
from smolux.spatial.system import System

Float = NDArray[np.float64]

#: of what the memory is looked at before it grows
LISTS = "lists of discs that may meet"


class Run:
    """One simulation on its way; `advance` is called until it says why it is over.

    Attributes
    ----------
    time : float
        Reached so far.
    clusters : int
        Present at that time.
    events : int
        Merges and reflections so far; time steps, for methods that take steps.
    """

    time: float
    clusters: int
    events: int

    def advance(self, until: float, clusters: int, budget: int) -> str | None:
        """Go on for about a tenth of a second.

        Parameters
        ----------
        until : float
            Time at which to stop; may be infinite.
        clusters : int
            Stop when so few are left.
        budget : int
            Events after which to return at the latest.

        Returns
        -------
        str or None
            None to be called again; "" when `until` or `clusters` is reached; else why the run
            cannot go on, in words.
        """
        raise NotImplementedError

    def trace(self) -> Trace:
        """Return what there is so far."""
        raise NotImplementedError


class SpatialMethod:
    """A way to move the discs: a frozen dataclass of its settings.

    Attributes
    ----------
    name : str
        The name in `smolux.spatial.simulate`, in case files and in the registry `METHODS`.
    title, reference : str
    exact : bool
        Whether the log determines the motion, so that any instant can be replayed from it. If
        not, the run observes a `Series` at the output times itself.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    reference: ClassVar[str] = ""
    exact: ClassVar[bool] = True

    def start(self, system: System, times: Float) -> Run:
        """Return a run at time zero; `times` are the output times, for methods that observe."""
        raise NotImplementedError
