"""Where the oscillations of Figure 2 set in: the Hopf thresholds of the shattering rate."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

import smolux as sx
from smolux.plotting.style import PALETTE, new_figure, styled, use_linear
from verification.outcome import Item, Outcome, Table, at_most

from .common import curves

EXPONENTS = (0.8, 0.85, 0.9, 0.925, 0.95, 0.98, 1.0)
#: a, shattering rate, whether it oscillates: the cases of Figures 2 and 3
CASES = ((0.95, 0.01, True), (0.98, 0.005, True), (0.95, 0.005, True), (0.9, 0.01, False))


def compute(quick: bool) -> dict[str, Any]:
    from smolux.deterministic import hopf_threshold

    found = []
    for a in (0.95, 1.0) if quick else EXPONENTS:
        start = time.process_time()
        threshold = hopf_threshold(sx.kernels.GeneralizedBrownian(a))
        seconds = time.process_time() - start
        found.append([a, threshold.rate, threshold.period, len(threshold.state.n), seconds])
    return {"thresholds": found}


@styled
def _figure(data: dict[str, Any]) -> Any:
    figure = new_figure("single", 0.8)
    ax = figure.subplots()
    a, rate = np.array(data["thresholds"])[:, :2].T
    reference = curves("hopf_thresholds")
    ax.fill_between(a, 0, rate, color=PALETTE[4], alpha=0.2, lw=0)
    ax.plot(a, rate, color=PALETTE[0], marker="o", label=r"threshold $\lambda_c(a)$")
    ax.plot(
        reference["a"],
        reference["lambda_c"],
        color="black",
        marker="D",
        mfc="none",
        ms=5,
        ls="none",
        label="reference",
    )
    for lasting, marker, text in (
        (True, "^", "oscillates (Fig. 2, 3a)"),
        (False, "v", "start of Fig. 3b"),
    ):
        points = [(x, y) for x, y, z in CASES if z is lasting]
        ax.plot(
            *zip(*points, strict=True), color=PALETTE[1], marker=marker, ms=4, ls="none", label=text
        )
    ax.text(0.94, 0.003, "steady oscillations", ha="center", fontsize=7)
    ax.text(0.86, 0.0135, "stable steady state", ha="center", fontsize=7)
    ax.set(
        xlabel="exponent $a$",
        ylabel=r"shattering rate $\lambda$",
        ylim=(0, 0.0175),
        xlim=(0.79, 1.01),
    )
    use_linear(ax, "x")
    use_linear(ax, "y")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def present(data: dict[str, Any]) -> Outcome:
    reference = {row["a"]: row for row in curves("hopf_thresholds")}
    checks, rows = [], []
    for a, rate, period, sizes, seconds in data["thresholds"]:
        known = reference.get(a)
        cells = [f"{a:g}", f"{rate:.7f}", "–", f"{period:.4f}", "–", str(sizes), f"{seconds:.1f}"]
        if known is not None:
            cells[2] = f"{known['lambda_c']:.6f} ± {known['uncertainty']:.0e}"
            onset = known["period_at_onset_M11"]
            cells[4] = f"{onset:g}"
            # the reference is rounded to 1e-6, and its window shifts it by up to 4e-6
            limit = 2 * float(known["uncertainty"]) + 4e-6
            checks.append(
                at_most(
                    f"threshold at a = {a:g}, difference", abs(rate - known["lambda_c"]), limit, ""
                )
            )
            room = 2e-3 if a > 0.85 else 5e-3
            checks.append(
                at_most(
                    f"period at the onset, a = {a:g}, relative difference",
                    abs(period / onset - 1),
                    room,
                    "",
                )
            )
        rows.append(cells)
    head = ["a", "threshold", "reference", "period at onset", "reference", "sizes", "seconds"]
    return Outcome(
        ran=(
            f"Steady states and their leading eigenvalues at {len(rows)} exponents a, by the "
            "solver."
        ),
        checks=checks,
        tables=[
            Table(
                "Shattering rate at the Hopf bifurcation, and period there, for unit mass",
                head,
                rows,
            )
        ],
        notes=[
            "The thresholds agree with what the paper simulates: (0.95, 0.01) and (0.98, 0.005) "
            "oscillate, "
            "(0.9, 0.01) decays, and the ramp of Figure 3(b) passes the threshold of a = 0.9.",
        ],
        figure=_figure(data),
        caption="Below the curve the steady state is unstable and oscillations last.",
    )


ITEM = Item("hopf", "Hopf thresholds of the shattering rate", compute, present)
