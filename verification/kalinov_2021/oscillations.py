"""Figure 2: steady oscillations; both methods over the rate equations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

import smolux as sx
from smolux.analysis.oscillations import extrema
from smolux.plotting.style import PALETTE, new_figure, styled, use_linear
from verification.outcome import (
    Check,
    Item,
    Outcome,
    Table,
    at_most,
    mean_sigmas,
    normal_sigmas,
    worst,
)

from .common import (
    AR,
    LABEL,
    METHODS,
    SEED,
    brownian,
    curves,
    draw_first_runs,
    second_moments,
    simulate,
    target,
)


@dataclass(frozen=True)
class Case:
    """One panel.

    `runs` are those to the end, and more of them to the last of the first extrema, as many as
    `compared`; `accuracy` is the relative accuracy of the reference. `larger` are particles and
    runs of acceptance-rejection to the same time, to see that deviations vanish with N.
    """

    panel: str
    a: float
    shattering: float
    particles: int
    runs: tuple[int, int]
    compared: int
    accuracy: float
    end: float = 300.0
    larger: tuple[int, int] | None = None

    @property
    def name(self) -> str:
        """Name of the item and of its targets."""
        return f"figure2{self.panel}"


CASES = (
    Case("a", 0.95, 0.01, 10_000, (4, 8), 4, 5e-6),
    Case("b", 0.98, 0.005, 5_000, (3, 5), 2, 5e-5, larger=(20_000, 4)),
)
#: the rate equations are observed more often, to locate extrema
_FINE = 0.25
#: and for longer, as an extremum is seen only when the curve has turned
_BEYOND = 10.0


def compute(case: Case, quick: bool) -> dict[str, Any]:
    end = np.ceil(target(case.name)["rows"][0]["t"]) + 2 if quick else case.end
    particles, runs = (1000, (4, 0)) if quick else (case.particles, case.runs)
    physics = brownian(case.a, case.shattering)
    fine = np.arange(_FINE, end + _BEYOND + _FINE / 2, _FINE)
    times = np.arange(1.0, end + 0.5)
    ds = sx.solve(physics, fine, orders=(2,), sizes=1, tolerance=1e-6 if quick else 1e-8)
    until = _first(case, end)[-1]["t"] + 1
    larger = None if quick or case.larger is None else larger_runs(case, times[times <= until])
    return {
        "fine": fine, "line": ds["moment"].values.ravel(), "times": times, "particles": particles,
        "mass_error": float(np.abs(np.asarray(_listed(ds, "mass_error"))).max()),
        "window": int(np.max(_listed(ds, "window"))), "larger": larger,
        "runs": {
            method: second_moments(physics, times, particles, method, runs, until)
            for method in METHODS
        },
    }  # fmt: skip


def larger_runs(case: Case, times: np.ndarray) -> dict[str, Any]:
    """M2 of the runs of the larger number of particles."""
    assert case.larger is not None
    particles, runs = case.larger
    options: dict[str, Any] = {"method": AR, "orders": (2,), "sizes": 1, "seed": SEED + 2}
    ds = simulate(brownian(case.a, case.shattering), times, particles, runs, **options)
    return {"particles": particles, "M2": ds["moment"].values.reshape(runs, -1)}


def _first(case: Case, end: float) -> list[dict[str, Any]]:
    """Return the first extrema of the reference, where heights of runs are compared."""
    return [r for r in target(case.name)["rows"] if r["t"] < end][: case.compared]


def _listed(ds: Any, name: str) -> Any:
    import json

    value = ds.attrs[name]
    return json.loads(value) if isinstance(value, str) else np.atleast_1d(value)


def _pairs(case: Case, data: dict[str, Any]) -> list[tuple[dict[str, Any], float, float]]:
    """Every extremum of the reference with ours of the same kind nearest in time, NaN if none."""
    at, value, kind = extrema(np.asarray(data["fine"]), np.asarray(data["line"]))
    pairs = []
    for row in target(case.name)["rows"]:
        if row["t"] < data["times"][-1]:
            same = np.flatnonzero(kind == (1 if row["extremum"] == "max" else -1))
            near = same[np.argsort(abs(at[same] - row["t"]))][:1]
            found = (float(at[near[0]]), float(value[near[0]])) if near.size else (np.nan, np.nan)
            pairs.append((row, *found))
    return pairs


def _solver_checks(case: Case, data: dict[str, Any]) -> list[Check]:
    reference = curves(case.name)
    line = dict(zip(data["fine"], data["line"], strict=True))
    shared = [k for k, t in enumerate(reference["t"]) if t in line]
    ours = np.array([line[reference["t"][k]] for k in shared])
    share = float(np.abs(ours / reference["M2"][shared] - 1).max())
    pairs = _pairs(case, data)
    late = float(np.max([abs(at - r["t"]) for r, at, _ in pairs]))
    high = float(np.max([abs(value / r["M2"] - 1) for r, _, value in pairs]))
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
            late <= 0.02,
        ),
    ]


def _at_extrema(
    case: Case, data: dict[str, Any], runs: list[list[float]]
) -> tuple[list[float], np.ndarray, np.ndarray]:
    """Output times nearest to the first extrema; M2 of the line and of these runs there."""
    times = np.asarray(data["times"])
    index = [int(np.argmin(abs(times - r["t"]))) for r in _first(case, times[-1])]
    line = np.interp(times[index], data["fine"], data["line"])
    return times[index].tolist(), line, np.asarray(runs)[:, index]


def _agreement(case: Case, data: dict[str, Any]) -> Check:
    """Both methods follow one law, also where finite systems differ from the rate equations."""
    one, two = (_at_extrema(case, data, data["runs"][m]["early"])[2] for m in METHODS)
    error = np.hypot(*(x.std(axis=0, ddof=1) / np.sqrt(len(x)) for x in (one, two)))
    scores = (one.mean(axis=0) - two.mean(axis=0)) / error
    return worst("M2 there, the two methods", normal_sigmas(scores, len(one) + len(two) - 1))


def _run_checks(case: Case, data: dict[str, Any], method: str) -> list[Check]:
    _, line, values = _at_extrema(case, data, data["runs"][method]["early"])
    scores = mean_sigmas(values, line)
    checks = [worst(f"M2 near the first {len(line)} extrema, {LABEL[method]}", scores)]
    if data["times"][-1] < 200:
        return checks
    periods, swings = _cycles(data, method)
    goal = target(case.name)["reference"]
    error = periods.std(ddof=1) / np.sqrt(len(periods))
    score = float(mean_sigmas(periods, goal["limit_cycle_period"]))
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
    """Period after t = 100 and mean swing between extrema after t = 200, of each run."""
    times, periods, swings = np.asarray(data["times"]), [], []
    for row in np.asarray(data["runs"][method]["long"]):
        at, value, kind = extrema(times, row, prominence=0.2)
        tops = at[(kind > 0) & (at > 100)]
        # the median, as a maximum that is lost in the noise makes one gap of two
        periods.append(np.median(np.diff(tops)) if len(tops) > 1 else np.nan)
        late = value[at > 200]
        swings.append(np.abs(np.diff(late)).mean() if len(late) > 1 else 0.0)
    return np.array(periods), np.array(swings)


@styled
def _figure(case: Case, data: dict[str, Any]) -> Any:
    figure = new_figure("double", 0.36)
    ax = figure.subplots()
    fine, end = np.asarray(data["fine"]), data["times"][-1]
    shown = fine <= end
    ax.plot(
        fine[shown],
        np.asarray(data["line"])[shown],
        color="black",
        lw=0.9,
        label="rate equations (solver)",
        zorder=2,
    )
    draw_first_runs(ax, data)
    rows = [r for r in target(case.name)["rows"] if r["t"] <= end]
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
    ax.set(xlabel="time $t$", ylabel="$M_2$", xlim=(0, end), ylim=(0, None))
    use_linear(ax, "x")
    use_linear(ax, "y")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


def _tables(case: Case, data: dict[str, Any]) -> list[Table]:
    rows = [
        [r["extremum"], f"{r['t']:.3f}", f"{at:.3f}", f"{r['M2']:.3f}", f"{value:.3f}"]
        for r, at, value in _pairs(case, data)
    ]
    head = ["extremum", "t, reference", "t, solver", "M2, reference", "M2, solver"]
    tables = [Table("Extrema of M2(t) of the rate equations", head, rows)]
    rows = []
    sets = [(LABEL[m], data["particles"], data["runs"][m]["early"]) for m in METHODS]
    if data.get("larger"):
        sets.append((LABEL[AR], data["larger"]["particles"], data["larger"]["M2"]))
    for name, particles, runs in sets:
        times, line, values = _at_extrema(case, data, runs)
        error = values.std(axis=0, ddof=1) / np.sqrt(len(values))
        mean = values.mean(axis=0)
        rows += [
            [
                name,
                str(particles),
                str(len(values)),
                f"{t:g}",
                f"{line[k]:.2f}",
                f"{mean[k]:.2f} ± {error[k]:.2f}",
            ]
            for k, t in enumerate(times)
        ]
    caption = "M2 near the first extrema, mean over runs with one standard error"
    head = ["method", "N", "runs", "t", "rate equations", "Monte Carlo"]
    return [*tables, Table(caption, head, rows)]


def present(case: Case, data: dict[str, Any]) -> Outcome:
    checks = _solver_checks(case, data)
    for method in METHODS:
        checks += _run_checks(case, data, method)
    checks.append(_agreement(case, data))
    notes = []
    if data.get("larger"):
        larger = data["larger"]
        _, line, values = _at_extrema(case, data, larger["M2"])
        what = f"M2 near the first {len(line)} extrema, {LABEL[AR]}, N = {larger['particles']}"
        checks.append(worst(what, mean_sigmas(values, line)))
        notes = [
            f"Small systems leave the first maximum late, and at very different times: at N = "
            f"{data['particles']} M2 near the minimum says little, and its check passes for the "
            f"scatter of the runs. {len(values)} runs at N = {larger['particles']} show what "
            "becomes of that with N."
        ]
    found = data["runs"]
    long, early = (len(found[AR][name]) for name in ("long", "early"))
    until = len(found[AR]["early"][0])
    more = f" and {early - long} more to t = {until}" if early > long else ""
    collisions = ", ".join(f"{found[m]['collisions']:.0f} ({LABEL[m]})" for m in METHODS)
    return Outcome(
        ran=f"a = {case.a}, shattering {case.shattering}, monomers, over the solver: each method "
        f"at N = {data['particles']} with doubling, {long} runs to t = {data['times'][-1]:g}"
        f"{more}.",
        checks=checks,
        tables=_tables(case, data),
        notes=[
            f"Collisions per initial particle: {collisions}. The solver kept {data['window']} "
            f"sizes; its largest mass error is {data['mass_error']:.1e}.",
            "Runs drift out of phase with the rate equations as time goes on: finite systems "
            "have phase noise. Heights are therefore compared at the first extrema, periods and "
            "swings later, run by run. Even there the mean over runs tends to a lower maximum and "
            "a higher minimum than the rate equations have.",
            *notes,
            "The paper does not say how many particles its figure has.",
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
