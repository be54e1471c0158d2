"""Figure 11: the dimension by boxes against the number of discs."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.lines import Line2D

from smolux.plotting.style import GREY, new_figure, styled, use_linear, use_log
from verification.outcome import Check, Item, Outcome, Table, at_most, worst

from . import ensemble
from .common import (
    EVENTS,
    LOOK,
    METHODS,
    NAME,
    against_known,
    difference,
    draw_over_sizes,
    spread,
    target,
)
from .ensemble import values

_SHORT = "steps 0.2"


def compute(quick: bool) -> dict[str, Any]:
    return ensemble.select(quick, "dimension")


def _of(data: dict[str, Any], method: str, fraction: float, discs: int) -> np.ndarray:
    return values(data, method, fraction, discs, "dimension")


def _error(data: dict[str, Any], method: str, fraction: float, discs: int) -> float:
    """Relative difference of the mean dimension from that of the exact motion."""
    return float(_of(data, method, fraction, discs).mean()
                 / _of(data, EVENTS, fraction, discs).mean() - 1)  # fmt: skip


def _checks(data: dict[str, Any]) -> list[Check]:
    fractions, sizes = data["fractions"], data["sizes"]
    checks = []
    for method in METHODS[1:]:
        errors = np.abs([[_error(data, method, f, n) for n in sizes] for f in fractions])
        checks.append(
            at_most(
                f"{NAME[method]}: relative difference of D from event-driven, mean over fractions "
                "and N", float(errors.mean()), 0.01, "(small in the paper)",
            )
        )  # fmt: skip
    scores = [
        difference(_of(data, _SHORT, f, n), _of(data, EVENTS, f, n))
        for f in fractions
        for n in sizes
    ]
    checks.append(worst("steps 0.2 R and event-driven: D, each fraction and N", scores))
    mean = np.array([[_of(data, EVENTS, f, n).mean() for n in sizes] for f in fractions])
    for axis, what in ((0, "the fraction"), (1, "N")):
        checks.append(
            Check(
                f"event-driven: D grows with {what}",
                f"{mean.min():.2f} to {mean.max():.2f}", "growing", "growing throughout",
                bool((np.diff(mean, axis=axis) > 0).all()),
            )
        )  # fmt: skip
    return checks + _known(data)


def _known(data: dict[str, Any]) -> list[Check]:
    table, scores = target("dimensions"), []
    for row in table["rows"]:
        for n, runs in zip(table["columns"][1:], table["runs"], strict=True):
            if row["phi"] in data["fractions"] and int(n) in data["sizes"]:
                found = _of(data, EVENTS, row["phi"], int(n))
                scores.append(against_known(found, row[n], runs, 0.005))
    checks = [worst("event-driven: D at each fraction and N, as computed independently", scores)]
    table, scores = target("methods"), []
    for row in table["rows"]:
        shown = row["method"] in METHODS and row["phi"] in data["fractions"]
        if shown and not row["rigid"] and 2500 in data["sizes"]:
            found = _of(data, row["method"], row["phi"], 2500)
            scores.append(against_known(found, row["dimension"], table["runs"], 0.0005))
    if scores:
        checks.append(worst("all methods, N = 2500: D, as computed independently", scores))
    return checks


@styled
def _figure(data: dict[str, Any]) -> Any:
    figure = new_figure("double", 0.42)
    left, right = figure.subplots(1, 2)
    draw_over_sizes(left, lambda f, n: _of(data, EVENTS, f, n), data["fractions"], data["sizes"])
    for k, f in enumerate(data["fractions"]):
        x = np.array(data["sizes"]) * 1.07 ** (k - (len(data["fractions"]) - 1) / 2)
        y = [_of(data, _SHORT, f, n).mean() for n in data["sizes"]]
        left.plot(x, y, ls="none", ms=5, mfc="none", mew=0.6, **LOOK[f])
    left.set_ylabel("dimension by boxes $D$")
    for row in target("dimensions")["rows"]:
        if row["phi"] in data["fractions"]:
            known = [(int(n), row[n]) for n in target("dimensions")["columns"][1:]]
            left.plot(*zip(*known, strict=True), ls="none", marker="x", color="black", ms=3.5,
                      mew=0.7, zorder=4)  # fmt: skip
    for f in data["fractions"]:
        for m, style in ((METHODS[1], "--"), (_SHORT, "-")):
            y = [100 * _error(data, m, f, n) for n in data["sizes"]]
            right.plot(data["sizes"], y, ls=style, lw=0.8, ms=3, **LOOK[f])
    right.axhline(0, color=GREY, lw=0.6, ls=":")
    right.set(xlabel="discs $N$", ylabel="$D$ over that of events, less 1 (%)")
    for ax in (left, right):
        use_log(ax, "x")
        use_linear(ax, "y")
    handles = [Line2D([], [], label=rf"$\phi = {f:g}$", **LOOK[f]) for f in data["fractions"]]
    grey = {"color": "0.3", "ls": "none"}
    handles += [
        Line2D([], [], marker="o", mfc="none", ms=5, mew=0.6, label="steps 0.2 $R$ (left)", **grey),
        Line2D([], [], marker="x", ms=3.5, label="known (left)", **grey),
        Line2D([], [], color="0.3", ls="-", label="steps 0.2 $R$ (right)"),
        Line2D([], [], color="0.3", ls="--", label="steps 0.5 $R$ (right)"),
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=5)
    return figure


def present(data: dict[str, Any]) -> Outcome:
    rows = [
        [NAME[m], f"{f:g}", *(spread(_of(data, m, f, n)) for n in data["sizes"])]
        for m in METHODS
        for f in data["fractions"]
    ]
    errors = {
        (f, n): abs(_error(data, m, f, n))
        for m in METHODS[1:]
        for f in data["fractions"]
        for n in data["sizes"]
    }
    (phi, discs), largest = max(errors.items(), key=lambda item: item[1])
    return Outcome(
        ran=ensemble.ran(data),
        checks=_checks(data),
        tables=[
            Table(
                "Dimension by boxes (L / 2^(k/4), fitted where 4 < n < N/2): mean and standard "
                "deviation over seeds",
                ["method", "φ", *(f"N = {n}" for n in data["sizes"])],
                rows,
            )
        ],
        notes=[
            "The paper finds the largest relative error in the rarefied case; here the largest "
            f"is {100 * largest:.1f} %, at φ = {phi:g} and N = {discs}.",
            "The number is that of one cluster which fills its box, between a fractal and a "
            "plane; it grows with N and is no property of small clusters. For those there "
            "is the dimension by mass.",
        ],
        figure=_figure(data),
        caption="Left: dimension by boxes of the final cluster, event-driven, mean and standard "
        "deviation over seeds; circles: steps of 0.2 R; crosses: computed independently. Right: "
        "relative difference of time stepping.",
    )


ITEM = Item("figure11", "Figure 11: dimension by boxes", compute, present)
