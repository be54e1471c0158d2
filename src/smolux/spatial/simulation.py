"""The spatial entry point: checks the arguments, drives the run in slices, makes the result."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.errors import Interrupted, OutOfMemoryError, did_you_mean
from smolux.runtime.progress import Progress
from smolux.runtime.room import needed
from smolux.runtime.stopping import AtOnce, Stopper
from smolux.settings import SpatialSettings

from .methods import METHODS
from .methods.base import Run, SpatialMethod
from .results.replay import history
from .results.trace import Trace, empty_series
from .system import System

if TYPE_CHECKING:
    import xarray as xr

Float = NDArray[np.float64]

#: events between two looks around, and output times if none are given
_BUDGET = 1 << 16
_TIMES = 100
_TICK = 0.2
#: bytes that the result needs for each event, besides those of the log
_EVENT = 100


#: former name of `Progress`
SpatialProgress = Progress


def simulate(
    system: System,
    method: str | SpatialMethod = "windowed",
    *,
    until: float | None = None,
    clusters: int = 1,
    times: ArrayLike | None = None,
    max_events: int | None = None,
    time_limit: float | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> xr.DataTree:
    """Let discs fly and stick until few clusters are left.

    Parameters
    ----------
    system : System
        Where the discs are and how they move.
    method : str or SpatialMethod
        See `smolux.spatial.METHODS`.
    until : float, optional
        Time at which to stop, however many clusters are left.
    clusters : int
        Stop when so few clusters are left.
    times : array_like of shape (T,), optional
        Output times of the series, ascending. If left out, 100 of them, geometrically spaced over
        the time in which the discs merge; methods that take steps need them.
    max_events : int, optional
        Stop after so many merges and reflections, or steps.
    time_limit : float, optional
        Stop after so many seconds of wall time.
    progress : callable, optional
        Called with a `Progress` a few times a second.

    Returns
    -------
    xarray.DataTree
        The discs at the end and, in groups, ``series`` over time and all that happened, ``events``
        (the merger tree) and ``walls``. `replay` gives any instant of it.

    Raises
    ------
    InputError
        With every mistake in the arguments.
    Interrupted
        On Ctrl-C; holds the result of what was reached, from which `resume` goes on.

    Notes
    -----
    A run that stops before its goal, at a limit or because memory would not last, says why: its
    attribute ``complete`` is 0, ``stopped`` has the reason, and so has a warning, see
    `smolux.results.warnings`.

    References
    ----------
    P. Degond, G. Dimarco, M. Ferreira, S. Hecht.

    Examples
    --------
    >>> import smolux as sx
    >>> system = sx.spatial.lattice(100, 0.1, seed=1)
    >>> result = sx.spatial.simulate(system)
    >>> result["events"].sizes["event"]
    99
    """
    given = dict(locals())
    from smolux.results import told

    chosen, settings = checked(given.pop("system"), given.pop("method"), given)
    begun = partial(chosen.start, system, np.array(settings.times or ()))
    return told(driven(system, chosen, begun, settings))


def driven(
    system: System, method: SpatialMethod, begun: Callable[[], Run], settings: SpatialSettings
) -> xr.DataTree:
    """Drive a run to its end and make the result of it."""
    started = clock.perf_counter()
    run = begun()
    with Stopper() as stopper:
        driver = _Driver(run, len(system), settings, started, stopper.check)
        try:
            stopped = driver.drive(*settings.limits())
        except AtOnce:  # state and log may not agree
            raise
        except KeyboardInterrupt:
            driver.interrupted = True
            stopped = "interrupted"
    trace = run.trace()
    trace.stopped = trace.stopped or stopped
    wall = clock.perf_counter() - started
    output = None if settings.times is None else np.array(settings.times)
    tree = _result(system, method, trace, output, wall, driver.compile_seconds)
    if driver.interrupted:
        raise Interrupted(f"stopped with {run.clusters} clusters left", tree)
    return tree


class _Driver:
    """Calls a run slice by slice."""

    def __init__(
        self, run: Run, discs: int, settings: SpatialSettings, started: float,
        check: Callable[[], None],
    ) -> None:  # fmt: skip
        self.run, self.discs, self.target = run, discs, settings.clusters
        self.started, self.progress, self.check = started, settings.progress, check
        self.compile_seconds = 0.0
        self.interrupted = False

    def drive(self, until: float, most: float, limit: float) -> str:
        """Go on to the end; return why it was not the goal, or nothing."""
        told = self.started
        while (code := self._slice(until, most, limit)) is None:
            self.check()
            now = clock.perf_counter()
            if now - told > _TICK:
                told = now
                self._tell()
        self._tell()
        return code

    def _slice(self, until: float, most: float, limit: float) -> str | None:
        budget = int(min(_BUDGET, most - self.run.events))
        if budget <= 0:
            return f"the limit of {most:g} events is reached"
        try:
            code = self.run.advance(until, self.target, budget)
        except OutOfMemoryError as error:
            return str(error)
        spent = clock.perf_counter() - self.started
        self.compile_seconds = self.compile_seconds or spent
        if code is None and spent > limit:
            return f"the time limit of {limit:g} s is reached"
        return self._short() if code is None else code

    def _short(self) -> str | None:
        """Say if what has happened leaves too little memory for the result to be made of it."""
        try:
            with needed(_EVENT * self.run.events, "what happened so far and the result of it"):
                return None
        except OutOfMemoryError as error:
            return str(error)

    def _tell(self) -> None:
        if self.progress is None:
            return
        run, wanted = self.run, max(self.discs - self.target, 1)
        speed = run.events / (clock.perf_counter() - self.started)
        done = min((self.discs - run.clusters) / wanted, 1.0)
        self.progress(
            Progress(
                done,
                "simulating",
                run.events,
                events_per_second=speed,
                compile_seconds=self.compile_seconds,
                note=f"{run.clusters} clusters left",
                counts={"clusters": run.clusters, "time": run.time},
            )
        )


def checked(
    system: Any, method: Any, given: Mapping[str, Any]
) -> tuple[SpatialMethod, SpatialSettings]:
    """Return the method and the other arguments, or raise an `InputError` with every mistake."""
    problems: list[str] = []
    if not isinstance(system, System):
        problems.append(
            f"system = {system!r}: must be a smolux.spatial.System, or made by lattice or random"
        )
    chosen = _method(method, problems)
    steps = isinstance(chosen, SpatialMethod) and not chosen.exact
    if steps and given.get("times") is None:
        problems.append(f"times: the method {chosen.name!r} takes steps; say when to observe")
    return chosen, SpatialSettings.checked(given, problems)


def _method(method: Any, problems: list[str]) -> Any:
    if isinstance(method, str):
        found = [m for m in METHODS if m.name == method]
        if found:
            return found[0]()
        near = did_you_mean(method, [m.name for m in METHODS])
        problems.append(f"method = {method!r}: unknown{near}")
    elif not isinstance(method, SpatialMethod):
        problems.append(f"method = {method!r}: must be a name or one of smolux.spatial.METHODS")
    return method


def _default_times(trace: Trace) -> Float:
    """Choose times from well before the first merge to the end."""
    merges = trace.log.time[trace.log.merges]
    last = trace.time
    if not last > 0:
        return np.zeros(1)
    first = merges[len(merges) // 100] if len(merges) else last
    start = min(max(first, 1e-6 * last) / 10, last / 2)
    inner = np.geomspace(start, last, _TIMES - 1)
    inner[-1] = last
    return np.concatenate(([0.0], inner))


def _result(
    system: System,
    method: SpatialMethod,
    trace: Trace,
    output: Float | None,
    wall: float,
    compiling: float,
) -> xr.DataTree:
    from .results.result import to_tree

    times = _default_times(trace) if output is None else output
    merging, series = None, trace.series
    if method.exact:
        merging, series = history(system, trace.log, times, trace.time)
    elif series is None:
        series = empty_series(times, len(system), system.dimension)
    attributes = {
        "method": method.name,
        "method_settings": vars(method),
        "wall_seconds": wall,
        "first_slice_seconds": compiling,
        **trace.attributes,
    }
    return to_tree(system, trace, series, merging, attributes)
