"""Driving a run: threads or other workers, progress, checkpoints, interruption, more replicas."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import FIRST_EXCEPTION, Executor, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING

import numpy as np

from . import checkpoint as checkpoints
from .errors import InputError, Interrupted, WorkerError
from .executors import completed
from .goal import Verdict, judge, shortfall
from .observe import observable, to_records
from .plan import Plan, check_memory
from .replicas import Group
from .results import to_dataset
from .subvolumes import Divided, start

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


class Run:
    """What every way to run has: groups of replicas, a goal, progress, the result."""

    def __init__(
        self,
        plan: Plan,
        groups: list[Group | Divided],
        progress: Callable[[Progress], None] | None,
        workers: int,
        planned: float = 0.0,
    ) -> None:
        self.plan, self.groups, self.progress, self.workers = plan, groups, progress, workers
        self.started = time.perf_counter()
        self.compile_seconds = 0.0
        #: seconds spent on bounds before there were groups
        self.planned = planned
        self.verdict: Verdict | None = None
        self.remarks: list[str] = []

    def more(self) -> list[tuple[int, int]]:
        """Replicas that the goal still needs, when all are done; none if it is reached."""
        goal, done = self.plan.goal, self.plan.replicas
        if goal is None:
            return []
        values, moved = observable(self.plan, self.groups)
        verdict = self.verdict = judge(goal, values, moved)
        if verdict.following > done:
            wider = replace(self.plan, replicas=verdict.following)
            try:
                check_memory(wider, done)
            except InputError as error:
                self.remarks.append(f"no further replicas: {error}")
            else:
                self.plan = wider
                for group in self.groups:
                    group.release()
                return wider.groups(self.workers, done)
        if verdict.error > goal.error:
            time_ = self.plan.times[verdict.at]
            self.remarks.append(shortfall(goal, verdict, done, time_))
        elif verdict.error < 1 / self.plan.particles and goal.target != "largest":
            self.remarks.append(
                f"the interval of {goal.target} is no longer than the bias of a finite population "
                f"may be, of the order of 1/particles = {1 / self.plan.particles:g}, and which "
                "replicas do not reduce: use more particles"
            )
        return []

    def report(self, done: float, events: int, rate: float) -> None:
        """Tell progress: replicas that are done, parts of them included."""
        if self.progress is None:
            return
        goal, expected = self.plan.goal, float(self.plan.replicas)
        if goal is not None and self.verdict is not None:
            expected = max(expected, min(self.verdict.needed, goal.most))
        fraction = min(done / expected, 1.0)
        spent = time.perf_counter() - self.started - self.compile_seconds
        left = spent * (1 - fraction) / fraction if fraction > 0 else np.nan
        self.progress(
            Progress(
                events, fraction, rate, left, self.compile_seconds, self.plan.replicas,
                np.nan if self.verdict is None else self.verdict.error,
                np.nan if goal is None else goal.error,
                self.planned + sum(g.bounds_seconds for g in self.groups),
            )
        )  # fmt: skip

    def dataset(self, *remarks: str) -> xr.Dataset:
        """Return what there is."""
        records = to_records(self.plan, self.groups)
        records.attributes["bounds_seconds"] += self.planned
        records.attributes["wall_seconds"] = time.perf_counter() - self.started
        if self.verdict is not None and records.attributes["complete"]:
            records.attributes["reached_error"] = self.verdict.error
        records.warnings += [*self.remarks, *(r for r in remarks if r)]
        return to_dataset(self.plan.model, records)


class Threads(Run):
    """Groups of replicas on threads of this process."""

    def __init__(
        self,
        plan: Plan,
        groups: list[Group | Divided],
        executor: ThreadPoolExecutor | None,
        progress: Callable[[Progress], None] | None,
        checkpoint: Path | None,
        checkpoint_every: float,
        time_limit: float | None,
        workers: int,
        planned: float = 0.0,
        resumed: bool = False,
    ) -> None:
        super().__init__(plan, groups, progress, workers, planned)
        self.executor, self.checkpoint, self.every = executor, checkpoint, checkpoint_every
        self.limit = np.inf if time_limit is None else time_limit
        self.saved = self.started
        self.unsaved = ""
        #: whether the file holds this run, be it at an earlier time
        self.written = resumed

    def finish(self) -> xr.Dataset:
        """Run to the end, or raise `Interrupted` with what there is."""
        reason = ""
        try:
            for group in [g for g in self.groups if not g.done][:1]:
                group.compile()
                self.compile_seconds = group.compile_seconds
            reason = self._drive()
        except KeyboardInterrupt:
            reason = "interrupted"
        except InputError as error:  # found late in a run: what was computed before is right
            error.checkpoint = self._save()
            error.dataset = self.dataset(*error.problems, self.unsaved)
            raise
        if reason:
            written = self._save()
            where = f"; go on from {written}" if written else ""
            raise Interrupted(
                f"{reason}{where}{self.unsaved and '; ' + self.unsaved}",
                self.dataset(self.unsaved),
                written,
            )
        return self.dataset(self.unsaved)

    def _drive(self) -> str:
        """Advance all groups; return why it stopped early, or nothing."""
        pool = self.executor or ThreadPoolExecutor(self.workers)
        try:
            while True:
                self._stretch(pool)
                if all(g.done for g in self.groups):
                    parts = self.more()
                    if not parts:
                        return ""
                    self.groups += [start(self.plan, *part) for part in parts]
                now = time.perf_counter()
                if now - self.started > self.limit:
                    return f"stopped at the time limit of {self.limit:g} s"
                if now >= self.saved + self.every:
                    self._save()
        finally:
            if self.executor is None:
                pool.shutdown()

    def _stretch(self, pool: Executor) -> None:
        """Advance all groups until they are done, or until a checkpoint or the limit is due."""
        halt = Event()
        begun, events = time.perf_counter(), sum(g.events for g in self.groups)
        due = min(self.saved + self.every if self.checkpoint else np.inf, self.started + self.limit)

        def stop() -> bool:  # asked by the workers: this thread may wake late on a busy machine
            return halt.is_set() or time.perf_counter() >= due

        waiting = [pool.submit(g.advance, stop) for g in self.groups if not g.done]
        try:
            while waiting and time.perf_counter() < due:
                tick = min(_TICK, 0.01 + 0.1 * (time.perf_counter() - begun))
                ended, left = wait(waiting, tick, FIRST_EXCEPTION)
                for future in ended:
                    future.result()
                waiting = list(left)
                self._tell(begun, events)
        finally:
            halt.set()
            for future in waiting:
                future.exception()
        for future in waiting:
            future.result()

    def _tell(self, begun: float, events_before: int) -> None:
        events = sum(g.events for g in self.groups)
        done = float(sum(g.fraction * len(g.codes) for g in self.groups))
        elapsed = time.perf_counter() - begun
        self.report(done, events, (events - events_before) / elapsed if elapsed > 0 else 0.0)

    def _save(self) -> Path | None:
        """Write a checkpoint if one was asked for; return the file from which the run goes on."""
        if self.checkpoint is None:
            return None
        try:
            checkpoints.save(self.checkpoint, self.plan, self.groups)
            self.unsaved = ""
        except (OSError, InputError) as error:  # a full disk must not cost what is computed
            self.unsaved = f"no checkpoint was written: {error}"
        else:
            self.written = True
        self.saved = time.perf_counter()
        # an older one is as good, if it is of this run
        return self.checkpoint if self.written else None


def run_group(plan: Plan, first: int, count: int) -> Group | Divided:
    """Run a group to its end, in a worker of any executor."""
    group = start(plan, first, count)
    group.compile()
    group.advance(lambda: False)
    group.release()  # what was observed is all that goes back
    return group


class Elsewhere(Run):
    """Groups of replicas as tasks of any executor."""

    def __init__(
        self,
        plan: Plan,
        executor: Executor,
        progress: Callable[[Progress], None] | None,
        workers: int,
        planned: float = 0.0,
    ) -> None:
        super().__init__(plan, [], progress, workers, planned)
        self.executor = executor

    def finish(self) -> xr.Dataset:
        """Run to the end, or raise `Interrupted`: what workers have not sent back is lost.

        Raises
        ------
        WorkerError
            If the workers die again and again.
        """
        parts = self.plan.groups(self.workers)
        try:
            while parts:
                found = self._gather(parts)
                self.groups += [found[k] for k in range(len(parts))]
                parts = self.more()
        except KeyboardInterrupt:
            raise Interrupted("interrupted") from None
        return self.dataset()

    def _gather(self, parts: list[tuple[int, int]]) -> dict[int, Group | Divided]:
        found: dict[int, Group | Divided] = {}
        tasks = [(self.plan, *part) for part in parts]
        self._tell(found)
        for done in completed(self.executor, run_group, tasks, _TICK):
            if done is not None:
                k, future = done
                try:
                    found[k] = future.result()
                except WorkerError as error:
                    first, count = parts[k]
                    raise WorkerError(
                        f"replicas {first} to {first + count - 1}: {error}; it may have run out of "
                        "memory: use fewer workers or particles"
                    ) from None
            self._tell(found)
        return found

    def _tell(self, found: dict[int, Group | Divided]) -> None:
        groups = [*self.groups, *found.values()]
        events = sum(g.events for g in groups)
        spent = time.perf_counter() - self.started
        self.report(sum(len(g.codes) for g in groups), events, events / spent if spent else 0.0)
