"""Figure 2: steady oscillations; both methods over the rate equations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

import smolux as sx
from smolux.analysis.oscillations import extrema
from smolux.plotting.style import MARKERS, PALETTE, new_figure, styled, use_linear

from ..outcome import Check, Item, Outcome, Table, at_most, normal_sigmas, worst
from .common import AR, INVERSE, LABEL, METHODS, brownian, curves, simulate, target


@dataclass(frozen=True)
class Case:
    """One panel; `accuracy` is the relative accuracy of the reference."""

    panel: str
    a: float
    shattering: float
    particles: int
    runs: int
    end: float
    accuracy: float

    @property
    def name(self) -> str:
        """Name of the item and of its targets."""
        return f"figure2{self.panel}"


CASES = (
    Case("a", 0.95, 0.01, 8_000, 3, 300.0, 5e-6),
    Case("b", 0.98, 0.005, 2_000, 3, 300.0, 5e-5),
)
#: the rate equations are observed more often, to locate extrema
_FINE = 0.25


def compute(case: Case, quick: bool) -> dict[str, Any]:
    end = 45.0 if quick else case.end
    particles, runs = (1000, 4) if quick else (case.particles, case.runs)
    physics = brownian(case.a, case.shattering)
    fine = np.arange(_FINE, end + _FINE / 2, _FINE)
    times = np.arange(1.0, end + 0.5)
    tolerance = 1e-6 if quick else 1e-8
    ds = sx.solve(physics, fine, orders=(2,), sizes=1, tolerance=tolerance)
    data: dict[str, Any] = {
        "fine": fine, "line": ds["moment"].values.ravel(), "times": times, "particles": particles,
        "mass_error": float(np.abs(np.asarray(_listed(ds, "mass_error"))).max()),
        "window": int(np.max(_listed(ds, "window"))),
        "dots": {}, "collisions": {},
    }  # fmt: skip
    for method in METHODS:
        ds = simulate(physics, times, particles, runs, method=method, orders=(2,), sizes=1)
        data["dots"][method] = ds["moment"].values.reshape(runs, -1)
        data["collisions"][method] = float(ds["collisions"][:, -1].mean()) / particles
    return data


def _listed(ds: Any, name: str) -> Any:
    import json

    value = ds.attrs[name]
    return json.loads(value) if isinstance(value, str) else np.atleast_1d(value)


def _extrema(data: dict[str, Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return extrema(np.asarray(data["fine"]), np.asarray(data["line"]))


def _solver_checks(case: Case, data: dict[str, Any]) -> list[Check]:
    reference = curves(case.name)
    line = dict(zip(data["fine"], data["line"], strict=True))
    shared = [k for k, t in enumerate(reference["t"]) if t in line]
    ours = np.array([line[reference["t"][k]] for k in shared])
    share = float(np.abs(ours / reference["M2"][shared] - 1).max())
    at, value, kind = _extrema(data)
    rows = [r for r in target(case.name)["rows"] if r["t"] < data["fine"][-1] - 1]
    pairs = [(r, int(np.argmin(abs(at - r["t"])))) for r in rows]
    late = max(abs(at[k] - r["t"]) for r, k in pairs)
    high = max(abs(value[k] / r["M2"] - 1) for r, k in pairs)
    alike = all((kind[k] > 0) == (r["extremum"] == "max") for r, k in pairs)
    return [
        at_most(
            "solver: M2(t), largest relative difference from the reference",
            share,
            case.accuracy,
            "(accuracy of the reference)",
        ),
        at_most(
            f"solver: height of {len(pairs)} extrema, relative difference",
            high,
            2 * case.accuracy + 1e-6,
            "",
        ),
        Check(
            f"solver: times of {len(pairs)} extrema, largest difference",
            f"{late:.1e}",
            "0",
            "≤ 0.02 (located between samples)",
            late <= 0.02 and alike,
        ),
    ]


def _at_extrema(
    case: Case, data: dict[str, Any], method: str
) -> tuple[list[dict[str, Any]], np.ndarray]:
    """M2 of every run at the output time nearest to each of the first reference extrema."""
    times = np.asarray(data["times"])
    rows = [r for r in target(case.name)["rows"] if r["t"] < times[-1]][:4]
    index = [int(np.argmin(abs(times - r["t"]))) for r in rows]
    return rows, np.asarray(data["dots"][method])[:, index]


def _run_checks(case: Case, data: dict[str, Any], method: str) -> list[Check]:
    rows, values = _at_extrema(case, data, method)
    line = np.interp([round(r["t"]) for r in rows], data["fine"], data["line"])
    runs = len(values)
    error = values.std(axis=0, ddof=1) / np.sqrt(runs)
    scores = [normal_sigmas(s, runs) for s in (values.mean(axis=0) - line) / error]
    checks = [worst(f"M2 near the first {len(rows)} extrema, {LABEL[method]}", scores)]
    if data["times"][-1] < 200:
        return checks
    periods, swings = _cycles(data, method)
    goal = target(case.name)["reference"]
    error = periods.std(ddof=1) / np.sqrt(runs)
    score = normal_sigmas((periods.mean() - goal["limit_cycle_period"]) / error, runs)
    checks.append(
        Check(
            f"period after t = 100, {LABEL[method]}",
            f"{periods.mean():.2f} ± {error:.2f} ({abs(score):.1f} σ)",
            f"{goal['limit_cycle_period']:g}",
            "≤ 4 σ",
            abs(score) <= 4,
        )
    )
    cycle = goal["limit_cycle_M2_max"] - goal["limit_cycle_M2_min"]
    ratio = float(swings.min() / cycle)
    checks.append(
        Check(
            f"oscillations last in every run, {LABEL[method]}: smallest mean swing after t = 200, "
            "over that of the limit cycle",
            f"{ratio:.2f}",
            "1",
            "≥ 0.7",
            ratio >= 0.7,
        )
    )
    return checks


def _cycles(data: dict[str, Any], method: str) -> tuple[np.ndarray, np.ndarray]:
    """Mean period after t = 100, mean swing between extrema after t = 200, of each run."""
    times, periods, swings = np.asarray(data["times"]), [], []
    for row in np.asarray(data["dots"][method]):
        at, value, kind = extrema(times, row, prominence=0.2)
        tops = at[(kind > 0) & (at > 100)]
        periods.append(np.ptp(tops) / (len(tops) - 1) if len(tops) > 1 else np.nan)
        late = value[at > 200]
        swings.append(np.abs(np.diff(late)).mean() if len(late) > 1 else 0.0)
    return np.array(periods), np.array(swings)


@styled
def _figure(case: Case, data: dict[str, Any]) -> Any:
    figure = new_figure("double", 0.36)
    ax = figure.subplots()
    ax.plot(
        data["fine"], data["line"], color="black", lw=0.9, label="rate equations (solver)", zorder=2
    )
    for m, method in enumerate((AR, INVERSE)):
        look = {"color": PALETTE[m], "marker": MARKERS[m], "ls": "none"}
        first = np.asarray(data["dots"][method])[0]
        ax.plot(
            data["times"],
            first,
            ms=2.2,
            mfc="none",
            mew=0.5,
            label=f"{LABEL[method]}, one run",
            zorder=3,
            **look,
        )
    rows = [r for r in target(case.name)["rows"] if r["t"] <= data["fine"][-1]]
    ax.plot(
        [r["t"] for r in rows],
        [r["M2"] for r in rows],
        color=PALETTE[2],
        marker="D",
        mfc="white",
        ls="none",
        ms=4.2,
        label="extrema, reference",
        zorder=4,
    )
    ax.set(xlabel="time $t$", ylabel="$M_2$", xlim=(0, data["fine"][-1]), ylim=(0, None))
    use_linear(ax, "x")
    use_linear(ax, "y")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


def present(case: Case, data: dict[str, Any]) -> Outcome:
    checks, rows = _solver_checks(case, data), []
    at, value, _ = _extrema(data)
    for method in METHODS:
        checks += _run_checks(case, data, method)
    for r in target(case.name)["rows"]:
        if r["t"] < data["fine"][-1] - 1:
            k = int(np.argmin(abs(at - r["t"])))
            rows.append(
                [
                    r["extremum"],
                    f"{r['t']:.3f}",
                    f"{at[k]:.3f}",
                    f"{r['M2']:.3f}",
                    f"{value[k]:.3f}",
                ]
            )
    head = ["extremum", "t, reference", "t, solver", "M2, reference", "M2, solver"]
    tables = [Table("Extrema of M2(t) of the rate equations", head, rows)]
    rows = []
    for method in METHODS:
        given, values = _at_extrema(case, data, method)
        error = values.std(axis=0, ddof=1) / np.sqrt(len(values))
        line = np.interp([round(r["t"]) for r in given], data["fine"], data["line"])
        rows += [
            [
                LABEL[method],
                f"{round(r['t'])}",
                f"{line[k]:.2f}",
                f"{values.mean(0)[k]:.2f} ± {error[k]:.2f}",
            ]
            for k, r in enumerate(given)
        ]
    tables.append(
        Table("M2 near the first extrema, mean over runs with one standard error",
              ["method", "t", "rate equations", "Monte Carlo"], rows)
    )  # fmt: skip
    runs = len(data["dots"][AR])
    collisions = ", ".join(f"{data['collisions'][m]:.0f} ({LABEL[m]})" for m in METHODS)
    return Outcome(
        ran=f"a = {case.a}, shattering {case.shattering}, monomers, to t = "
        f"{data['times'][-1]:g}: {runs} runs of "
        f"each method at N = {data['particles']} with doubling, over the "
        ""
        ""
        "solver.",
        checks=checks,
        tables=tables,
        notes=[
            f"Collisions per initial particle: {collisions}. The solver kept {data['window']} "
            "sizes; its largest "
            f"mass error is {data['mass_error']:.1e}.",
            "Runs drift out of phase with the rate equations as time goes on: finite systems "
            "have phase noise. "
            "Heights are therefore compared at the first extrema, periods and swings later.",
        ],
        figure=_figure(case, data),
        caption=(
            "Second moment: one run of each method over the rate equations, with the "
            "reference extrema."
        ),
    )


ITEMS = tuple(
    Item(
        case.name,
        f"Figure 2({case.panel}): oscillations, a = {case.a}, λ = {case.shattering}",
        partial(compute, case),
        partial(present, case),
    )
    for case in CASES
)
