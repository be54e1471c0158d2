"""Tables 4.1 and 4.2: what a sample costs."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from smolux.plotting.style import new_figure, styled, use_log
from verification.outcome import Check, Item, Outcome, Table

from .common import (
    KERNEL_NAME,
    LOOK,
    QUICK,
    cost,
    count,
    measure,
    target,
    within,
)

#: simulated particles of a cell, all replicas together
_PARTICLES = 1e6
_ROUNDS = 3


def compute(name: str, quick: bool) -> dict[str, Any]:
    table = target(name)
    algorithms = [a for a in table["columns"][1:] if not quick or a in QUICK]
    sizes = [row["N"] for row in table["rows"]][: 3 if quick else None]
    most = _PARTICLES / (30 if quick else 1)
    return {
        "cells": {
            algorithm: {
                n: measure(
                    table["kernel"], algorithm, ["number_density"], [table["time"]], n,
                    max(int(most / n), 30), rounds=_ROUNDS,
                )
                for n in sizes
            }
            for algorithm in algorithms
        }
    }  # fmt: skip


def _costs(data: dict[str, Any]) -> dict[str, dict[int, float]]:
    return {
        algorithm: {int(n): cost(found) for n, found in by_size.items()}
        for algorithm, by_size in data["cells"].items()
    }


def _slope(by_size: dict[int, float], least: int) -> float:
    """Exponent of the cost in N, from `least` particles on."""
    n = np.array([k for k in by_size if k >= least], float)
    seconds = np.array([by_size[int(k)] for k in n])
    return float(np.polyfit(np.log(n), np.log(seconds), 1)[0])


def _checks(name: str, data: dict[str, Any]) -> list[Check]:
    costs, paper = _costs(data), {row["N"]: row for row in target(name)["rows"]}
    sizes = sorted(costs["MMF"])
    if len(sizes) < 5:
        return []
    checks = []
    # acceptance-rejection with a kernel that grows is dearer the larger the largest size
    linear = list(costs) if name == "table4_1" else ["MFA", "WA q=0.5"]
    for algorithm in linear:
        slope = _slope(costs[algorithm], 256)
        checks.append(
            Check(
                f"exponent of the cost in N from 256 on, {algorithm}",
                f"{slope:.2f}",
                "1" if algorithm != "MFA" else f"1 (the paper's: {_paper_slope(paper):.2f})",
                "≤ 1.15 (less by the fixed cost of a replica, or by another method)",
                bool(slope <= 1.15),
            )
        )
    for algorithm in (a for a in costs if a not in ("MMF", "MMF doubling", "WA q=0.5")):
        dearer = [
            (paper[n][algorithm] / paper[n]["MMF"]) / (costs[algorithm][n] / costs["MMF"][n])
            for n in sizes
            if n >= 1024
        ]
        checks.append(
            within(f"cost over MMF, the paper's divided by ours, N ≥ 1024, {algorithm}",
                   dearer, 1.0, np.inf, "(not dearer here than there)")
        )  # fmt: skip
    return checks


def _paper_slope(paper: dict[int, Any]) -> float:
    return _slope({n: row["MFA"] for n, row in paper.items()}, 256)


def _table(name: str, data: dict[str, Any]) -> Table:
    costs, rows = _costs(data), []
    for row in target(name)["rows"]:
        n = row["N"]
        if n not in costs["MMF"]:
            continue
        cells = [count(n)]
        for algorithm, by_size in costs.items():
            ratio = by_size[n] / costs["MMF"][n]
            printed = row[algorithm] / row["MMF"]
            text = f"{1e6 * by_size[n]:.3g}"
            if algorithm != "MMF":
                other = "–" if np.isnan(printed) else f"{printed:.3g}"
                text += f"; {ratio:.2g} ({other})"
            else:
                text += f" ({1e6 * row['MMF']:.3g})"
            cells.append(text)
        rows.append(cells)
    return Table(
        "Processor time of one sample in µs (MMF: the paper's); then over that of MMF (the same "
        "of the paper)",
        ["N", *costs],
        rows,
    )


def _events(data: dict[str, Any]) -> Table:
    found = data["cells"]
    n = max(map(int, found["MMF"]))
    rows = [
        [
            algorithm, by_size[str(n)]["method"], f"{by_size[str(n)]['collisions']:.2f}",
            f"{1e9 * cost(by_size[str(n)]) / n / by_size[str(n)]['collisions']:.0f}",
        ]
        for algorithm, by_size in found.items()
    ]  # fmt: skip
    return Table(
        f"N = {count(n)}: what the cost is made of",
        ["algorithm", "method", "collisions for each particle", "ns a collision"],
        rows,
    )


@styled
def _figure(name: str, data: dict[str, Any]) -> Any:
    costs, paper = _costs(data), target(name)["rows"]
    figure = new_figure("double", 0.4)
    ours, ratio = figure.subplots(1, 2)
    for algorithm, by_size in costs.items():
        look = LOOK[algorithm]
        n = np.array(sorted(by_size))
        ours.plot(n, [1e6 * by_size[k] for k in n], **look)
        theirs = {r["N"]: r[algorithm] / r["MMF"] for r in paper if r["N"] in by_size}
        if algorithm != "MMF":
            ratio.plot(n, [by_size[k] / costs["MMF"][k] for k in n], **look)
            ratio.plot(n, [theirs[k] for k in n], mfc="white", ls=":",
                       **{k: v for k, v in look.items() if k != "label"})  # fmt: skip
    for ax in (ours, ratio):
        use_log(ax, "x")
        use_log(ax, "y")
        ax.set_xlabel("particles $N$")
    ours.set_ylabel("processor time of a sample (µs)")
    ratio.set_ylabel("time over that of MMF")
    figure.legend(*ours.get_legend_handles_labels(), loc="outside upper center", ncols=6)
    return figure


def present(name: str, data: dict[str, Any]) -> Outcome:
    table = target(name)
    kernel = KERNEL_NAME[table["kernel"]].capitalize()
    return Outcome(
        ran=f"{kernel} to t = {table['time']:g}, the algorithms and N of the paper; the median of "
        "three ensembles of each.",
        checks=_checks(name, data),
        tables=[_table(name, data), _events(data)],
        notes=_NOTES,
        figure=_figure(name, data),
        caption=(
            "Left: processor time of a sample. Right: over that of MMF; open, dotted: the paper."
        ),
    )


_NOTES = [
    "MMF is acceptance-rejection here as there. For MFA and WA the paper draws pairs by sums over "
    "all particles or by acceptance-rejection; here the method is chosen by an estimate of its "
    "cost, whatever the weighting.",
    "MMF itself gains from this implementation as much as WA with q = 0.5 does: their ratio is "
    "about that of the paper. MFA and WA with larger q gain more.",
    "What is left of the ratio is mostly collisions: mass flow keeps all its particles to the end, "
    "where MMF has lost nine of ten.",
]


def _item(name: str, title: str) -> Item:
    return Item(name, title, partial(compute, name), partial(present, name))


ITEMS = (
    _item("table4_1", "Table 4.1: cost of a sample, constant kernel"),
    _item("table4_2", "Table 4.2: cost of a sample, additive kernel"),
)
