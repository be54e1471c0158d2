"""The time to the final configuration."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import stats

from smolux.plotting.style import new_figure, styled, use_log
from verification.outcome import Check, Item, Outcome, Table, worst

from . import ensemble
from .common import EVENTS, LABEL, LOOK, METHODS, NAME, target
from .ensemble import values

#: of one cluster, and of one cluster for each hundred discs
NAMES = {"final": "one cluster", "hundredth": "$N/100$ clusters"}


def compute(quick: bool) -> dict[str, Any]:
    return ensemble.select(quick, *NAMES)


def ranks(a: np.ndarray, b: np.ndarray) -> float:
    """Difference of two samples by their ranks (Mann-Whitney), as a normal score."""
    test = stats.mannwhitneyu(a, b, alternative="greater")
    return float(stats.norm.isf(np.clip(test.pvalue, 1e-15, 1 - 1e-15)))


def _log_median(x: np.ndarray) -> tuple[float, float]:
    """Logarithm of the median, and its standard error from order statistics."""
    y = np.sort(np.log(x))
    half = 0.5 * np.sqrt(len(y))
    low, high = (np.interp(len(y) / 2 + s * half - 0.5, np.arange(len(y)), y) for s in (-1, 1))
    return float(np.median(y)), float(max(high - low, 1e-12) / 2)


def _checks(data: dict[str, Any]) -> list[Check]:
    fractions, sizes = data["fractions"], data["sizes"]
    checks = []
    for method in METHODS[1:]:
        scores = [
            ranks(values(data, method, f, n, name), values(data, EVENTS, f, n, name))
            for f in fractions
            for n in sizes
            for name in NAMES
        ]
        checks.append(
            worst(f"{NAME[method]} and event-driven: both times, each fraction and N, by ranks",
                  scores)
        )  # fmt: skip
    table, scores = target("final_time"), []
    for row in table["rows"]:
        for n, runs in zip(table["columns"][1:], table["runs"], strict=True):
            if row["phi"] in fractions and int(n) in sizes:
                found = values(data, EVENTS, row["phi"], int(n), "final")
                log, error = _log_median(found)
                # a median of other runs scatters as ours does, and is printed to 5 %
                both = error * np.sqrt(1 + len(found) / runs)
                scores.append(max(abs(log - np.log(row[n])) - 0.05, 0) / both)
    checks.append(worst("event-driven: median time to one cluster, as computed independently",
                        scores))  # fmt: skip
    return checks


@styled
def _figure(data: dict[str, Any]) -> Any:
    figure = new_figure("double", 0.42)
    panels = figure.subplots(1, 2)
    for ax, (name, text) in zip(panels, NAMES.items(), strict=True):
        use_log(ax, "x")
        use_log(ax, "y")
        for k, f in enumerate(data["fractions"]):
            shift = 1.07 ** (k - (len(data["fractions"]) - 1) / 2)
            for method, fill in ((EVENTS, {}), (METHODS[2], {"mfc": "white"})):
                x = np.array(data["sizes"]) * shift * (1.0 if method == EVENTS else 1.03)
                found = np.array([
                    np.quantile(values(data, method, f, n, name), (0.5, 0.16, 0.84))
                    for n in data["sizes"]
                ]).T  # fmt: skip
                bars = np.abs(found[1:] - found[0])
                line = "-" if method == EVENTS else "none"
                ax.errorbar(
                    x, found[0], bars, **LOOK[f], **fill, lw=0.8, elinewidth=0.5, ls=line,
                    label=rf"$\phi = {f:g}$" if method == EVENTS else None, ms=3,
                )  # fmt: skip
        ax.set(xlabel="discs $N$", ylabel=f"time to {text}")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=5)
    return figure


def present(data: dict[str, Any]) -> Outcome:
    tables = []
    for name, text in NAMES.items():
        rows = []
        for m in METHODS:
            for f in data["fractions"]:
                cells = []
                for n in data["sizes"]:
                    q = np.quantile(values(data, m, f, n, name), (0.5, 0.16, 0.84))
                    cells.append(f"{q[0]:.3g} ({q[1]:.3g} to {q[2]:.3g})")
                rows.append([NAME[m], f"{f:g}", *cells])
        head = ["method", "φ", *(f"N = {n}" for n in data["sizes"])]
        caption = f"Time to {text.replace('$', '')}: median over seeds, and 16 to 84 % of the runs"
        tables.append(Table(caption, head, rows))
    return Outcome(
        ran=ensemble.ran(data),
        checks=_checks(data),
        tables=tables,
        notes=[
            "The last merge is of two clusters that may miss each other for long: its time has a "
            "heavy tail, and medians and ranks are compared, not means. The time to one cluster "
            "for each hundred discs scatters less; at N = 100 it is the same one.",
            f"Open symbols in the figure: {LABEL[METHODS[2]].replace('$', '')}".replace("\\,", " ")
            + ".",
        ],
        figure=_figure(data),
        caption="Time to the final cluster and to one cluster for each hundred discs: median over "
        "seeds, with 16 to 84 % of the runs. Lines and full symbols: event-driven; open: steps of "
        "0.2 R.",
    )


ITEM = Item("final_time", "Time to the final cluster", compute, present)
