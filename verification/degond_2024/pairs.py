"""Figures 8 and 15: the pair distribution in the final cluster."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from matplotlib.lines import Line2D

from smolux.plotting.style import GREY, PALETTE, new_figure, styled, use_linear
from verification.outcome import Check, Item, Outcome, Table, at_most, worst

from . import ensemble
from .common import COLOUR, EVENTS, LABEL, METHODS, NAME, against_known, target
from .ensemble import WITHIN, values

#: volume fractions of the two figures
SHOWN = {"figure8": (0.1, 0.3), "figure15": (0.05, 0.2, 0.5)}
#: time steps that are drawn
_STEPS = ("steps 0.5", "steps 0.2")


def compute(name: str, quick: bool) -> dict[str, Any]:
    data = ensemble.select(quick, "r", "neighbours", "neighbours_sd", "g", "g_sd", "within")
    wanted = [f for f in SHOWN[name] if f in data["fractions"]]
    if not wanted:  # a smoke test has other ones
        wanted = list(data["fractions"])
    data["fractions"] = wanted
    data["cells"] = {m: {f"{f:g}": by[f"{f:g}"] for f in wanted} for m, by in data["cells"].items()}
    return data


def _ratio(data: dict[str, Any], method: str, fraction: float, discs: int) -> np.ndarray:
    """Neighbours at each distance over those of the exact motion."""
    name = "neighbours"
    return values(data, method, fraction, discs, name) / values(data, EVENTS, fraction, discs, name)


def _noise(data: dict[str, Any], method: str, fraction: float, discs: int) -> np.ndarray:
    """Return the standard error of that ratio."""
    runs = dict(zip(data["sizes"], data["seeds"], strict=True))[discs]
    parts = [
        values(data, m, fraction, discs, "neighbours_sd")
        / values(data, m, fraction, discs, "neighbours")
        for m in (method, EVENTS)
    ]
    return np.sqrt((parts[0] ** 2 + parts[1] ** 2) / runs)


def _rms(data: dict[str, Any], method: str, fraction: float, discs: int) -> float:
    """Root mean square over distances of the relative difference, without what is noise."""
    ratio, noise = (f(data, method, fraction, discs) for f in (_ratio, _noise))
    return float(np.sqrt(max(np.mean((ratio - 1) ** 2 - noise**2), 0.0)))


def _scatter(data: dict[str, Any], method: str, fraction: float, discs: int) -> float:
    """Relative standard deviation over runs, mean over distances."""
    sd = values(data, method, fraction, discs, "neighbours_sd")
    return float(np.mean(sd / values(data, method, fraction, discs, "neighbours")))


def _checks(data: dict[str, Any]) -> list[Check]:
    fractions, sizes, last = data["fractions"], data["sizes"], data["sizes"][-1]
    checks = []
    for method, limit in (("steps 0.5", 0.05), ("steps 0.2", 0.03)):
        found = [_rms(data, method, f, last) for f in fractions]
        checks.append(
            at_most(
                f"{NAME[method]}: relative difference from event-driven, rms over distances, "
                f"N = {last}, largest over fractions", max(found), limit,
                '("excellent agreement" in the paper)',
            )
        )  # fmt: skip
    scatter = np.array(
        [[_scatter(data, m, f, n) for n in sizes] for m in METHODS for f in fractions]
    )
    first = ", ".join(f"{x:.3f}" for x in scatter.mean(0))
    checks.append(
        Check(
            f"scatter over seeds falls with N = {', '.join(map(str, sizes))} (mean over distances, "
            "fractions and methods)", first, "falling", "falling for every fraction and method",
            bool((np.diff(scatter, axis=1) < 0).all()),
        )
    )  # fmt: skip
    inner = slice(0, 20)  # to three diameters
    dense = [
        float(np.mean(_ratio(data, "steps 0.5", f, n)[inner]) - 1)
        for f in fractions
        for n in sizes
        if n >= 2500
    ]
    if dense:
        checks.append(
            Check(
                "time stepping is slightly denser: neighbours from 1.02 to 3 diameters over "
                "event-driven, steps of 0.5 R, N ≥ 2500",
                f"{100 * min(dense):.1f} to {100 * max(dense):.1f} %, mean "
                f"{100 * np.mean(dense):.2f} %", "above 0 (the paper)", "mean > 0",
                bool(np.mean(dense) > 0),
            )
        )  # fmt: skip
    return checks + _known(data)


def _known(data: dict[str, Any]) -> list[Check]:
    table, scores = target("methods"), []
    for row in table["rows"]:
        if row["rigid"] or row["method"] not in METHODS or row["phi"] not in data["fractions"]:
            continue
        if 2500 not in data["sizes"]:
            continue
        found = values(data, row["method"], row["phi"], 2500, "within")
        for k, reach in enumerate(WITHIN):
            known = row[f"within{reach:g}"]
            rounding = 0.005 if known < 10 else 0.05
            scores.append(against_known(found[:, k], known, table["runs"], rounding))
    if not scores:
        return []
    what = "neighbours within 1.5, 2, 3 and 5 diameters, N = 2500, as computed independently"
    return [worst(what, scores)]


def _table(data: dict[str, Any]) -> Table:
    last = data["sizes"][-1]
    rows = []
    for f in data["fractions"]:
        for m in METHODS:
            found = values(data, m, f, last, "within")
            cells = [
                f"{x:.3g} ± {s:.1g}"
                for x, s in zip(found.mean(0), found.std(0, ddof=1), strict=True)
            ]
            apart = "" if m == EVENTS else f"{100 * _rms(data, m, f, last):.2f} %"
            scatter = " ".join(f"{_scatter(data, m, f, n):.3f}" for n in data["sizes"])
            rows.append([f"{f:g}", NAME[m], *cells, apart, scatter])
    head = [
        "φ", "method", *(f"within {w:g}" for w in WITHIN), "rms difference",
        "scatter over seeds by N",
    ]  # fmt: skip
    return Table(
        f"Neighbours of a disc within so many diameters, N = {last}: mean and standard deviation",
        head, rows,
    )  # fmt: skip


@styled
def _figure(data: dict[str, Any]) -> Any:
    fractions, sizes = data["fractions"], data["sizes"]
    figure = new_figure("double", 0.6)
    grid = figure.subplots(2, len(fractions), sharex=True, height_ratios=(1.6, 1), squeeze=False)
    for ax in grid[1, 1:]:
        ax.sharey(grid[1, 0])
    for column, fraction in enumerate(fractions):
        top, bottom = grid[:, column]
        for k, n in enumerate(sizes):
            r = values(data, EVENTS, fraction, n, "r")
            g = values(data, EVENTS, fraction, n, "g")
            sd = values(data, EVENTS, fraction, n, "g_sd")
            top.plot(r, g, color=PALETTE[k], lw=0.9)
            top.fill_between(r, g - sd, g + sd, color=PALETTE[k], alpha=0.15, lw=0)
            every = slice(2 * k % 5, None, 6)
            top.plot(
                r[every], values(data, _STEPS[1], fraction, n, "g")[every], color=PALETTE[k],
                ls="none", marker="o", mfc="white", ms=2.6, mew=0.6,
            )  # fmt: skip
        top.set_title(rf"$\phi = {fraction:g}$", pad=3)
        n = sizes[-1]
        for method in _STEPS:
            ratio, noise = (f(data, method, fraction, n) for f in (_ratio, _noise))
            r = values(data, method, fraction, n, "r")
            bottom.plot(r, ratio, color=COLOUR[method], lw=0.9)
            bottom.fill_between(
                r, ratio - 2 * noise, ratio + 2 * noise, color=COLOUR[method], alpha=0.2, lw=0
            )
        bottom.axhline(1, color=GREY, lw=0.6, ls=":")
        bottom.set_xlabel("distance $r$ / diameter")
        bottom.set_xlim(1, 10)
        for ax in (top, bottom):
            use_linear(ax, "x")
            use_linear(ax, "y")
    grid[0, 0].set_ylabel("pair distribution $g$")
    for ax in grid[0]:
        ax.set_ylim(bottom=0)
    grid[1, 0].set_ylabel(f"time steps / events,\n$N = {sizes[-1]}$")
    handles = [Line2D([], [], color=PALETTE[k], label=f"$N = {n}$") for k, n in enumerate(sizes)]
    handles += [
        Line2D(
            [],
            [],
            color="black",
            marker="o",
            mfc="white",
            ls="none",
            ms=2.6,
            label=LABEL[_STEPS[1]],
        )
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=6)
    ratios = [Line2D([], [], color=COLOUR[m], label=LABEL[m]) for m in _STEPS]
    grid[1, -1].legend(handles=ratios, loc="upper right", ncols=2, fontsize=6)
    return figure


def present(data: dict[str, Any]) -> Outcome:
    return Outcome(
        ran=ensemble.ran(data),
        checks=_checks(data),
        tables=[_table(data)],
        notes=[
            "Shown is g, the number of neighbours (4.14) over that of independent uniform discs "
            "between the same walls, so that all sizes can be drawn together; the table and the "
            "checks are of the numbers of neighbours.",
            "Distances are in diameters; the paper's are in radii. They start at 1.02 diameters, "
            "so that contacts are left out.",
        ],
        figure=_figure(data),
        caption="Above: pair distribution in the final cluster, event-driven (lines, shaded: "
        "standard deviation over seeds) and with steps of 0.2 R (circles). Below: neighbours of "
        "time stepping over those of the exact motion, with two standard errors.",
    )


ITEMS = tuple(
    Item(name, f"Figure {name[6:]}: pair distribution", partial(compute, name), present)
    for name in SHOWN
)
