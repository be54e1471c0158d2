"""Rates in time: bounds of the factors of processes over windows, and what sources bring in."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from smolux.core.state import LIMIT, TimeWindows
from smolux.errors import InputError
from smolux.functions.time import TimeFunction
from smolux.functions.user_function import golden
from smolux.kernels.base import Kernel
from smolux.processes import Removal, Source
from smolux.processes.base import PairProcess, Process, factors_of
from smolux.weighting import Number
from smolux.weighting.base import Weighting

from .bounds_cache import timed

#: windows of time for bounds of a factor that varies: pieces of each octave, first octave
_PIECES = 4
_FIRST_OCTAVE = -20
#: share of the bounds beside it that a bound found by trial has at least
_NEIGHBOUR = 1 / 16


def _edges(end: float, factors: Sequence[TimeFunction]) -> tuple[float, ...]:
    """Edges of the windows up to the end and of one more: pieces of octaves, and breakpoints."""
    octaves = range(_FIRST_OCTAVE, int(np.ceil(np.log2(max(end, 2.0**_FIRST_OCTAVE)))) + 2)
    edges = np.array([0.0] + [2.0**k * (1 + m / _PIECES) for k in octaves for m in range(_PIECES)])
    last = int(np.searchsorted(edges, end))
    named = np.concatenate([factor.edges for factor in factors])
    inside = named[(named > 0.0) & (named < edges[last + 1])]
    found = np.unique(np.concatenate([edges[: last + 2], inside]))
    return tuple(found[: np.searchsorted(found, edges[last]) + 2].tolist())


@lru_cache(maxsize=32)
def _bounds(factor: TimeFunction, edges: tuple[float, ...]) -> tuple[float, ...]:
    """Bound a factor in all windows but the last one."""
    start, end = np.array(edges[:-2]), np.array(edges[1:-1])
    upper = factor.bounds(start, end)[1]
    if factor.stated is None and not factor.followed:
        # A bound of zero would never be repaired, as nothing would be tried: zeros prove nothing,
        # unless the factor is known to jump between.
        after = np.append(upper[1:], _glimpse(factor, edges[-2], edges[-1]))
        before = np.append(0.0, upper[:-1])
        after[np.isin(end, factor.breakpoints)] = 0.0
        before[np.isin(start, factor.breakpoints)] = 0.0
        upper = np.maximum(upper, _NEIGHBOUR * np.maximum(before, after))
    return tuple(upper.tolist())


def _glimpse(factor: TimeFunction, start: float, end: float) -> float:
    """Bound beyond the last window, which must not differ from that of a longer run; 0 if none."""
    try:
        bound = float(factor.bounds(start, end)[1])
    except Exception:  # what a function does there is not held against it
        return 0.0
    return bound if np.isfinite(bound) else 0.0


@timed
def time_windows_for(
    processes: Sequence[Process],
    end: float,
    weighting: Weighting | None = None,
    kernel: Kernel | None = None,
) -> TimeWindows:
    """Bound the rate factors over windows of time that depend on the factors alone.

    Terms of the kernel may have factors of their own, see `Kernel.in_time`. Pairs are drawn by
    their sum without these, so the bound of a process is that of the largest of them.

    A factor that does not vary needs one window without end. Others have four windows an octave of
    time, and more where one of them may jump, whatever the output times are, so that a trajectory
    does not depend on these.

    Raises
    ------
    InputError
        If a factor has no finite bound, or is negative, before the end.
    """
    factors = [factors_of(process, kernel) for process in processes]
    every = [f for each in factors for f in each]
    if all(f.constant is not None for f in every):
        edges = [0.0, np.inf]
        bounds = [[max(float(f(0.0)) for f in each) for each in factors]]
    else:
        windows = _edges(end, every)
        edges = [*windows[:-1], np.inf]
        columns = [[*np.max([_bounds(f, windows) for f in each], axis=0), 0.0] for each in factors]
        bounds = [list(row) for row in zip(*columns, strict=True)]
        _check_factors(processes, factors, edges, np.array(bounds), end)
    array = np.array(bounds, float)
    pairs = sum(isinstance(process, PairProcess) for process in processes)
    total = array[:, :pairs].sum(axis=1)
    return TimeWindows(np.array(edges), array, total, *_beside(processes, weighting or Number()))


#: times at which the inflow is looked at for its mean
_INFLOW_SAMPLES = 4096


def inflow(processes: Sequence[Process], weighting: Weighting, end: float) -> float:
    """Return the simulated particles that come in for a unit of volume and time.

    The mean from time zero to `end`: a source may be silent at the start.

    Raises
    ------
    InputError
        If nothing is seen to come in until then.
    """
    times = end * golden(_INFLOW_SAMPLES)  # in step with no period
    total = 0.0
    for source in (p for p in processes if isinstance(p, Source)):
        sizes, rates = source.table
        factor = source.factor
        mean = factor.constant if factor.constant is not None else float(np.mean(factor(times)))
        total += float(mean * rates @ weighting.weights(sizes))
    if not 0.0 < total < np.inf:
        raise InputError(
            f"source: the mean inflow from t = 0 to the last output time, {end:g}, is {total:g}, "
            "and a run that begins empty takes its volume from it; it must be finite and above "
            "zero: correct varying, or run to a later time"
        )
    return total


def _beside(processes: Sequence[Process], weighting: Weighting) -> tuple[Any, ...]:
    """Tables of sources, and what is cut off, see `smolux.core.state.TimeWindows`."""
    tables = [p.table for p in processes if isinstance(p, Source)]
    most = max((len(sizes) for sizes, _ in tables), default=0)
    size, share = np.ones((len(tables), most), np.int64), np.ones((len(tables), most))
    inflow = np.zeros(len(tables))
    for k, (sizes, rates) in enumerate(tables):
        simulated = rates * weighting.weights(sizes)
        inflow[k] = simulated.sum()
        size[k, : len(sizes)] = sizes
        share[k, : len(sizes)] = np.cumsum(simulated) / inflow[k]
        share[k, len(sizes) - 1 :] = 1.0
    cut = [(p.above or LIMIT, k) for k, p in enumerate(processes) if isinstance(p, Removal)]
    return inflow, size, share, np.array(min(cut, default=(LIMIT, 0)), np.int64)


def _check_factors(
    processes: Sequence[Process],
    factors: list[list[TimeFunction]],
    edges: list[float],
    bounds: Any,
    end: float,
) -> None:
    problems = []
    times = np.linspace(0.0, end, 1001)
    each = [(k, p, f) for k, p in enumerate(processes) for f in factors[k]]
    for k, process, factor in each:
        values = np.asarray(factor(times), float)
        wrong = ~(values >= 0)
        if wrong.any():
            t = float(times[wrong.argmax()])
            problems.append(
                f"the rate of {process.called}, {factor.text}, is {values[wrong][0]:.6g} "
                f"at t = {t:.6g}, before the end at {end:g}; it must not be negative: end earlier, "
                "or cut it off with max(0, ...)"
            )
        elif not np.isfinite(bounds[:, k]).all():
            t = edges[int(np.argmin(np.isfinite(bounds[:, k])))]
            problems.append(
                f"the rate of {process.called}, {factor.text}, has no finite bound near "
                f"t = {t:.6g}; it must stay finite up to the end"
            )
    if problems:
        raise InputError(problems)
