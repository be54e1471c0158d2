"""The stochastic entry point: checks the arguments, drives the loop in slices, observes."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_EXCEPTION, Executor, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from . import checkpoint as checkpoints
from .errors import InputError, Interrupted
from .methods.base import Method
from .model import Model
from .observe import to_records
from .plan import Plan, make_plan
from .replicas import Group
from .results import to_dataset
from .weighting.base import Weighting

if TYPE_CHECKING:
    import xarray as xr

_TICK = 0.2


@dataclass(frozen=True)
class Progress:
    """How far a run is.

    Attributes
    ----------
    events : int
        Collisions so far, over all replicas.
    fraction : float
        Share of the simulated time that is done, 0 to 1.
    events_per_second : float
    seconds_left : float
        Estimated from the simulated time done so far; NaN when nothing is known yet.
    compile_seconds : float
        Spent on compiling, not counted in the rate.
    """

    events: int
    fraction: float
    events_per_second: float
    seconds_left: float
    compile_seconds: float


def simulate(
    model: Model,
    times: ArrayLike,
    *,
    method: str | Method = "acceptance-rejection",
    weighting: str | Weighting = "number",
    population: str = "doubling",
    particles: int = 100_000,
    replicas: int = 8,
    seed: int | None = None,
    orders: Sequence[float] = (0, 1, 2, 3),
    sizes: int = 1024,
    bins_per_octave: int = 4,
    distribution: bool = False,
    executor: Executor | None = None,
    progress: Callable[[Progress], None] | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    checkpoint_every: float = 600.0,
    time_limit: float | None = None,
) -> xr.Dataset:
    """Simulate the exact jump process of a model (Marcus-Lushnikov), several replicas of it.

    Parameters
    ----------
    model : Model
        The physics.
    times : array_like of shape (T,)
        Output times, ascending, zero or more.
    method : str or Method
        How the next pair is found, see `smolux.methods.METHODS`.
    weighting : str or Weighting
        What one simulated particle stands for, see `smolux.weighting.WEIGHTINGS`.
    population : {"doubling", "fixed-volume", "none"}
        Double the volume, every particle once more, when half of the initial number are left; or
        do not.
    particles : int
        Simulated particles at the start; the volume is ``particles / density``.
    replicas : int
        Independent runs; error bars come from the spread over them.
    seed : int, optional
        Entropy of the random streams, one for each replica; drawn and stored if left out. The
        same seed gives the same numbers on any number of threads.
    orders : sequence of float
        Orders p of the moments ``M_p = sum_k k**p n_k``.
    sizes : int
        Densities are given size by size up to this size, in bins above.
    bins_per_octave : int
        Bins for each doubling of size.
    distribution : bool
        Keep the whole population at each time.
    executor : concurrent.futures.Executor, optional
        Where groups of replicas run; threads of this process if left out. Other executors than
        threads run without progress and checkpoints.
    progress : callable, optional
        Called with a `Progress` a few times a second.
    checkpoint : path, optional
        File for checkpoints, written every `checkpoint_every` seconds and when the run is
        stopped. Left in place at the end: delete it when the result is saved.
    checkpoint_every : float
        Seconds between checkpoints.
    time_limit : float, optional
        Wall seconds after which the run stops as if interrupted.

    Returns
    -------
    xarray.Dataset
        With the dimensions replica, time, order, size, bin; see the page on the dataset.

    Raises
    ------
    InputError
        With every mistake in the arguments, or when the kernel gives no valid rate during the run.
    Interrupted
        On Ctrl-C, or past the time limit; holds the dataset of what was reached, and the
        checkpoint from which `resume` goes on, bit for bit.

    Notes
    -----
    Waiting times are exponential, so every distribution of the process is exact, fluctuations
    included. The mean over replicas differs from the solution of the rate equations by
    ``O(1/particles)``; this bias is not part of the spread.

    Examples
    --------
    >>> import smolux as sx
    >>> model = sx.Model(kernel=sx.kernels.Constant())
    >>> ds = sx.simulate(model, times=[1, 10], particles=10_000, replicas=4, seed=1)
    >>> float(ds["moment"].sel(order=1).mean())
    1.0
    """
    problems = _control_problems(executor, progress, checkpoint, checkpoint_every, time_limit)
    try:
        plan = make_plan(
            model, times, method, weighting, population, particles, replicas, seed, orders, sizes,
            bins_per_octave, distribution,
        )  # fmt: skip
    except InputError as error:
        raise InputError([*error.problems, *problems]) from None
    if problems:
        raise InputError(problems)
    if executor is not None and not isinstance(executor, ThreadPoolExecutor):
        return _elsewhere(plan, executor)
    groups = [Group.start(plan, *part) for part in plan.groups(_workers())]
    run = _Run(plan, groups, executor, progress, checkpoint, checkpoint_every, time_limit)
    return run.finish()


def resume(
    checkpoint: str | os.PathLike[str],
    *,
    model: Model | None = None,
    executor: ThreadPoolExecutor | None = None,
    progress: Callable[[Progress], None] | None = None,
    checkpoint_every: float = 600.0,
    time_limit: float | None = None,
) -> xr.Dataset:
    """Go on from a checkpoint; the data are bit for bit those of an uninterrupted run.

    Parameters
    ----------
    checkpoint : path
        As written by `simulate`; kept up to date.
    model : Model, optional
        Needed only if the kernel or a rate is a Python function.
    executor, progress, checkpoint_every, time_limit
        As for `simulate`.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError, Interrupted
        As `simulate`, and if the file cannot be read.
    """
    problems = _control_problems(executor, progress, checkpoint, checkpoint_every, time_limit)
    if problems:
        raise InputError(problems)
    plan, groups = checkpoints.load(Path(checkpoint).expanduser(), model)
    run = _Run(plan, groups, executor, progress, checkpoint, checkpoint_every, time_limit)
    return run.finish()


def _control_problems(
    executor: Any, progress: Any, checkpoint: Any, checkpoint_every: Any, time_limit: Any
) -> list[str]:
    """Return what is wrong with the arguments that decide how a run is driven, not its outcome."""
    problems = []
    if executor is not None and not callable(getattr(executor, "submit", None)):
        problems.append(
            f"executor = {executor!r}: must be a concurrent.futures.Executor, or None for threads"
        )
    elif executor is not None and not isinstance(executor, ThreadPoolExecutor):
        problems += [
            f"{name} = {value!r}: is only for runs on threads of this process; "
            "leave it out, or leave out the executor"
            for name, value in (("checkpoint", checkpoint), ("time_limit", time_limit))
            if value is not None
        ]
    if progress is not None and not callable(progress):
        problems.append(f"progress = {progress!r}: must be a function that takes a Progress")
    if checkpoint is not None:
        problems += _path_problems(checkpoint)
    for name, value in (("checkpoint_every", checkpoint_every), ("time_limit", time_limit)):
        number = isinstance(value, (int, float, np.number)) and not isinstance(value, bool)
        if not (number and value > 0) and (name, value) != ("time_limit", None):
            problems.append(f"{name} = {value!r}: must be a positive number of seconds")
    return problems


def _path_problems(checkpoint: Any) -> list[str]:
    where = f"checkpoint = {checkpoint!r}"
    if not isinstance(checkpoint, (str, os.PathLike)):
        return [f"{where}: must be the path of a file"]
    path = Path(checkpoint).expanduser()
    if path.is_dir():
        return [f"{where}: is a folder; name a file in it"]
    if not path.absolute().parent.is_dir():
        return [f"{where}: there is no folder {str(path.parent)!r}; create it first"]
    return []


def _workers() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class _Run:
    """Groups of replicas on threads: progress, checkpoints, interruption."""

    def __init__(
        self,
        plan: Plan,
        groups: list[Group],
        executor: ThreadPoolExecutor | None,
        progress: Callable[[Progress], None] | None,
        checkpoint: str | os.PathLike[str] | None,
        checkpoint_every: float,
        time_limit: float | None,
    ) -> None:
        self.plan, self.groups, self.executor, self.progress = plan, groups, executor, progress
        self.checkpoint = None if checkpoint is None else Path(checkpoint).expanduser()
        self.every = checkpoint_every
        self.limit = np.inf if time_limit is None else time_limit
        self.started = time.perf_counter()
        self.compile_seconds = 0.0
        self.unsaved = ""

    def finish(self) -> xr.Dataset:
        """Run to the end, or raise `Interrupted` with what there is."""
        reason = ""
        try:
            self.groups[0].compile()
            self.compile_seconds = self.groups[0].compile_seconds
            reason = self._drive()
        except KeyboardInterrupt:
            reason = "interrupted"
        if reason:
            self._save()
            where = f"; go on from {self.checkpoint}" if self.checkpoint else ""
            raise Interrupted(
                f"{reason}{where}{self.unsaved and '; ' + self.unsaved}",
                self._dataset(),
                self.checkpoint,
            )
        return self._dataset()

    def _drive(self) -> str:
        """Advance all groups; return why it stopped early, or nothing."""
        pool = self.executor or ThreadPoolExecutor(_workers())
        try:
            while True:
                self._stretch(pool)
                if all(g.done for g in self.groups):
                    return ""
                if time.perf_counter() - self.started > self.limit:
                    return f"stopped at the time limit of {self.limit:g} s"
                self._save()
        finally:
            if self.executor is None:
                pool.shutdown()

    def _stretch(self, pool: Executor) -> None:
        """Advance all groups until they are done, or until a checkpoint or the limit is due."""
        halt = Event()
        begun, events = time.perf_counter(), float(sum(g.events for g in self.groups))
        due = min(begun + self.every if self.checkpoint else np.inf, self.started + self.limit)
        waiting = [pool.submit(g.advance, halt.is_set) for g in self.groups if not g.done]
        try:
            while waiting and time.perf_counter() < due:
                tick = min(_TICK, 0.01 + 0.1 * (time.perf_counter() - begun))
                ended, left = wait(waiting, tick, FIRST_EXCEPTION)
                for future in ended:
                    future.result()
                waiting = list(left)
                self._report(begun, events)
        finally:
            halt.set()
            for future in waiting:
                future.exception()
        for future in waiting:
            future.result()

    def _report(self, begun: float, events_before: float) -> None:
        if self.progress is None:
            return
        events = sum(g.events for g in self.groups)
        sizes = [len(g.codes) for g in self.groups]
        fraction = float(np.average([g.fraction for g in self.groups], weights=sizes))
        elapsed = time.perf_counter() - begun
        spent = time.perf_counter() - self.started - self.compile_seconds
        left = spent * (1 - fraction) / fraction if fraction > 0 else np.nan
        rate = (events - events_before) / elapsed if elapsed > 0 else 0.0
        self.progress(Progress(events, fraction, rate, left, self.compile_seconds))

    def _save(self) -> None:
        if self.checkpoint is None:
            return
        try:
            checkpoints.save(self.checkpoint, self.plan, self.groups)
            self.unsaved = ""
        except (OSError, InputError) as error:  # a full disk must not cost what is computed
            self.unsaved = f"no checkpoint was written: {error}"

    def _dataset(self) -> xr.Dataset:
        records = to_records(self.plan, self.groups)
        records.attributes["wall_seconds"] = time.perf_counter() - self.started
        if self.unsaved:
            records.warnings.append(self.unsaved)
        return to_dataset(self.plan.model, records)


def _run_group(plan: Plan, first: int, count: int) -> Group:
    """Run a group to its end, in a worker of any executor."""
    group = Group.start(plan, first, count)
    group.compile()
    group.advance(lambda: False)
    return group


def _elsewhere(plan: Plan, executor: Executor) -> xr.Dataset:
    started = time.perf_counter()
    workers = getattr(executor, "_max_workers", None) or _workers()
    futures = [executor.submit(_run_group, plan, *part) for part in plan.groups(workers)]
    try:
        groups = [f.result() for f in futures]
    except BaseException:
        for future in futures:
            future.cancel()
        raise
    records = to_records(plan, groups)
    records.attributes["wall_seconds"] = time.perf_counter() - started
    return to_dataset(plan.model, records)
