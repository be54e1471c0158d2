"""Tables 3 and 4: run time of both methods and of the solver."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

import smolux as sx
from smolux.plotting.style import MARKERS, PALETTE, new_figure, styled, use_log
from verification.outcome import Check, Item, Outcome, Table

from .common import AR, INVERSE, LABEL, METHODS, ballistic, constant, loop_seconds, target

TIMES = (1.0, 10.0, 100.0)
PARTICLES = (1000, 10_000, 100_000, 1_000_000)
#: runs that would take longer than this are left out, in seconds
_TOO_LONG = 120.0
#: the paper prints four decimals: shorter times have no second digit, here or there, in seconds
_RESOLVED = 0.001
#: and from here on the fixed cost of a run, up to 10 ms, no longer counts
_LONG = 0.05
#: tolerance of the solver for run times: its errors are then far below those of the paper
_TOLERANCE = 1e-6


def _measure(physics: sx.Model, method: str, quick: bool) -> dict[int, dict[float, float | None]]:
    found: dict[int, dict[float, float | None]] = {}
    for particles in PARTICLES[: 2 if quick else 4]:
        found[particles] = {}
        for k, t in enumerate(TIMES[: 2 if quick else 3]):
            # linear in N; ten times later is not ten times more, but never less
            smaller = found.get(particles // 10, {}).get(t, 0.0)
            expected = np.inf if smaller is None else 10 * smaller
            seconds = None
            if expected <= _TOO_LONG:
                first = loop_seconds(physics, t, particles, method)
                more = 4 if first < 0.3 else 2 if first < 2 else 0
                again = [loop_seconds(physics, t, particles, method) for _ in range(more)]
                seconds = float(np.median([first, *again]))
            found[particles][TIMES[k]] = seconds
    return found


def _solver(physics: sx.Model, second: dict[float, float], quick: bool) -> dict[float, Any]:
    found = {}
    for t in TIMES[: 2 if quick else 3]:
        start = time.process_time()
        ds = sx.solve(physics, [t], tolerance=_TOLERANCE)
        seconds = time.process_time() - start
        error = float(ds["moment"].sel(order=2).item()) / second[t] - 1
        found[t] = [seconds, abs(error), int(np.max(np.atleast_1d(_window(ds))))]
    return found


def _window(ds: Any) -> Any:
    import json

    window = ds.attrs["window"]
    return json.loads(window) if isinstance(window, str) else window


def compute(case: Callable[[], tuple[sx.Model, dict[float, float]]], quick: bool) -> dict[str, Any]:
    physics, second = case()
    methods = {method: _measure(physics, method, quick) for method in METHODS}
    return {"seconds": methods, "solver": _solver(physics, second, quick)}


def _constant() -> tuple[sx.Model, dict[float, float]]:
    physics = constant()
    exact = sx.exact.solution(physics)
    return physics, dict(zip(TIMES, exact.moment(TIMES, 2).tolist(), strict=True))


def _ballistic() -> tuple[sx.Model, dict[float, float]]:
    reference = target("table2")["reference"]
    return ballistic(), dict(zip(reference["t"], reference["M2"], strict=True))


def _cells(data: dict[str, Any]) -> dict[tuple[str, int, float], float]:
    return {
        (method, int(n), float(t)): seconds
        for method, by_size in data["seconds"].items()
        for n, by_time in by_size.items()
        for t, seconds in by_time.items()
        if seconds is not None
    }


def _seconds(value: float) -> str:
    return f"{value:.2g}" if value < 99.5 else f"{value:.0f}"


def _table(name: str, data: dict[str, Any]) -> Table:
    cells, rows = _cells(data), []
    for row in target(name)["rows"]:
        n, t = row["N"], row["t"]
        if (AR, n, t) not in cells and t not in map(float, data["solver"]):
            continue
        ours = [cells.get((m, n, t)) for m in METHODS]
        seconds = data["solver"][f"{t:.1f}"][0]
        speed = [
            "not run" if o is None else f"{row[m] / o:.2g}"
            for m, o in zip(METHODS, ours, strict=True)
        ]
        ratio = "–" if None in ours else f"{ours[1] / ours[0]:.2g}"
        rows.append(
            [
                f"{n}",
                f"{t:g}",
                *(
                    "not run" if o is None else f"{_seconds(o)} ({row[m]:g})"
                    for m, o in zip(METHODS, ours, strict=True)
                ),
                f"{_seconds(seconds)} ({row['finite differences']:g})",
                ratio,
                f"{row[INVERSE] / row[AR]:.2g}",
                *speed,
            ]
        )
    head = [
        "N", "t", "A-R, s", "inverse, s", "solver, s", "inverse / A-R", "the same, paper",
        "paper / ours, A-R", "paper / ours, inverse",
    ]  # fmt: skip
    return Table(
        "Processor seconds of one run on one core (the paper's, on its hardware)", head, rows
    )


def _solver_table(data: dict[str, Any]) -> Table:
    rows = [
        [f"{float(t):g}", _seconds(s), f"{e:.1e}", str(w)]
        for t, (s, e, w) in data["solver"].items()
    ]
    return Table(
        f"The solver at tolerance {_TOLERANCE:g}",
        ["t", "seconds", "relative error of M2", "sizes at the end"],
        rows,
    )


def _dearer(name: str, data: dict[str, Any]) -> dict[tuple[int, float], tuple[float, float]]:
    """Seconds of the inverse method over those of acceptance-rejection: ours, the paper's."""
    cells = _cells(data)
    return {
        (n, t): (cells[INVERSE, n, t] / cells[AR, n, t], row[INVERSE] / row[AR])
        for row in target(name)["rows"]
        if row[AR] >= _RESOLVED
        and (INVERSE, n := row["N"], t := row["t"]) in cells
        and (AR, n, t) in cells
    }


def _growth(name: str, data: dict[str, Any], method: str) -> dict[tuple[int, float], float]:
    """Seconds over those of ten times fewer particles, where fixed costs do not show.

    With the ballistic kernel to t = 10: later, chance decides whether the volume is doubled once
    more, at twice the cost.
    """
    last = 10.0 if name == "table4" else max(TIMES)
    cells = _cells(data)
    return {
        (n, t): s / cells[m, n // 10, t]
        for (m, n, t), s in cells.items()
        if m == method and t <= last and cells.get((m, n // 10, t), 0.0) >= _LONG
    }


def _ratio_checks(name: str, data: dict[str, Any]) -> list[Check]:
    """Ratios of one run, which do not depend on the hardware."""
    checks = []
    dearer = _dearer(name, data)
    if dearer:
        (n, t), (ours, paper) = max(dearer.items(), key=lambda x: x[1][0] / x[1][1])
        checks.append(
            Check(
                f"seconds of inverse over acceptance-rejection, nearest to the paper of "
                f"{len(dearer)} entries",
                f"{ours:.2g} (N = {n}, t = {t:g})",
                f"{paper:.2g}",
                "at most the paper's",
                ours <= paper,
            )
        )
    for method in METHODS:
        growth = _growth(name, data, method)
        if growth:
            (n, t), factor = max(growth.items(), key=lambda x: abs(np.log(x[1] / 10)))
            checks.append(
                Check(
                    f"seconds grow like N, {LABEL[method]}: factor for ten times the particles, "
                    f"farthest of {len(growth)}",
                    f"{factor:.2g} (to N = {n}, t = {t:g})",
                    "10",
                    "within a factor of 2.5 (caches, other programs)",
                    bool(0.4 <= factor / 10 <= 2.5),
                )
            )
    return checks


def _checks(name: str, data: dict[str, Any]) -> list[Check]:
    cells, checks = _cells(data), _ratio_checks(name, data)
    goals = (
        [
            (INVERSE, 100_000, 10.0, 3.48, "a tenth of the paper's 34.8 s"),
            (AR, 1_000_000, 10.0, 1.2, "the paper: 0.96 s"),
        ]
        if name == "table4"
        else []
    )
    for method, n, t, limit, why in goals:
        if (method, n, t) in cells:
            s = cells[method, n, t]
            checks.append(Check(f"seconds, {LABEL[method]}, N = {n}, t = {t:g}", f"{s:.2f}", "–",
                                f"≤ {limit:g} ({why})", s <= limit))  # fmt: skip
    worst = max(e for _, e, _ in data["solver"].values())
    limit = 10 * _TOLERANCE
    checks.append(
        Check(
            "solver: largest relative error of M2",
            f"{worst:.1e}",
            "0",
            f"≤ {limit:g}",
            worst <= limit,
        )
    )
    return checks


def _notes(name: str, data: dict[str, Any]) -> list[str]:
    cells, rows = _cells(data), target(name)["rows"]
    speed = {
        m: [
            row[m] / cells[m, row["N"], row["t"]]
            for row in rows
            if row[m] >= _RESOLVED and (m, row["N"], row["t"]) in cells
        ]
        for m in METHODS
    }
    spans = "; ".join(f"{LABEL[m]} {min(x):.2g} to {max(x):.2g}" for m, x in speed.items() if x)
    line = {float(t): s for t, (s, _, _) in data["solver"].items()}
    given = {row["t"]: row["finite differences"] for row in rows}
    most = max(n for m, n, _ in cells if m == AR)
    ahead = ", ".join(f"{t:g}" for t, x in line.items() if x < cells.get((AR, most, t), 0.0))
    late = (
        [
            "By t = 100 the density of clusters has been as low as about 1/32 of the first: chance "
            "decides whether the volume is doubled a fifth time, after which all takes twice as "
            "long. Single runs there show one case or the other. The inverse method lists large "
            "particles one by one, so its collisions cost more there the larger N is.",
        ]
        if name == "table4"
        else []
    )
    return [
        "Processor time of the compiled loop, one run on one core, compilation and set-up (about "
        "10 ms) left out; medians of up to five runs. Other programs were running on the same "
        "machine.",
        "Seconds on other hardware cannot be judged, so the checks are of ratios within this run. "
        f"Entries of the paper below {1000 * _RESOLVED:g} ms have one digit and are not judged. "
        f"The paper's seconds over ours are, for the others: {spans}.",
        "In the paper acceptance-rejection is faster than finite differences throughout. Here the "
        "solver takes "
        + ", ".join(f"{given[t] / x:.0f}" for t, x in line.items())
        + " times less than the paper's finite differences at t = "
        + ", ".join(f"{t:g}" for t in line)
        + (
            f"; at N = {most} it is faster than acceptance-rejection at t = {ahead}."
            if ahead
            else "."
        ),
        *late,
    ]


@styled
def _figure(name: str, data: dict[str, Any]) -> Any:
    cells, rows = _cells(data), target(name)["rows"]
    figure = new_figure("double", 0.36)
    panels = figure.subplots(1, 3, sharey=True)
    for k, (ax, t) in enumerate(zip(panels, TIMES, strict=True)):
        use_log(ax, "x")
        use_log(ax, "y")
        for m, method in enumerate(METHODS):
            look = {"color": PALETTE[m], "marker": MARKERS[m]}
            ours = sorted((n, s) for (q, n, u), s in cells.items() if q == method and u == t)
            given = [(r["N"], r[method]) for r in rows if r["t"] == t]
            ax.plot(
                *zip(*given, strict=True),
                mfc="white",
                ls="--",
                lw=0.7,
                label=f"{LABEL[method]}, paper",
                **look,
            )
            if ours:
                ax.plot(*zip(*ours, strict=True), label=LABEL[method], **look)
        solver = data["solver"].get(f"{t:.1f}")
        given_fd = next(r["finite differences"] for r in rows if r["t"] == t)
        ax.axhline(given_fd, color="0.3", ls="--", lw=0.7, label="finite differences, paper")
        if solver:
            ax.axhline(solver[0], color="0.3", lw=1.0, label="solver")
        ax.set(xlabel="particles $N$")
        ax.set_title(f"$t = {t:g}$", pad=3)
        if k == 0:
            ax.set_ylabel("processor time (s)")
            handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def present(name: str, data: dict[str, Any]) -> Outcome:
    kernel = {
        "table3": "Constant kernel, shattering 0.1",
        "table4": "Ballistic kernel, shattering 0.01",
    }[name]
    skipped = [
        f"N = {n}, t = {float(t):g}"
        for n, by in data["seconds"][INVERSE].items()
        for t, s in by.items()
        if s is None
    ]
    notes = _notes(name, data)
    if skipped:
        notes.append(
            f"Inverse method, not run because it would take minutes: {'; '.join(skipped)}."
        )
    return Outcome(
        ran=(
            f"{kernel}, both methods with doubling and the solver, one after the other in one "
            "process."
        ),
        checks=_checks(name, data),
        tables=[_table(name, data), _solver_table(data)],
        notes=notes,
        figure=_figure(name, data),
        caption=(
            "Processor time of one run against the number of particles; dashed: the paper, "
            "on its hardware."
        ),
    )


ITEMS = (
    Item(
        "table3",
        "Table 3: run time, constant kernel",
        partial(compute, _constant),
        partial(present, "table3"),
    ),
    Item(
        "table4",
        "Table 4: run time, ballistic kernel",
        partial(compute, _ballistic),
        partial(present, "table4"),
    ),
)
