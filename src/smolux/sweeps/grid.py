"""Running a sweep: points one after the other, or as tasks of an executor; all in one dataset."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import smolux
from smolux import results
from smolux.analysis.sweeps import combine_sweep
from smolux.case import Case
from smolux.errors import InputError, Interrupted, quiet
from smolux.runtime.executors import adapted, completed, opened
from smolux.runtime.progress import Progress
from smolux.runtime.resources import available_memory

from .axes import read_axes
from .points import Folder, Point, Sweep, make_sweep

if TYPE_CHECKING:
    import xarray as xr

_TICK = 0.2
#: share of the memory that the gathered result may take
_MEMORY = 0.5


#: former name of `Progress`
SweepProgress = Progress


def sweep(
    case: Case | str | os.PathLike[str],
    over: Sequence[str] | Mapping[str, Any],
    *,
    directory: str | os.PathLike[str],
    sets: Sequence[str] = (),
    executor: Executor | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> xr.Dataset:
    """Run a case at every point of a grid of its parameters.

    Each point has a seed of its own, derived from that of the case and the values of the point. Its
    result is written when it is finished, whole or not at all; the same call again, after whatever
    end, does only what is missing and leads to the same data.

    Parameters
    ----------
    case : path or Case
        A case file. With ``[run]`` it is simulated, else solved.
    over : mapping, or sequence of str
        The keys of the case file and their values: ``{"kernel.a": [0.5, 1.0]}``, or as the command
        line has it: ``["kernel.a=0.5:1:11", "processes.shattering.rate=1e-3:1e-1:5:log"]``.
    directory : path
        A new folder for the sweep, or that of the same sweep.
    sets : sequence of str
        Changes of the case for all points: ``"run.particles=1e4"``.
    executor : concurrent.futures.Executor, optional
        Where points are computed, each by one worker; also the client of a Dask cluster. If left
        out, what ``[parallel]`` of the case says: without it the points come one after the other,
        the replicas of each on threads.
    progress : callable, optional
        Called with a `Progress` a few times a second.

    Returns
    -------
    xarray.Dataset
        As of `simulate` or `solve`, with a dimension for each key in front. ``point_status`` is
        ``"done"`` or ``"failed"``, ``point_message`` says why; ``point_seed`` and ``point_seconds``
        belong to each point. Shorter dimensions are filled up with NaN. It is also in
        ``results.nc`` of the folder.

    Raises
    ------
    InputError
        With every mistake in the case at any point, before anything is computed; or if every
        point fails.
    Interrupted
        On Ctrl-C. What is finished is kept.

    Warns
    -----
    SmoluxWarning
        With what the points warn of, and at how many of them.

    Examples
    --------
    >>> ds = sx.sweep("case.toml", {"kernel.a": [0.9, 0.95]}, directory="a")  # doctest: +SKIP
    >>> ds["moment"].sel({"kernel.a": 0.95})  # doctest: +SKIP
    """
    plan, drawn = make_sweep(case, read_axes(over), sets)
    _check_memory(plan.points())  # and all mistakes, before there is a folder
    folder = Folder(Path(directory).expanduser())
    return results.told(_Running(folder, folder.begin(plan, drawn), executor, progress).finish())


def go_on(
    directory: str | os.PathLike[str],
    *,
    executor: Executor | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> xr.Dataset:
    """Go on with the sweep in a folder; see `sweep`."""
    folder = Folder(Path(directory).expanduser())
    plan = folder.load()
    return results.told(_Running(folder, folder.begin(plan, False), executor, progress).finish())


def run_point(case: Case) -> xr.Dataset:
    """Compute a point in a worker, on one thread."""
    with ThreadPoolExecutor(1) as thread:
        return _computed(case, thread, None)


def _computed(case: Case, executor: Executor | None, progress: Any) -> xr.Dataset:
    with quiet():
        if case.run is not None:
            given = case.run.arguments()
            times = given.pop("times")
            ds = smolux.simulate(case.model, times, **given, executor=executor, progress=progress)
        else:
            assert case.solve is not None
            given = case.solve.arguments()
            times = given.pop("times")
            ds = smolux.solve(case.model, times, **given)
    ds.attrs["case"] = case.to_toml()
    return ds


class _Running:
    """A sweep under way."""

    def __init__(
        self,
        folder: Folder,
        plan: Sweep,
        executor: Executor | None,
        progress: Callable[[Progress], None] | None,
    ) -> None:
        self.folder, self.plan, self.progress = folder, plan, progress
        self.executor = adapted(executor)
        self.points = plan.points()
        self.failures: dict[int, str] = {}
        self.done = sum(self._is_done(p) for p in self.points)
        self.begun_with = self.done
        self.started = time.perf_counter()
        self.events, self.compile_seconds, self.bounds_seconds = 0, 0.0, 0.0

    def finish(self) -> xr.Dataset:
        """Do what is missing and combine everything."""
        missing = [p for p in self.points if not self._is_done(p)]
        try:
            self._tell()
            if missing:
                self._run(missing)
            ds = self._gathered()
            results.save(ds, self.folder.results)
            return ds
        except KeyboardInterrupt:
            raise Interrupted(
                f"stopped; {self.done - len(self.failures)} of {len(self.points)} points are "
                f"finished, and kept in {self.folder.path}"
            ) from None

    def _is_done(self, point: Point) -> bool:
        return self.folder.point(point.number).is_file()

    def _run(self, missing: list[Point]) -> None:
        given = self.executor
        if given is None or isinstance(given, ThreadPoolExecutor):
            settings = asdict(missing[0].case.parallel)
            if given is None and settings["executor"] != "threads":
                with opened(**settings) as pool:
                    assert pool is not None
                    return self._elsewhere(pool, missing)
            with opened("threads", settings["workers"]) as threads:
                return self._here(given or threads, missing)
        return self._elsewhere(given, missing)

    def _here(self, executor: Executor | None, missing: list[Point]) -> None:
        for point in missing:
            before = self.events, self.compile_seconds, self.bounds_seconds

            def tell(progress: Any, before: tuple[int, float, float] = before) -> None:
                self.events = before[0] + progress.events
                self.compile_seconds = before[1] + progress.compile_seconds
                self.bounds_seconds = before[2] + progress.bounds_seconds
                self._tell(progress.fraction)

            try:
                ds = _computed(point.case, executor, tell)
            except Exception as error:
                self._fail(point, error)
            else:
                self._keep(point, ds)
            self._tell()

    def _elsewhere(self, executor: Executor, missing: list[Point]) -> None:
        for done in completed(executor, run_point, [(p.case,) for p in missing], _TICK):
            if done is not None:
                point, future = missing[done[0]], done[1]
                error = future.exception()
                if error is None:
                    ds = future.result()
                    self.events += int(ds.attrs.get("events", 0))
                    self._keep(point, ds)
                elif isinstance(error, Exception):
                    self._fail(point, error)
                else:
                    raise error
            self._tell()

    def _keep(self, point: Point, ds: xr.Dataset) -> None:
        results.save(ds, self.folder.point(point.number))
        self.done += 1

    def _fail(self, point: Point, error: Exception) -> None:
        text = str(error) or "no message"
        kind = "" if isinstance(error, InputError) else f"{type(error).__name__}: "
        self.failures[point.number] = f"{kind}{text}"
        self.done += 1

    def _tell(self, part: float = 0.0) -> None:
        if self.progress is None:
            return
        points = len(self.points)
        spent = time.perf_counter() - self.started
        here = self.done - self.begun_with + part
        left = spent / here * (points - self.done - part) if here > 0 else math.nan
        failed = f", {len(self.failures)} failed" if self.failures else ""
        self.progress(
            Progress(
                min((self.done + part) / points, 1.0),
                "sweeping",
                self.events,
                events_per_second=self.events / spent if spent > 0 else 0.0,
                seconds_left=left,
                compile_seconds=self.compile_seconds,
                bounds_seconds=self.bounds_seconds,
                note=f"{self.done} of {points} points{failed}",
                counts={"points": points, "done": self.done, "failed": len(self.failures)},
            )
        )

    def _gathered(self) -> xr.Dataset:
        found: list[xr.Dataset | None] = []
        for point in self.points:
            if point.number in self.failures:
                found.append(None)
                continue
            ds = results.load(self.folder.point(point.number))
            if ds.attrs.get("case") != point.case.to_toml():
                raise InputError(
                    f"{self.folder.point(point.number)}: is the result of another case than "
                    f"{point.label}; remove it, and go on by: smolux sweep {self.folder.path}"
                )
            found.append(ds)
        messages = [self.failures.get(p.number, "") for p in self.points]
        if len(self.failures) == len(self.points):
            first = self.points[0]
            raise InputError(f"every point failed; {first.label}: {messages[0]}")
        ds = combine_sweep({axis.key: axis.values for axis in self.plan.axes}, found, messages)
        return ds.assign_attrs(base_case=self.plan.text, seed=str(self.plan.seed))


def _check_memory(points: Sequence[Point]) -> None:
    """Refuse a sweep that cannot be gathered, before anything is computed."""
    available = available_memory()
    if available is None:
        return
    needed = 0.0
    for point in points:
        run = point.case.run
        if run is not None:
            bins = max(0.0, 62 - math.log2(run.sizes)) * run.bins_per_octave
            row = run.sizes + bins + len(run.orders) + 8
            needed += 8.0 * run.replicas * len(run.times) * row
    if needed > _MEMORY * available:
        raise InputError(
            f"the results of all {len(points)} points together need up to {needed / 1e9:.1f} GB, "
            f"and this process may use {available / 1e9:.1f} GB: lower run.sizes, "
            "run.replicas or the number of times or points"
        )


def failures(ds: xr.Dataset) -> Iterator[tuple[str, str]]:
    """Yield the label and the message of every point that failed."""
    keys = [str(d) for d in ds["point_status"].dims]
    stacked = ds[["point_status", "point_message"]].stack(point=keys)
    for k in range(stacked.sizes["point"]):
        point = stacked.isel(point=k)
        if str(point["point_status"].values) == "failed":
            label = ", ".join(f"{key} = {point[key].values}" for key in keys)
            yield label, str(point["point_message"].values)
