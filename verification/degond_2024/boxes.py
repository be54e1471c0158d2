"""Figures 10, 16 and 17: boxes that hold a centre, by their side."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from smolux.plotting.style import PALETTE, new_figure, styled, use_log
from verification.outcome import Check, Item, Outcome, Table, at_most

from . import ensemble
from .common import EVENTS, METHODS, NAME
from .ensemble import values

#: volume fractions of each figure
SHOWN = {"figure10": (0.1,), "figure16": (0.05, 0.2), "figure17": (0.3, 0.5)}
#: drawn beside the exact motion
_STEPS = "steps 0.2"
#: boxes that are compared at least
_SOME = 10


def compute(name: str, quick: bool) -> dict[str, Any]:
    data = ensemble.select(quick, "sides", "boxes", "boxes_sd")
    wanted = [f for f in SHOWN[name] if f in data["fractions"]] or list(data["fractions"])
    data["fractions"] = wanted
    data["cells"] = {m: {f"{f:g}": by[f"{f:g}"] for f in wanted} for m, by in data["cells"].items()}
    return data


def _pair(data: dict[str, Any], method: str, fraction: float, n: int, name: str = "boxes") -> Any:
    """Both methods at the sides that both have, where both plateaus are cut: 1 < n < N."""
    a = values(data, EVENTS, fraction, n, "boxes")
    b = values(data, method, fraction, n, "boxes")
    m = min(len(a), len(b))
    used = (a[:m] > 1) & (a[:m] < n) & (b[:m] > 1)
    side = values(data, EVENTS, fraction, n, "sides")[:m][used]
    return side, *(values(data, x, fraction, n, name)[:m][used] for x in (EVENTS, method))


def _apart(data: dict[str, Any], method: str, fraction: float, n: int) -> float:
    """Relative difference of the mean numbers of boxes, rms over sides, without what is noise."""
    _, a, b = _pair(data, method, fraction, n)
    _, s, t = _pair(data, method, fraction, n, "boxes_sd")
    runs = dict(zip(data["sizes"], data["seeds"], strict=True))[n]
    square = (b / a - 1) ** 2 - ((s / a) ** 2 + (t / b) ** 2) / runs
    # of few boxes one more or less is much
    return float(np.sqrt(max(np.mean(square[a >= _SOME]), 0.0)))


def _checks(data: dict[str, Any]) -> list[Check]:
    large = [n for n in data["sizes"] if n >= 400]
    checks = []
    for method, limit in (("steps 0.5", 0.05), ("steps 0.2", 0.03)):
        found = [_apart(data, method, f, n) for f in data["fractions"] for n in large]
        checks.append(
            at_most(
                f"{NAME[method]} and event-driven: numbers of boxes, relative difference, rms "
                "over sides of ten boxes or more, less noise, largest over fractions and N ≥ 400",
                max(found), limit,
                '("almost superimposed" in the paper)',
            )
        )  # fmt: skip
    falling = all(
        bool((np.diff(values(data, m, f, n, "boxes")) >= 0).all())
        for m in METHODS
        for f in data["fractions"]
        for n in data["sizes"]
    )
    checks.append(
        Check(
            "numbers of boxes fall with their side", "all" if falling else "not all", "all",
            "every method, fraction and N", falling,
        )
    )  # fmt: skip
    return checks


@styled
def _figure(data: dict[str, Any]) -> Any:
    fractions = data["fractions"]
    sizes = data["sizes"][-4:]
    figure = new_figure("double", 0.34 if len(fractions) == 1 else 0.58)
    grid = figure.subplots(len(fractions), len(sizes), sharex=True, sharey=True, squeeze=False)
    for row, fraction in zip(grid, fractions, strict=True):
        for ax, n in zip(row, sizes, strict=True):
            use_log(ax, "x")
            use_log(ax, "y")
            side, a, b = _pair(data, _STEPS, fraction, n)
            _, sd, _ = _pair(data, _STEPS, fraction, n, "boxes_sd")
            ax.plot(side, a, color="black", label="event-driven")
            ax.fill_between(side, a - sd, a + sd, color="0.8", lw=0, label="standard deviation")
            ax.plot(side, b, color=PALETTE[1], ls="none", marker="o", mfc="white", ms=3,
                    label="steps of $0.2\\,R$")  # fmt: skip
            ax.text(0.95, 0.93, rf"$N = {n}$" + "\n" + rf"$\phi = {fraction:g}$", ha="right",
                    va="top", transform=ax.transAxes, fontsize=7)  # fmt: skip
        row[0].set_ylabel("boxes with a centre $n$")
    for ax in grid[-1]:
        ax.set_xlabel("side of boxes $l / L$")
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure


def present(data: dict[str, Any]) -> Outcome:
    rows = [
        [f"{f:g}", NAME[m], *(f"{100 * _apart(data, m, f, n):.2f} %" for n in data["sizes"])]
        for f in data["fractions"]
        for m in METHODS[1:]
    ]
    head = ["φ", "method", *(f"N = {n}" for n in data["sizes"])]
    return Outcome(
        ran=ensemble.ran(data),
        checks=_checks(data),
        tables=[
            Table(
                "Numbers of boxes against those of the exact motion: relative difference of "
                "the means, rms over sides less noise",
                head,
                rows,
            )
        ],
        notes=["Shown where 1 < n < N, as in the paper: both plateaus are cut."],
        figure=_figure(data),
        caption="Boxes that hold a centre of the final cluster against their side: mean over "
        "seeds, shaded with the standard deviation of the event-driven runs.",
    )


ITEMS = tuple(
    Item(name, f"Figure {name[6:]}: counting boxes", partial(compute, name), present)
    for name in SHOWN
)
