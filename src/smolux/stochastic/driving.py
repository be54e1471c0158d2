"""Driving a run: threads or other workers, progress, checkpoints, interruption, more replicas."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import FIRST_EXCEPTION, Executor, ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING

import numpy as np

from smolux.errors import InputError, Interrupted, OutOfMemoryError, WorkerError
from smolux.results import to_dataset
from smolux.runtime.executors import completed
from smolux.runtime.progress import Progress
from smolux.settings import PILOT, Control
from smolux.settings.target_error import Assessment, Trial, assess, plan_replicas, shortfall

from . import checkpoint as checkpoints
from .observe import observable, to_records
from .plan import Plan, check_memory
from .replicas import Group
from .subvolumes import SubvolumeReplica, start

if TYPE_CHECKING:
    import xarray as xr

_TICK = 0.2
#: intervals below this share of the mean are rounding, of what is conserved
_ROUNDING = 1e-12


class Run:
    """What every way to run has: groups of replicas, a stopping rule, progress, the result."""

    def __init__(
        self,
        plan: Plan,
        groups: list[Group | SubvolumeReplica],
        progress: Callable[[Progress], None] | None,
        workers: int,
        planned: float = 0.0,
    ) -> None:
        self.plan, self.groups, self.progress, self.workers = plan, groups, progress, workers
        self.started = time.perf_counter()
        self.compile_seconds = 0.0
        #: seconds spent on bounds before there were groups
        self.planned = planned
        self.assessment: Assessment | None = None
        self.remarks: list[str] = []

    @property
    def piloting(self) -> bool:
        """Whether the groups are pilots, by which the number of replicas is chosen."""
        return bool(self.groups) and self.groups[0].first >= PILOT

    def more(self) -> list[tuple[int, int]]:
        """Replicas that the target error still takes, when all are done; none if it is reached."""
        rule, done = self.plan.rule, self.plan.replicas
        if rule is None:
            return []
        values, moved = observable(self.plan, rule, self.groups)
        assessment = self.assessment = assess(rule, values, moved)
        if self.piloting:
            return self._after_pilots(plan_replicas(rule, values, moved))
        if assessment.following > done and self._widened(assessment.following, done):
            for group in self.groups:
                group.release()
            return self.plan.groups(self.workers, done)
        if assessment.error > rule.error:
            time_ = self.plan.times[assessment.at]
            self.remarks.append(shortfall(rule, assessment, done, time_))
        elif _ROUNDING < assessment.error < 1 / self.plan.particles and rule.target != "largest":
            self.remarks.append(
                f"the interval of {rule.target} is no longer than the bias of a finite population "
                f"may be, of the order of 1/particles = {1 / self.plan.particles:g}, and which "
                "replicas do not reduce: use more particles"
            )
        return []

    def _after_pilots(self, trial: Trial) -> list[tuple[int, int]]:
        """Begin more pilots, or the replicas of the result in place of the pilots."""
        done = self.plan.replicas
        if trial.pilots > done and self._widened(trial.pilots, done):
            for group in self.groups:
                group.release()
            return self.plan.pilots(self.workers, done)
        assert self.plan.rule is not None
        self.groups = []
        if not self._widened(trial.replicas or self.plan.rule.most, 0):
            self.plan = replace(self.plan, replicas=self.plan.rule.first)  # as many as the pilots
        return self.plan.groups(self.workers)

    def _widened(self, replicas: int, done: int) -> bool:
        """Plan more replicas, of which some are `done`, if there is memory for them."""
        wider = replace(self.plan, replicas=replicas)
        try:
            check_memory(wider, done)
        except InputError as error:
            remark = f"no further replicas: {error}"
            self.remarks += [remark] if remark not in self.remarks else []
            return False
        self.plan = wider
        return True

    def report(self, done: float, events: int, rate: float) -> None:
        """Tell progress: replicas that are done, parts of them included."""
        if self.progress is None:
            return
        rule, expected = self.plan.rule, float(self.plan.replicas)
        if rule is not None and self.assessment is not None:
            expected = max(expected, min(self.assessment.needed, rule.most))
        fraction = min(done / expected, 1.0)
        spent = time.perf_counter() - self.started - self.compile_seconds
        left = spent * (1 - fraction) / fraction if fraction > 0 else np.nan
        reached = np.nan if self.assessment is None else self.assessment.error
        wanted = np.nan if rule is None else rule.error
        near = f"±{100 * reached:.2g} % of ±{100 * wanted:.2g} %, {self.plan.replicas} replicas"
        self.progress(
            Progress(
                fraction,
                "simulating",
                events,
                events_per_second=rate,
                seconds_left=left,
                compile_seconds=self.compile_seconds,
                bounds_seconds=self.planned + sum(g.bounds_seconds for g in self.groups),
                note=near if np.isfinite([reached, wanted]).all() else "",
                counts={
                    "replicas": self.plan.replicas, "error": reached, "target_error": wanted,
                },
            )
        )  # fmt: skip

    def dataset(self, *remarks: str, **attributes: object) -> xr.Dataset:
        """Return what there is."""
        records = to_records(self.plan, self.groups)
        records.attributes["bounds_seconds"] += self.planned
        records.attributes |= attributes
        if self.piloting:
            records.attributes["complete"] = False
        records.attributes["wall_seconds"] = time.perf_counter() - self.started
        if self.assessment is not None and records.attributes["complete"]:
            records.attributes["reached_error"] = self.assessment.error
        records.warnings += [*self.remarks, *(r for r in remarks if r)]
        return to_dataset(self.plan.model, records)

    def salvaged(self, error: InputError | MemoryError, *remarks: str) -> InputError:
        """Return an error found late in a run with what was computed before, which is right."""
        found = error if isinstance(error, InputError) else OutOfMemoryError()
        # no memory even for that: there may be a checkpoint
        with suppress(MemoryError):
            found.dataset = self.dataset(*found.problems, *remarks)
        return found


class ThreadRun(Run):
    """Groups of replicas on threads of this process."""

    def __init__(
        self,
        plan: Plan,
        groups: list[Group | SubvolumeReplica],
        control: Control,
        workers: int,
        planned: float = 0.0,
        resumed: bool = False,
    ) -> None:
        super().__init__(plan, groups, control.progress, workers, planned)
        self.executor, self.checkpoint = control.executor, control.checkpoint
        self.every = control.checkpoint_every
        self.limit = np.inf if control.time_limit is None else control.time_limit
        self.saved = self.started
        self.unsaved = ""
        #: whether the file holds this run, be it at an earlier time
        self.written = resumed

    def finish(self) -> xr.Dataset:
        """Run to the end or to the time limit, or raise `Interrupted` with what there is."""
        begun = False
        try:
            for group in [g for g in self.groups if not g.done][:1]:
                group.compile()
                self.compile_seconds = group.compile_seconds
            begun = True
            if self._drive():
                return self.dataset(self.unsaved)
        except KeyboardInterrupt:
            written = self._save()
            words = ["interrupted", f"go on from {written}" if written else "", self.unsaved]
            message = "; ".join(word for word in words if word)
            raise Interrupted(message, self.dataset(self.unsaved), written) from None
        except (InputError, MemoryError) as error:
            if not begun:
                raise
            written = self._save()
            found = self.salvaged(error, self.unsaved)
            found.checkpoint = written
            raise found from None
        return self._stopped()

    def _stopped(self) -> xr.Dataset:
        """Return what there is at the time limit, and say how to go on."""
        written, reason = self._save(), f"the time limit of {self.limit:g} s is reached"
        where = f"; go on with smolux.resume({str(written)!r})" if written else ""
        file = {"checkpoint": str(written)} if written else {}
        return self.dataset(f"{reason}{where}", self.unsaved, stopped=reason, **file)

    def _drive(self) -> bool:
        """Advance all groups; return whether that was to the end."""
        pool = self.executor or ThreadPoolExecutor(self.workers)
        try:
            while True:
                self._stretch(pool)
                if all(g.done for g in self.groups):
                    parts = self.more()
                    if not parts:
                        return True
                    self.groups += [start(self.plan, *part) for part in parts]
                now = time.perf_counter()
                if now - self.started > self.limit:
                    return False
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
        except (OSError, InputError, MemoryError) as error:
            # a full disk must not cost what is computed
            reason = str(error) or "out of memory"
            self.unsaved = f"no checkpoint was written: {reason}"
        else:
            self.written = True
        self.saved = time.perf_counter()
        # an older one is as good, if it is of this run
        return self.checkpoint if self.written else None


#: what a group came to, and the error that ended it
Outcome = tuple[Group | SubvolumeReplica, InputError | None]


def run_group(plan: Plan, first: int, count: int) -> Outcome:
    """Run a group to its end, in a worker of any executor.

    What was observed is all that goes back; also if an error came late.
    """
    group = start(plan, first, count)
    group.compile()
    found: InputError | None = None
    try:
        group.advance(lambda: False)
    except InputError as error:
        found = error
    except MemoryError:
        found = OutOfMemoryError()
    group.release()
    return group, found


class ExecutorRun(Run):
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
        """Run to the end, or raise what ended it with what workers have sent back.

        Raises
        ------
        InputError
            If one was found late in the run; groups that had not begun then are left out.
        Interrupted
            On Ctrl-C.
        WorkerError
            If the workers die again and again.
        """
        parts = self.plan.begin(self.workers)
        found: dict[int, Group | SubvolumeReplica] = {}
        try:
            while parts:
                self._gather(parts, found)
                self.groups += [found[k] for k in range(len(parts))]
                found.clear()
                parts = self.more()
            return self.dataset()
        except KeyboardInterrupt:
            raise Interrupted("interrupted", self._kept(parts, found)) from None
        except WorkerError as error:
            error.dataset = self._kept(parts, found, str(error))
            raise
        except (InputError, MemoryError) as error:
            self._take_over(parts, found)
            raise (self.salvaged(error) if self.groups else error) from None

    def _kept(
        self,
        parts: list[tuple[int, int]],
        found: dict[int, Group | SubvolumeReplica],
        *remarks: str,
    ) -> xr.Dataset | None:
        """Return what workers have sent back; None if that is nothing."""
        self._take_over(parts, found)
        return self.dataset(*remarks) if self.groups else None

    def _take_over(
        self, parts: list[tuple[int, int]], found: dict[int, Group | SubvolumeReplica]
    ) -> None:
        """Take the groups that were found, and in place of the others some that never began."""
        if self.groups or found:
            self.groups += [
                found[k] if k in found else Group.unbegun(self.plan, *part)
                for k, part in enumerate(parts)
            ]

    def _gather(
        self, parts: list[tuple[int, int]], found: dict[int, Group | SubvolumeReplica]
    ) -> None:
        """Run groups; at an error those that have begun are still waited for."""
        tasks = [(self.plan, *part) for part in parts]
        errors: list[InputError] = []

        def enough() -> bool:
            return bool(errors)

        self._tell(found)
        for done in completed(self.executor, run_group, tasks, _TICK, enough):
            if done is not None:
                k, future = done
                try:
                    found[k], error = future.result()
                except WorkerError as dead:
                    first, count = parts[k]
                    raise WorkerError(
                        f"replicas {first} to {first + count - 1}: {dead}; it may have run out of "
                        "memory: use fewer workers or particles"
                    ) from None
                errors += [error] if error is not None else []
            self._tell(found)
        if errors:
            raise errors[0]

    def _tell(self, found: dict[int, Group | SubvolumeReplica]) -> None:
        groups = [*self.groups, *found.values()]
        events = sum(g.events for g in groups)
        spent = time.perf_counter() - self.started
        self.report(sum(len(g.codes) for g in groups), events, events / spent if spent else 0.0)
