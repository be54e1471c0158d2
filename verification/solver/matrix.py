"""The items of this verification: three ways through the matrix, and the reference itself."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from smolux.plotting.style import PALETTE, new_figure, styled, use_log
from smolux.runtime.resources import cores
from verification.outcome import Check, Item, Outcome, Table, at_most

from . import reference
from .cells import DIRECT, Cell, alone, each, paired, timed
from .closed import additive_number, constant_densities, constant_number, second_moment
from .judge import TOLERANCE, judge

#: processor seconds of one solution
_LIMIT = 60.0
#: an error of so many tolerances is still what was asked for
_ALLOWED = 10.0
#: the direct sum on a given window is tried up to so many sizes
_FIXED = 400
#: every start with every process takes long: so many items
_PARTS = 4
#: one cell of so many is solved by the reference with a looser tolerance as well
_AGAIN, _LOOSE = 5, 1e-9


def _ways(window: int) -> dict[str, dict[str, Any]]:
    """Return options by the name of the way to solve a cell that needs so many sizes."""
    ways: dict[str, dict[str, Any]] = {"low-rank": {"method": "low-rank"}}
    if window <= DIRECT:
        ways["direct"] = {"method": "direct"}
    if window <= _FIXED:
        ways["direct, fixed"] = {"method": "direct", "window": window}
    return ways


def _row(at: int, cell: Cell) -> dict[str, Any]:
    try:
        exact = reference.solve(cell.problem, cell.times)
        own = exact.edge
        if at % _AGAIN == 0:
            loose = reference.solve(cell.problem, cell.times, rtol=_LOOSE)
            own = max(own, float(np.max(np.abs(loose.moment / exact.moment - 1.0))))
    except reference.TooLongError as error:
        return {"cell": cell.name, "left out": str(error)}
    runs = {}
    for way, options in _ways(exact.window).items():
        verdict = judge(cell.model, exact, cell.times, _LIMIT, **options)
        # a solution on a window that is too small by construction may say so
        runs[way] = asdict(verdict) | {"worst": verdict.worst}
    return {
        "cell": cell.name, "start": cell.start.name, "kernel": cell.kernel.name,
        "processes": [p.name for p in cell.processes], "varying": cell.varying.name,
        "window": exact.window, "reference": own, "runs": runs,
    }  # fmt: skip


def _chosen(cells: Callable[[], Iterable[Cell]], quick: bool) -> list[Cell]:
    chosen = list(cells())
    if quick:
        chosen = [c for c in chosen if c.problem.largest <= 400][:: max(1, len(chosen) // 12)]
    return chosen


def _computed(cells: Callable[[], Iterable[Cell]], quick: bool, at: int) -> dict[str, Any]:
    return _row(at, _chosen(cells, quick)[at])  # laws of cells are functions without a name


def compute(cells: Callable[[], Iterable[Cell]], quick: bool) -> dict[str, Any]:
    count = len(_chosen(cells, quick))
    with ProcessPoolExecutor(cores()) as pool:
        return {"rows": list(pool.map(partial(_computed, cells, quick), range(count)))}


def _error(value: Any) -> float:
    """Return an error as it was; what is not finite is stored as nothing."""
    return np.inf if value is None else float(value)


def _worst(rows: Iterable[dict[str, Any]]) -> float:
    return max((_error(run["worst"]) for row in rows for run in row["runs"].values()), default=0.0)


def _short(error: float) -> str:
    return "no result" if np.isinf(error) else f"{error:.0e}"


def _crossed(
    rows: Sequence[dict[str, Any]], down: Callable[[Any], list[str]],
    across: Callable[[Any], list[str]], caption: str, corner: str,
) -> Table:  # fmt: skip
    """Make a table of the worst error by two properties of a cell."""
    groups = defaultdict(list)
    for row in rows:
        for a in down(row):
            for b in across(row):
                groups[a, b].append(row)
    names = [list(dict.fromkeys(key[k] for key in groups)) for k in (0, 1)]
    body = [
        [a, *(_short(_worst(groups[a, b])) if (a, b) in groups else "" for b in names[1])]
        for a in names[0]
    ]
    return Table(caption, [corner, *names[1]], body)


@styled
def _figure(rows: Sequence[dict[str, Any]]) -> Figure:
    figure = new_figure("single", 0.8)
    ax = figure.subplots()
    for way, color in zip(_named(rows), PALETTE, strict=False):
        errors = sorted(_error(row["runs"][way]["worst"]) for row in rows if way in row["runs"])
        share = (np.arange(len(errors)) + 1.0) / len(errors)
        ax.step(np.clip(errors, 1e-14, 10.0), share, where="post", color=color, label=way)
    ax.axvline(TOLERANCE, color="0.6", linewidth=0.8)
    use_log(ax, "x")
    ax.set_xlabel("largest relative error")
    ax.set_ylabel("share of the cells")
    ax.legend()
    return figure


def _named(rows: Sequence[dict[str, Any]]) -> list[str]:
    return list(dict.fromkeys(way for row in rows for way in row["runs"]))


def _checks(rows: Sequence[dict[str, Any]]) -> list[Check]:
    allowed = _ALLOWED * TOLERANCE
    checks = [
        at_most("error of the reference: edge, tolerance",
                max(_error(r["reference"]) for r in rows), 2e-9, "(a fifth of the tolerance)"),
    ]  # fmt: skip
    for way in _named(rows):
        runs = [row["runs"][way] for row in rows if way in row["runs"]]
        good = sum(_error(run["worst"]) <= allowed for run in runs)
        checks.append(
            Check(f"cells within {_ALLOWED:g} tolerances, {way}", f"{good} of {len(runs)}", "all",
                  f"error ≤ {allowed:.0e}", good == len(runs))
        )  # fmt: skip
    said = Counter(bool(run["remark"]) for row in rows for run in row["runs"].values())
    checks.append(Check("solutions with a warning", str(said[True]), "0", "0", not said[True]))
    return checks


def _bad(rows: Sequence[dict[str, Any]]) -> Table | None:
    found = [
        [row["cell"].replace("|", "/"), way, run["outcome"], _short(_error(run["worst"])),
         run["remark"]]
        for row in rows for way, run in row["runs"].items()
        if _error(run["worst"]) > _ALLOWED * TOLERANCE or run["remark"]
    ]  # fmt: skip
    head = ["start / processes / kernel", "way", "outcome", "error", "said"]
    return Table("Cells that are off, or that warn", head, found) if found else None


def present(tables: Callable[[Any], list[Table]], data: dict[str, Any]) -> Outcome:
    rows = [row for row in data["rows"] if "left out" not in row]
    apart = [row["cell"] for row in data["rows"] if "left out" in row]
    runs = [run for row in rows for run in row["runs"].values()]
    bad = _bad(rows)
    return Outcome(
        ran=f"{len(rows)} cells, {len(runs)} solutions",
        checks=_checks(rows),
        tables=[*tables(rows), *([bad] if bad else [])],
        notes=[
            f"Errors are the largest of M0 to M3, densities, events of each process and mass in "
            f"and out, relative, at two times; the tolerance is {TOLERANCE:g}.",
            f"A solution has {_LIMIT:g} seconds of processor time. The direct sum is tried where "
            f"the window needs no more than {DIRECT} sizes.",
            f"Error of the reference: what passed the edge of its window, and in one cell of "
            f"{_AGAIN} the difference to a solution at a tolerance of {_LOOSE:g}.",
            *(
                [
                    f"Left out, as the explicit steps of the reference take too long: "
                    f"{'; '.join(apart)}."
                ]
                if apart
                else []
            ),
        ],
        figure=_figure(rows),
        caption="Share of the cells whose error is at most so large; the line is the tolerance.",
    )


def _by_kernel(rows: Any) -> list[Table]:
    return [
        _crossed(rows, lambda r: [r["start"]], lambda r: [r["kernel"]],
                 "Largest error, aggregation alone", "start"),
    ]  # fmt: skip


def _by_time(rows: Any) -> list[Table]:
    return [
        _crossed(rows, lambda r: r["processes"], lambda r: [r["varying"]],
                 "Largest error over all kernels", "process"),
        _crossed(rows, lambda r: r["processes"], lambda r: [r["kernel"]],
                 "Largest error over all that varies", "process"),
    ]  # fmt: skip


def _by_process(rows: Any) -> list[Table]:
    return [
        _crossed(rows, lambda r: [r["start"]], lambda r: r["processes"],
                 "Largest error of models with the process", "start"),
    ]  # fmt: skip


def _by_pair(rows: Any) -> list[Table]:
    return [
        _crossed(rows, lambda r: r["processes"], lambda r: r["processes"],
                 "Largest error of models with both processes", "process"),
    ]  # fmt: skip


# The reference itself

_COMPARED = ("M0", "M1", "M2", "n")


def compute_reference(quick: bool) -> dict[str, Any]:
    rows = []
    for cell in alone():
        kind = cell.kernel.name
        if kind not in ("constant", "additive", "multiplicative"):
            continue
        if quick and cell.problem.largest > 400:
            continue
        exact, t = reference.solve(cell.problem, cell.times), cell.times[-1]
        n = cell.start.densities(exact.window)
        k = np.arange(1.0, len(n) + 1.0)
        density, mass, second = (float(n @ k**p) for p in (0, 1, 2))
        found = {
            "M1": exact.moment[-1, 1] / mass - 1,
            "M2": exact.moment[-1, 2] / second_moment(kind, mass, second, t) - 1,
        }
        if kind == "constant":
            few = min(2000, len(n))
            right = constant_densities(n[:few], t)
            found["n"] = np.abs(exact.n[-1, :few] - right).sum() / exact.moment[-1, 0]
        if kind != "multiplicative":
            number = (
                constant_number(density, t) if kind == "constant"
                else additive_number(density, mass, t)
            )  # fmt: skip
        else:  # d/dt M0 = -M1^2 / 2
            number = density - 0.5 * mass**2 * t
        found["M0"] = exact.moment[-1, 0] / number - 1
        rows.append({"start": cell.start.name, "kernel": kind, "window": exact.window,
                     "errors": {what: abs(e) for what, e in found.items()}})  # fmt: skip
    return {"rows": rows}


def present_reference(data: dict[str, Any]) -> Outcome:
    rows = data["rows"]
    worst = max(e for row in rows for e in row["errors"].values())
    body = [
        [row["start"], row["kernel"], str(row["window"])]
        + [f"{row['errors'][w]:.0e}" if w in row["errors"] else "" for w in _COMPARED]
        for row in rows
    ]
    return Outcome(
        ran=f"{len(rows)} solutions of the reference",
        checks=[at_most("largest error against closed forms", worst, 1e-10, "(relative)")],
        tables=[Table("Errors of the reference", ["start", "kernel", "sizes", *_COMPARED], body)],
        notes=["Densities for K = 1: up to size 2000, their sum over the number density."],
    )  # fmt: skip


def _item(name: str, title: str, cells: Callable[[], Iterable[Cell]], tables: Any) -> Item:
    return Item(name, title, partial(compute, cells), partial(present, tables))


ITEMS = (
    Item("reference", "The reference against closed forms", compute_reference, present_reference),
    _item("starts", "Aggregation alone, from every start", alone, _by_kernel),
    _item("times", "What varies in time", timed, _by_time),
    *(
        _item(
            f"processes-{k + 1}",
            f"Starts with every process, part {k + 1} of {_PARTS}",
            partial(each, slice(k, None, _PARTS)),
            _by_process,
        )
        for k in range(_PARTS)
    ),
    _item("pairs", "Pairs of processes", paired, _by_pair),
)
