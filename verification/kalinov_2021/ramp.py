"""Figure 3(b): shattering that falls with time, so that damped oscillations grow again."""

from __future__ import annotations

from typing import Any

import numpy as np

import smolux as sx
from smolux.plotting.style import new_figure, styled, use_linear
from verification.outcome import Check, Item, Outcome, Table, at_most, mean_sigmas, worst

from .common import AR, LABEL, METHODS, brownian, curves, draw_first_runs, second_moments

RATE = "0.01 * (1 - t/400)"
_SAMPLES = (2.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0)
#: particles; runs to the end, and more of them to the last sample
PARTICLES, RUNS = 2_500, (4, 12)


def compute(quick: bool) -> dict[str, Any]:
    end, particles, runs = (10.0, 1000, (4, 0)) if quick else (200.0, PARTICLES, RUNS)
    physics = brownian(0.9, RATE, spread=True)
    times = np.arange(1.0, end + 0.5)
    fine = np.arange(0.5, end + 0.25, 0.5)
    line = sx.solve(physics, fine, orders=(2,), sizes=1, tolerance=1e-6 if quick else 1e-7)
    return {
        "times": times,
        "fine": fine,
        "line": line["moment"].values.ravel(),
        "runs": {
            method: second_moments(physics, times, particles, method, runs, _SAMPLES[-1])
            for method in METHODS
        },
        "particles": particles,
    }


@styled
def _figure(data: dict[str, Any]) -> Any:
    figure = new_figure("double", 0.36)
    ax = figure.subplots()
    ax.plot(
        data["fine"], data["line"], color="black", lw=0.9, label="rate equations (solver)", zorder=2
    )
    draw_first_runs(ax, data)
    ax.set(xlabel="time $t$", ylabel="$M_2$", xlim=(0, data["fine"][-1]), ylim=(0, None))
    use_linear(ax, "x")
    use_linear(ax, "y")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure


def present(data: dict[str, Any]) -> Outcome:
    reference = curves("figure3b")
    line = np.interp(reference["t"], data["fine"], data["line"])
    shared = reference["t"] <= data["fine"][-1]
    share = float(np.abs(line[shared] / reference["M2"][shared] - 1).max())
    checks = [
        at_most("solver: M2(t), largest relative difference from the reference", share, 3e-3,
                "(the reference is good to 1e-3)")
    ]  # fmt: skip
    samples = [t for t in _SAMPLES if t <= data["times"][-1]]
    index = [int(np.argmin(abs(np.asarray(data["times"]) - t))) for t in samples]
    expected = np.interp(samples, data["fine"], data["line"])
    rows, grown = [], []
    for method in METHODS:
        values = np.asarray(data["runs"][method]["early"])[:, index]
        scores = mean_sigmas(values, expected)
        checks.append(worst(f"M2 at t = 2 .. {samples[-1]:g}, {LABEL[method]}", scores))
        error = values.std(axis=0, ddof=1) / np.sqrt(len(values))
        rows += [
            [
                LABEL[method],
                f"{t:g}",
                f"{expected[k]:.1f}",
                f"{values.mean(0)[k]:.1f} ± {error[k]:.1f}",
            ]
            for k, t in enumerate(samples)
        ]
        if data["times"][-1] >= 200:
            grown.append(_growth(data, method))
    head = ["method", "t", "rate equations", "Monte Carlo"]
    long, early = (len(data["runs"][AR][name]) for name in ("long", "early"))
    return Outcome(
        ran="a = 0.9, shattering 0.01 (1 − t/400), n_k(0) = 0.1 for k = 1..10, over the solver: "
        f"each method at N = {data['particles']} with doubling, {long} runs to t = "
        f"{data['times'][-1]:g} and {early - long} more to t = {samples[-1]:g}.",
        checks=checks + grown,
        tables=[
            Table(f"M2, mean over {early} runs with one standard error", head, rows),
        ],
        notes=[
            "The shattering rate passes the Hopf threshold of a = 0.9, 0.00962, at t = 15; the "
            "oscillations grow from then on.",
            f"Runs drift out of phase: finite systems have phase noise. After t = {samples[-1]:g} "
            "they are not compared point by point, only by how far their oscillations swing.",
            "The paper does not say how many particles its figure has.",
        ],
        figure=_figure(data),
        caption=(
            "Second moment with a falling shattering rate: one run of each method over the "
            "rate equations."
        ),
    )


def _growth(data: dict[str, Any], method: str) -> Check:
    """Check in every run that M2 swings more at the end than after the first oscillations."""

    def grown(times: np.ndarray, m2: np.ndarray) -> np.ndarray:
        late, early = times > 150, (times > 30) & (times <= 80)
        return m2[..., late].std(axis=-1) / m2[..., early].std(axis=-1)

    line = float(grown(np.asarray(data["fine"]), np.asarray(data["line"])))
    found = grown(np.asarray(data["times"]), np.asarray(data["runs"][method]["long"]))
    return Check(
        f"oscillations grow in every run, {LABEL[method]}: standard deviation of M2 over "
        "t = 150 to 200, over that of t = 30 to 80",
        ", ".join(f"{x:.2f}" for x in found),
        f"{line:.2f} (rate equations)",
        "> 1 each",
        bool(found.min() > 1),
    )


ITEM = Item("figure3b", "Figure 3(b): falling shattering rate", compute, present)
