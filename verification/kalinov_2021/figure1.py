"""Figure 1: the size distribution at t = 10, ballistic kernel with shattering."""

from __future__ import annotations

from typing import Any

import numpy as np

import smolux as sx
from smolux.plotting.style import PALETTE, new_figure, styled, use_linear, use_log
from verification.outcome import Item, Outcome, Table, at_most, mean_sigmas, worst

from .common import AR, INVERSE, LABEL, METHODS, ballistic, curves, simulate, target

TIME = 10.0
#: sizes up to this are shown one by one, larger ones in bins
_SINGLE = 16
#: bins with fewer particles in all runs are not judged: their counts are not normal
_FEW = 100


def _edges(largest: int) -> np.ndarray:
    wide = np.unique(np.round(np.geomspace(_SINGLE + 1, largest + 1, 34)).astype(int))
    return np.concatenate((np.arange(1, _SINGLE + 1), wide))


def compute(quick: bool) -> dict[str, Any]:
    particles, runs, largest = (5000, 12, 1500) if quick else (100_000, 12, 1500)
    physics = ballistic()
    edges = _edges(largest)
    ds = sx.solve(physics, [TIME], sizes=2000, tolerance=1e-7 if quick else 1e-9)
    line = ds["n"].values.ravel()
    found: dict[str, Any] = {}
    for method in METHODS:
        ds = simulate(physics, [TIME], particles, runs, method=method, sizes=largest)
        n = ds["n"].values.reshape(runs, -1)
        binned = np.add.reduceat(n, edges[:-1] - 1, axis=1) / np.diff(edges)
        volume = float(ds["volume"].sum())
        counts = np.add.reduceat((n * ds["volume"].values.reshape(runs, 1)).sum(0), edges[:-1] - 1)
        found[method] = {"runs": binned, "counts": counts, "volume": volume}
    expected = np.add.reduceat(line[:largest], edges[:-1] - 1) / np.diff(edges)
    return {
        "edges": edges,
        "line": line,
        "expected": expected,
        "found": found,
        "particles": particles,
    }


def _scores(data: dict[str, Any], method: str) -> np.ndarray:
    found = data["found"][method]
    scores = np.full(len(data["expected"]), np.nan)
    many = np.asarray(found["counts"]) >= _FEW
    runs = np.asarray(found["runs"])[:, many]
    scores[many] = mean_sigmas(runs, np.asarray(data["expected"])[many])
    return scores


def _centres(data: dict[str, Any]) -> np.ndarray:
    edges = np.asarray(data["edges"], float)
    return np.sqrt(edges[:-1] * (edges[1:] - 1))


@styled
def _figure(data: dict[str, Any]) -> Any:
    figure = new_figure("double", 0.5)
    panels = figure.subplots(2, 2, sharex=True, sharey="row", height_ratios=(3, 1))
    k, line = np.arange(1, len(data["line"]) + 1), np.asarray(data["line"])
    for m, method in enumerate((AR, INVERSE)):
        top, low = panels[0, m], panels[1, m]
        use_log(top, "x")
        use_log(top, "y")
        use_log(low, "x")
        runs = np.asarray(data["found"][method]["runs"])
        mean, error = runs.mean(0), 2 * runs.std(0, ddof=1) / np.sqrt(len(runs))
        shown = mean > 0
        x = _centres(data)
        top.plot(k, line, color="black", lw=0.8, label="solver", zorder=1)
        # bars that reach zero have no place on a logarithmic axis
        below = np.minimum(error, 0.9 * mean)
        top.errorbar(
            x[shown],
            mean[shown],
            yerr=(below[shown], error[shown]),
            color=PALETTE[m],
            ls="none",
            marker="o",
            label=f"{LABEL[method]}, mean of {len(runs)} runs",
        )
        top.legend(loc="lower left")
        top.set(xlim=(0.8, 2000), ylim=(1e-13, 0.05))
        low.axhspan(-2, 2, color="0.92", lw=0)
        low.axhline(0, color="0.5", lw=0.6)
        low.plot(x, _scores(data, method), color=PALETTE[m], marker="o", ls="none")
        low.set(xlabel="size $k$", ylim=(-4.5, 4.5))
        use_linear(low, "y")
    panels[0, 0].set_ylabel("density $n_k$")
    panels[1, 0].set_ylabel(r"deviation ($\sigma$)")
    return figure


def present(data: dict[str, Any]) -> Outcome:
    line = np.asarray(data["line"])
    reference = curves("ballistic_densities")
    reference = reference[reference["k"] <= len(line)]
    known = reference["k"].astype(int) - 1
    density = reference["n_kt10"]
    share = np.abs(line[known] / density - 1)
    checks = [
        at_most(
            "solver: n_k, largest relative error of the sizes to 300",
            float(share[known < 300].max()),
            1e-6,
            "",
        ),
        at_most(
            "solver: the same to k = 1000",
            float(share[known < 1000].max()),
            1e-3,
            "(n_k falls to 3e-11)",
        ),
    ]
    rows = []
    for method in METHODS:
        checks.append(worst(f"n_k from the rate equations, {LABEL[method]}", _scores(data, method)))
    for row in target("figure1")["rows"]:
        if row["k"] > _SINGLE:
            continue
        cells = [str(row["k"]), f"{row['n_k']:.6g}", f"{line[row['k'] - 1]:.6g}"]
        for method in METHODS:
            runs = np.asarray(data["found"][method]["runs"])[:, row["k"] - 1]
            cells.append(f"{runs.mean():.6f} ± {runs.std(ddof=1) / np.sqrt(len(runs)):.6f}")
        rows.append(cells)
    head = ["k", "reference", "solver", *(LABEL[m] for m in METHODS)]
    runs = len(data["found"][AR]["runs"])
    return Outcome(
        ran=f"Ballistic kernel, shattering 0.01, t = 10, N = {data['particles']} particles, "
        f"{runs} runs of each "
        "method with doubling, over the "
        ""
        ""
        "solver.",
        checks=checks,
        tables=[Table("Densities at t = 10, mean over runs with one standard error", head, rows)],
        notes=[
            f"Sizes above {_SINGLE} are averaged in bins. Bins with fewer than {_FEW} particles "
            "in all runs are "
            "shown but not judged."
        ],
        figure=_figure(data),
        caption=(
            "Size distribution at t = 10, with two standard errors, and its deviation from "
            "the solver."
        ),
    )


ITEM = Item("figure1", "Figure 1: size distribution, ballistic kernel", compute, present)
