"""The tables on how a case is computed and shown: run, solve, parallel, output."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from itertools import pairwise
from typing import Any

import numpy as np

from .. import units
from ..errors import InputError, did_you_mean
from ..executors import KINDS
from ..goal import make_goal
from ..population import POPULATIONS
from .reader import Problems, Table, show

#: the most output times a table of times may ask for
_MOST_TIMES = 1_000_000
_SPACINGS = ("linear", "log")
#: what may stand in ``[solve]``, see `smolux.solve`
SOLVERS = ("auto", "direct", "low-rank")
GELS = ("inert", "reacts")
#: kinds of figures, see `smolux.plotting`
FIGURES = ("clusters", "moments", "size-distribution", "oscillations", "scaling")


@dataclass(frozen=True)
class Run:
    """How a case is simulated; the arguments of `smolux.simulate`."""

    times: tuple[float, ...]
    particles: int = 100_000
    replicas: int = 8
    seed: int | None = None
    method: str = "auto"
    weighting: str = "number"
    exponent: float | None = None
    population: str = "doubling"
    orders: tuple[float, ...] = (0, 1, 2, 3)
    sizes: int = 1024
    bins_per_octave: int = 4
    distribution: bool = False
    checkpoint_every: float = 600.0
    time_limit: float | None = None
    target_error: float | None = None
    target: str = "number_density"
    max_replicas: int = 1000
    subvolumes: int = 1
    remix: float = 1.0

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of `smolux.simulate` that decide on the data."""
        apart = ("checkpoint_every", "time_limit", "exponent")
        given = {k: v for k, v in asdict(self).items() if k not in apart}
        return given | {"weighting": self.weighted()}

    def weighted(self) -> Any:
        """Return the weighting: its name, or an object if it has a setting."""
        if self.exponent is None:
            return self.weighting
        from ..weighting import WeightFunction

        return WeightFunction(self.exponent)


@dataclass(frozen=True)
class Parallel:
    """Where a case is computed; the arguments of `smolux.executors.opened`."""

    executor: str = "threads"
    workers: int | None = None
    address: str | None = None


@dataclass(frozen=True)
class Solve:
    """How a case is solved deterministically; the arguments of `smolux.solve`.

    `times` are those of the simulation if there is one.
    """

    times: tuple[float, ...]
    method: str = "auto"
    tolerance: float = 1e-8
    window: int | None = None
    max_window: int | None = None
    gel: str = "inert"

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of `smolux.solve`."""
        return {k: v for k, v in asdict(self).items() if v is not None}


@dataclass(frozen=True)
class Output:
    """What is written beside the results."""

    figures: tuple[str, ...] = ("clusters", "moments", "size-distribution")
    report: bool = True


def read_run(content: Any, problems: Problems) -> Run | None:
    """Read ``[run]``; None if its times are missing or wrong."""
    from ..methods import METHODS
    from ..weighting import WEIGHTINGS

    table = Table(content, ("run",), problems)
    times = read_times(table)
    settings = {
        "particles": table.integer("particles", Run.particles, 2, 2**40),
        "replicas": table.integer("replicas", Run.replicas, 1, 1_000_000),
        "seed": table.integer("seed", None, 0),
        "method": table.choice("method", Run.method, ["auto", *(m.name for m in METHODS)]),
        "weighting": table.choice(
            "weighting", Run.weighting, ["auto", *(w.name for w in WEIGHTINGS)]
        ),
        "exponent": _exponent(table),
        "population": table.choice("population", Run.population, list(POPULATIONS)),
        "orders": read_orders(table),
        "sizes": table.integer("sizes", Run.sizes, 1, 10_000_000),
        "bins_per_octave": table.integer("bins_per_octave", Run.bins_per_octave, 1, 100),
        "distribution": table.flag("distribution", Run.distribution),
        "subvolumes": table.integer("subvolumes", Run.subvolumes, 1, 1024),
        "remix": table.number("remix", Run.remix, above=0.0),
        "checkpoint_every": table.seconds("checkpoint_every", Run.checkpoint_every),
        "time_limit": table.seconds("time_limit", Run.time_limit),
    }
    goal = {
        "target_error": table.take("target_error"),
        "target": table.take("target", Run.target),
        "max_replicas": table.integer("max_replicas", Run.max_replicas, 1, 1_000_000),
    }
    wrong: list[str] = []
    make_goal(
        **goal, replicas=settings["replicas"], orders=settings["orders"], sizes=settings["sizes"],
        problems=wrong,
    )  # fmt: skip
    keys = ("target_error", "target", "max_replicas", "replicas")
    problems.add_error(("run",), InputError([f"{w}" for w in wrong]), keys)
    table.finish()
    return Run(times, **settings, **goal) if times and not wrong else None


def _exponent(table: Table) -> float | None:
    """Read the power of the size that is the weight."""
    needed = table.content.get("weighting") == "weight-function"
    if "exponent" not in table:
        table.known.append("exponent")
        if needed:
            table.require("exponent", "the power q of the weight function l**q, such as 0.5")
        return None
    value: float | None = table.number("exponent", None)
    if not needed:
        table.bad("exponent", 'is for weighting = "weight-function"; take one of both out')
        return None
    if value is not None and not abs(value) <= 8:
        table.bad("exponent", "must be a number from -8 to 8")
    return value


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


def read_solve(content: Any, run_times: tuple[float, ...] | None, problems: Problems) -> Any:
    """Read ``[solve]``, with the times of the simulation if there is one."""
    table = Table(content, ("solve",), problems)
    times: tuple[float, ...] | None
    if run_times is not None:
        times = run_times
        if "times" in table:
            table.bad("times", "the times of [run] hold for both; take this line out")
            table.take("times")
    else:
        times = read_times(table)
    settings = {
        "method": table.choice("method", Solve.method, SOLVERS),
        "tolerance": table.number("tolerance", Solve.tolerance, above=0.0),
        "window": _renamed(table, "window", "largest"),
        "max_window": _renamed(table, "max_window", "max_size"),
        "gel": table.choice("gel", Solve.gel, GELS),
    }
    if not settings["tolerance"] <= 0.1:
        table.bad("tolerance", "must be at most 0.1; 1e-8 is usual")
    table.finish()
    return Solve(times, **settings) if times else None


def _renamed(table: Table, key: str, former: str) -> int | None:
    """Return a number of sizes by a key, or by the one that it had before."""
    if former not in table:
        return table.integer(key, None, 4, 100_000_000)
    if key in table:
        table.bad(former, f"is called {key} now, which is given, too; take this line out")
        table.take(former)
        return None
    warnings.warn(f"solve.{former} is called {key} now", DeprecationWarning, stacklevel=2)
    return table.integer(former, None, 4, 100_000_000)


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


def read_orders(table: Table) -> tuple[float, ...]:
    """Read the orders of the moments: different finite numbers."""
    value = table.take("orders", list(Run.orders))
    good = isinstance(value, list) and all(
        isinstance(p, (int, float)) and not isinstance(p, bool) and abs(p) <= 20 for p in value
    )
    if not (good and value and len(set(value)) == len(value)):
        table.bad("orders", "must be a list of different numbers from -20 to 20, such as [0, 1, 2]")
        return Run.orders
    return tuple(int(p) if p == int(p) else p for p in value)


def read_times(table: Table) -> tuple[float, ...] | None:
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
    if not times:
        table.bad("times", "give at least one time")
        return None
    if min(times) < 0 or any(b <= a for a, b in pairwise(times)):
        table.bad("times", "must be zero or more and ascending")
        return None
    if times[-1] == 0:
        table.bad("times", "the last one must be above zero")
        return None
    return tuple(times)


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
    values = {f.name: getattr(settings, f.name) for f in fields(settings)}
    return {k: list(v) if isinstance(v, tuple) else v for k, v in values.items() if v is not None}
