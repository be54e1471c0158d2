"""Going on from where a run stopped."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from smolux.errors import InputError
from smolux.results import told
from smolux.runtime.progress import Progress

from .methods.windowed import Windowed
from .results.result import system_of, trace_of
from .simulation import checked, driven


def resume(
    result: xr.DataTree,
    *,
    until: float | None = None,
    clusters: int = 1,
    times: ArrayLike | None = None,
    max_events: int | None = None,
    time_limit: float | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> xr.DataTree:
    """Let a run go on from where it stopped, by the windowed method.

    Parameters
    ----------
    result : xarray.DataTree
        Of `simulate` by any exact method, from its file or from `Interrupted`.
    until, clusters, times, max_events, time_limit, progress
        As for `simulate`. Times and events are those of the whole run.

    Returns
    -------
    xarray.DataTree
        Of the whole run, from its start.

    Raises
    ------
    InputError
        With every mistake in the arguments, or if the run was made by a method that is not exact.
    Interrupted
        On Ctrl-C, as `simulate`.

    Notes
    -----
    The merges are those of a run without a stop, to rounding: contacts are predicted anew.
    """
    given = dict(locals())
    before = trace_of(given.pop("result"))
    system = system_of(result)
    method = _method_of(result)
    _, settings = checked(system, method, given)
    if until is not None and until <= before.time:
        raise InputError(f"until = {until!r}: the run has reached {before.time:g} already")
    begun = partial(method.start, system, np.empty(0), before)
    tree = driven(system, method, begun, settings)
    tree.attrs["wall_seconds"] += float(result.attrs.get("wall_seconds", 0.0))
    return told(tree)


def _method_of(result: xr.DataTree) -> Windowed:
    """Return the windowed method, with the settings that a run by it had."""
    if result.attrs["method"] != Windowed.name:
        return Windowed()
    return Windowed(**json.loads(result.attrs["method_settings"]))
