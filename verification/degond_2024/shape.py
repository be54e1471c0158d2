"""Figures 13 and 14: aspect ratio and orientation of the final cluster."""

from __future__ import annotations

from typing import Any

import numpy as np

from smolux.plotting.style import GREY, new_figure, styled, use_linear, use_log
from verification.outcome import Check, Item, Outcome, Table, at_most, worst

from . import ensemble
from .common import (
    COLOUR,
    EVENTS,
    LABEL,
    METHODS,
    NAME,
    against_known,
    difference,
    draw_over_sizes,
    rayleigh,
    spread,
    target,
)
from .ensemble import values

_SHOWN = (EVENTS, METHODS[1], METHODS[2])


def compute_aspect(quick: bool) -> dict[str, Any]:
    return ensemble.select(quick, "aspect")


def compute_orientation(quick: bool) -> dict[str, Any]:
    return ensemble.select(quick, "orientation")


def _aspect_checks(data: dict[str, Any]) -> list[Check]:
    fractions, sizes = data["fractions"], data["sizes"]

    def of(method: str, fraction: float, discs: int) -> np.ndarray:
        return values(data, method, fraction, discs, "aspect")

    pooled = {
        m: [np.mean([of(m, f, n).std(ddof=1) for f in fractions]) for n in sizes] for m in METHODS
    }
    by_fraction = {
        m: [np.mean([of(m, f, n).mean() for n in sizes]) for f in fractions] for m in METHODS
    }
    scores = [
        difference(of(m, f, n), of(EVENTS, f, n))
        for m in METHODS[1:]
        for f in fractions
        for n in sizes
    ]
    table, known = target("aspect"), []
    for row in table["rows"]:
        for n, runs in zip(table["columns"][1:], table["runs"], strict=True):
            if row["phi"] in fractions and int(n) in sizes:
                known.append(against_known(of(EVENTS, row["phi"], int(n)), row[n], runs, 0.005))
    # a standard deviation of n runs has a relative error of 1 / sqrt(2 n - 2)
    error = 1 / np.sqrt(2 * np.array(data["seeds"]) - 2) / np.sqrt(len(fractions))
    rise = max(
        float((np.diff(np.log(x)) / np.hypot(error[1:], error[:-1])).max()) for x in pooled.values()
    )
    checks = [
        Check(
            f"scatter over seeds falls with N = {', '.join(map(str, sizes))} (event-driven; mean "
            "over fractions)", ", ".join(f"{x:.3f}" for x in pooled[EVENTS]), "falling (the paper)",
            f"no rise beyond 3 σ (largest: {rise:.1f}), the last below half of the first, every "
            "method", rise <= 3 and all(x[-1] < x[0] / 2 for x in pooled.values()),
        ),
        Check(
            f"aspect ratio falls with φ = {', '.join(f'{f:g}' for f in fractions)} (event-driven; "
            "mean over N)", ", ".join(f"{x:.3f}" for x in by_fraction[EVENTS]),
            "falling (the paper)", "falling for every method",
            all(np.diff(x).max() < 0 for x in by_fraction.values()),
        ),
        worst("time stepping and event-driven: aspect ratio, each method, fraction and N", scores),
        worst("event-driven: aspect ratio as computed independently", known),
    ]  # fmt: skip
    last = of(EVENTS, fractions[-1], sizes[-1]).mean()
    if sizes[-1] >= 10_000:
        checks.append(
            at_most(
                f"the cluster tends to the square of the box: aspect ratio less 1, φ = "
                f"{fractions[-1]:g}, N = {sizes[-1]}", float(last - 1), 0.02, "(the paper's words)",
            )
        )  # fmt: skip
    return checks


@styled
def _aspect_figure(data: dict[str, Any]) -> Any:
    figure = new_figure("double", 0.36)
    panels = figure.subplots(1, 3, sharey=True)
    for ax, method in zip(panels, _SHOWN, strict=True):
        use_log(ax, "x")
        use_linear(ax, "y")
        draw_over_sizes(
            ax, lambda f, n, m=method: values(data, m, f, n, "aspect"), data["fractions"],
            data["sizes"],
        )  # fmt: skip
        ax.axhline(1, color=GREY, lw=0.6, ls=":")
        ax.set_title(LABEL[method], pad=3)
    panels[0].set_ylabel(r"aspect ratio $\sqrt{\lambda_1 / \lambda_2}$")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=5)
    return figure


def present_aspect(data: dict[str, Any]) -> Outcome:
    rows = [
        [NAME[m], f"{f:g}", *(spread(values(data, m, f, n, "aspect")) for n in data["sizes"])]
        for m in METHODS
        for f in data["fractions"]
    ]
    head = ["method", "φ", *(f"N = {n}" for n in data["sizes"])]
    return Outcome(
        ran=ensemble.ran(data),
        checks=_aspect_checks(data),
        tables=[Table("Aspect ratio (4.11): mean and standard deviation over seeds", head, rows)],
        notes=[
            "The aspect ratio is the root of the ratio of the eigenvalues of the gyration tensor.",
        ],
        figure=_aspect_figure(data),
        caption="Aspect ratio of the final cluster against the number of discs: mean and standard "
        "deviation over seeds.",
    )


def _angles(data: dict[str, Any], method: str, *, size: int | None = None) -> np.ndarray:
    """Orientations of all runs of a method, or of those of one size."""
    return np.concatenate([
        values(data, method, f, n, "orientation")
        for f in data["fractions"]
        for n in data["sizes"]
        if size in (None, n)
    ])  # fmt: skip


def _orientation_checks(data: dict[str, Any]) -> list[Check]:
    checks = []
    for method in METHODS:
        found, chance = rayleigh(_angles(data, method), 2)
        # exp(-n r^2) is the chance of so long a resultant: one in 10^4
        limit = chance * np.sqrt(np.log(1e-4) / np.log(0.05))
        checks.append(
            at_most(
                f"{NAME[method]}: no direction is preferred, mean resultant of the doubled angle",
                found, round(float(limit), 4), "(exceeded by chance once in 10⁴)",
            )
        )  # fmt: skip
    return checks


@styled
def _orientation_figure(data: dict[str, Any]) -> Any:
    figure = new_figure("double", 0.4)
    panels = figure.subplots(1, 3, width_ratios=(1, 1, 1))
    sizes, shift = data["sizes"], np.random.default_rng(1)
    for ax, method in zip(panels[:2], (EVENTS, _SHOWN[-1]), strict=True):
        use_log(ax, "x")
        for n in sizes:
            y = _angles(data, method, size=n)
            x = n * np.exp(shift.uniform(-0.3, 0.3, len(y)))
            ax.plot(x, y / np.pi, ls="none", marker=".", ms=1.6, mew=0, color=COLOUR[method])
        ax.set(xlabel="discs $N$", ylim=(0, 1), title=LABEL[method])
        use_linear(ax, "y")
    panels[0].set_ylabel(r"orientation $\theta / \pi$")
    ax = panels[2]
    for method in METHODS:
        y = np.sort(_angles(data, method)) / np.pi
        ax.step(y, np.arange(1, len(y) + 1) / len(y), color=COLOUR[method], lw=0.8,
                label=LABEL[method])  # fmt: skip
    ax.plot([0, 1], [0, 1], color=GREY, lw=0.7, ls=":", label="uniform")
    ax.set(xlabel=r"orientation $\theta / \pi$", ylabel="share of runs below", xlim=(0, 1),
           ylim=(0, 1))  # fmt: skip
    use_linear(ax, "x")
    use_linear(ax, "y")
    ax.legend(loc="upper left", fontsize=6)
    return figure


def present_orientation(data: dict[str, Any]) -> Outcome:
    rows = []
    for m in METHODS:
        angles = _angles(data, m)
        two, four = rayleigh(angles, 2), rayleigh(angles, 4)
        mean, sd = np.degrees(angles.mean()), np.degrees(angles.std(ddof=1))
        rows.append(
            [NAME[m], str(len(angles)), f"{mean:.1f} ± {sd:.1f}", f"{two[0]:.3f}", f"{four[0]:.3f}",
             f"{two[1]:.3f}"]
        )  # fmt: skip
    head = ["method", "runs", "θ in degrees", "resultant of 2θ", "of 4θ", "95 % by chance"]
    return Outcome(
        ran=ensemble.ran(data),
        checks=_orientation_checks(data),
        tables=[Table("Orientation of the first axis (4.12), all sizes and fractions", head, rows)],
        notes=[
            "By the symmetry of the square the mean of exp(2iθ) vanishes for every size and "
            "fraction; a uniform angle has a mean of 90 and a standard deviation of 52 degrees. "
            "The resultant of 4θ may differ from zero, as a square has four directions.",
        ],
        figure=_orientation_figure(data),
        caption="Orientation of the final cluster: each run, spread about its number of discs, "
        "and the distribution over all runs.",
    )


ITEMS = (
    Item("figure13", "Figure 13: aspect ratio", compute_aspect, present_aspect),
    Item("figure14", "Figure 14: orientation", compute_orientation, present_orientation),
)
