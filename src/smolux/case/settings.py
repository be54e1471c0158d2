"""The tables on how a case is computed and shown: run, solve, parallel, output."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any

import numpy as np

from smolux import units
from smolux.errors import InputError, did_you_mean
from smolux.runtime.executors import KINDS
from smolux.settings import Control, Settings, SolverSettings
from smolux.settings.kinds import Kind, Seconds, Times, declared
from smolux.settings.solution import OBSERVED
from smolux.weighting import WeightFunction

from .reader import Problems, Table, show

#: the most output times a table of times may ask for
_MOST_TIMES = 1_000_000
_SPACINGS = ("linear", "log")
#: kinds of figures, see `smolux.plotting`
FIGURES = ("clusters", "moments", "size-distribution", "oscillations", "scaling")


@dataclass(frozen=True)
class Run(Settings):
    """How a case is simulated: the arguments of `smolux.simulate`."""

    checkpoint_every: float = declared(Control, "checkpoint_every")
    time_limit: float | None = declared(Control, "time_limit")

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of `smolux.simulate` that decide on the data."""
        return {f.name: getattr(self, f.name) for f in fields(Settings)}


@dataclass(frozen=True)
class Parallel:
    """Where a case is computed; the arguments of `smolux.runtime.executors.opened`."""

    executor: str = "threads"
    workers: int | None = None
    address: str | None = None


@dataclass(frozen=True)
class Solve(SolverSettings):
    """How a case is solved deterministically: the arguments of `smolux.solve`.

    Times, and what is observed, are those of the simulation if there is one.
    """

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of `smolux.solve`."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


@dataclass(frozen=True)
class Output:
    """What is written beside the results."""

    figures: tuple[str, ...] = ("clusters", "moments", "size-distribution")
    report: bool = True


def read_run(content: Any, problems: Problems) -> Run | None:
    """Read ``[run]``; None if anything of it is wrong."""
    table = Table(content, ("run",), problems)
    before = len(problems.messages)
    good = _read(Run, table)
    weighting = _weight_function(table)
    if weighting is not None:
        good["weighting"] = weighting
    for wrong in Run.disagreements(good):
        table.wrong(wrong)
    table.finish()
    return Run(**good) if len(problems.messages) == before else None


def _read(table_of: Any, table: Table, apart: Sequence[str] = ()) -> dict[str, Any]:
    """Read the keys that are the fields of settings; what is wrong is left out, and noted."""
    good = {}
    for f in fields(table_of):
        kind = f.metadata["kind"]
        if f.name in apart:
            continue
        before = len(table.problems.messages)
        if isinstance(kind, Times):
            value = read_times(table)
        else:
            value = read_key(table, f.name, kind, f.default)
        if len(table.problems.messages) == before:
            good[f.name] = value
    return good


def read_key(table: Table, key: str, kind: Kind, default: Any) -> Any:
    """Read a key of some kind; the default if it is left out or, with a note, wrong."""
    value = table.take(key, default)
    if isinstance(kind, Seconds) and isinstance(value, str):
        value = table.parsed((key,), value, units.TIME)
    try:
        return value if value is default else kind.check(key, value)
    except InputError as error:
        hint = ', or a text such as "2 h"' if isinstance(kind, Seconds) else ""
        for wrong in error.problems:
            table.wrong(wrong, hint)
    return default


def _weight_function(table: Table) -> WeightFunction | None:
    """Read the power of the size that is the weight."""
    needed = table.content.get("weighting") == WeightFunction.name
    if "exponent" not in table:
        table.known.append("exponent")
        if needed:
            table.require("exponent", "the power q of the weight function l**q, such as 0.5")
        return None
    value = table.number("exponent", None)
    if not needed:
        table.bad("exponent", 'is for weighting = "weight-function"; take one of both out')
        return None
    try:
        return None if value is None else WeightFunction(value)
    except InputError as error:
        for wrong in error.problems:
            table.bad("exponent", getattr(wrong, "cure", wrong))
    return None


def read_parallel(content: Any, run: Run | None, problems: Problems) -> Parallel:
    """Read ``[parallel]``."""
    table = Table(content, ("parallel",), problems)
    found = Parallel(
        table.choice("executor", Parallel.executor, KINDS),
        table.integer("workers", None, 1, 100_000),
        table.text("address", "") or None,
    )
    if found.address is not None and found.executor != "dask":
        table.bad("address", 'is only for executor = "dask"')
    elif found.address is not None and found.workers is not None:
        table.bad("workers", "the cluster at that address has those it has; take this line out")
    if run is not None and run.time_limit is not None and found.executor != "threads":
        table.bad(
            "executor", "a run that can be stopped by run.time_limit needs threads; take one out"
        )
    table.finish()
    return found


def read_solve(content: Any, run: Run | None, beside: bool, problems: Problems) -> Solve | None:
    """Read ``[solve]``; `beside` a simulation its times and what it observes hold for both."""
    table = Table(content, ("solve",), problems)
    before = len(problems.messages)
    names = ("times", *OBSERVED) if beside else ()
    for name in names:
        if name in table:
            table.bad(name, f"the {name} of [run] hold for both; take this line out")
            table.take(name)
    shared = {} if run is None else {"times": run.times}
    for former, key in (("largest", "window"), ("max_size", "max_window")):
        _rename(table, former, key)
    good = _read(Solve, table, names) | shared
    for wrong in Solve.disagreements(good):
        table.wrong(wrong)
    table.finish()
    return Solve(**good) if "times" in good and len(problems.messages) == before else None


def _rename(table: Table, former: str, key: str) -> None:
    """Take a key by the name that it had before."""
    if former not in table:
        return
    if key in table:
        table.bad(former, f"is called {key} now, which is given, too; take this line out")
        table.take(former)
        return
    warnings.warn(f"solve.{former} is called {key} now", DeprecationWarning, stacklevel=2)
    table.content[key] = table.content.pop(former)


def read_output(content: Any, problems: Problems) -> Output:
    """Read ``[output]``."""
    table = Table(content, ("output",), problems)
    figures = table.take("figures", list(Output.figures))
    if not isinstance(figures, list):
        table.bad("figures", f"must be a list such as {show(list(Output.figures))}")
        figures = []
    good = []
    for n, figure in enumerate(figures):
        if figure in FIGURES:
            good.append(figure)
        else:
            problems.add(
                ("output", "figures", n),
                f"output.figures[{n}] = {show(figure)}: is unknown"
                + did_you_mean(str(figure), FIGURES),
            )
    output = Output(tuple(dict.fromkeys(good)), table.flag("report", Output.report))
    table.finish()
    return output


def read_times(table: Table, kind: Kind | None = None) -> tuple[float, ...] | None:
    """Read output times: a list, or a table of start, stop, count and spacing."""
    value = table.take("times")
    if value is None:
        table.require("times", "give a list such as [1, 10], or { stop = 10, count = 50 }")
        return None
    if isinstance(value, Mapping):
        return _spaced(value, table)
    if not isinstance(value, list):
        value = [value]
    times = [table.convert(("times", n), t, units.TIME) for n, t in enumerate(value)]
    if None in times:
        return None
    try:
        found: tuple[float, ...] | None = (kind or Times()).check("times", times)
    except InputError as error:
        for wrong in error.problems:
            table.wrong(wrong)
        return None
    return found


def _spaced(value: Mapping[str, Any], parent: Table) -> tuple[float, ...] | None:
    table = Table(value, (*parent.path, "times"), parent.problems)
    before = len(parent.problems.messages)
    spacing = table.choice("spacing", "linear", _SPACINGS)
    start = table.quantity("start", None, units.TIME)
    stop = table.quantity("stop", None, units.TIME)
    count = table.integer("count", None, 2, _MOST_TIMES)
    table.finish()
    for key, what in (("stop", "the last time"), ("count", "how many times")):
        if key not in table:
            table.require(key, what)
    if spacing == "log" and "start" not in table:
        table.require("start", 'the first time; spacing = "log" cannot begin at 0')
    if len(parent.problems.messages) > before:
        return None
    first = 0.0 if start is None else start
    if first < 0 or (spacing == "log" and first == 0):
        table.bad("start", "must be " + ("above zero" if spacing == "log" else "zero or more"))
    elif not stop > first:
        table.bad("stop", f"must come after the start, {first:g}")
    else:
        return spaced(first, stop, count, spacing)
    return None


def spaced(start: float, stop: float, count: int, spacing: str) -> tuple[float, ...]:
    """Return times from `start` to `stop`, both included, even or even in the logarithm."""
    if spacing == "log":
        grid = start * (stop / start) ** (np.arange(count) / (count - 1))
        grid[-1] = stop
    else:
        grid = np.linspace(start, stop, count)
    # twelve digits are enough to see the spacing, and keep files readable
    times = [float(f"{t:.12g}") for t in grid]
    times[0], times[-1] = start, stop
    return tuple(times) if _ascending(times) else tuple(map(float, grid))


def _ascending(times: Sequence[float]) -> bool:
    return all(math.isfinite(b) and b > a for a, b in pairwise(times))


def as_table(settings: Any) -> dict[str, Any]:
    """Write settings as a table of the case file, what is None left out."""
    values: dict[str, Any] = {}
    for f in fields(settings):
        given, kind = getattr(settings, f.name), f.metadata.get("kind", Kind())
        if isinstance(given, WeightFunction):
            values |= {"weighting": given.name, "exponent": given.exponent}
        else:
            values[f.name] = kind.plain(given)
    return {k: v for k, v in values.items() if v is not None}
