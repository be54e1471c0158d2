"""The map: which weighting is most efficient for which size and moment, by kernel."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

import smolux as sx
from smolux.plotting.style import MARKERS, PALETTE, new_figure, styled, use_log
from verification.outcome import Check, Item, Outcome, Table

from .common import SEED, count

#: kernel -> the kernel, its degree of homogeneity, and a time at which one cluster in ten is left
CASES: dict[str, tuple[Any, str, float]] = {
    "constant": (sx.kernels.Constant(), "0", 18.0),
    "free-molecular": (sx.kernels.Ballistic(), "1/6", 2.15),
    "additive": (sx.kernels.Additive(0.5), "1", 4.605),
}
NUMBER, FLOW = "number", "mass-flow"
SCHEMES: dict[str, Any] = {
    NUMBER: NUMBER,
    "weight l^0.5": sx.weighting.WeightFunction(0.5),
    FLOW: FLOW,
    "weight l^1.25": sx.weighting.WeightFunction(1.25),
}
SIZES = (1, 2, 3, 5, 8, 12, 20, 30, 50, 80, 120, 200, 300)
MOMENTS = ("number_density", "M2", "M3")
PARTICLES, REPLICAS = 1000, 2000
_KEPT = ("ratio", "ratio_lower", "ratio_upper", "best", "reference", "cost")
#: densities of which direct simulation has fewer clusters than this in all replicas are left out,
#: copies by doubling not counted
_FEW = 20


def compute(quick: bool) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, (kernel, _, time) in CASES.items():
        if quick and name != "constant":
            continue
        ds = sx.efficiency(
            sx.Model(kernel=kernel),
            schemes=[("auto", weighting) for weighting in SCHEMES.values()],
            observables=[*MOMENTS, *(f"n_{k}" for k in SIZES)],
            times=[time],
            particles=PARTICLES,
            replicas=60 if quick else REPLICAS,
            seed=SEED,
            threads=1,
        ).isel(time=0)
        found[name] = {key: ds[key].values for key in _KEPT}
        found[name]["methods"] = json.loads(ds.attrs["methods"])
    return {"found": found}


def _shown(f: dict[str, Any]) -> np.ndarray:
    """Which sizes are frequent enough in direct simulation."""
    density = np.asarray(f["reference"], float)[len(MOMENTS) :]
    return density * PARTICLES * REPLICAS > _FEW


def _crossing(f: dict[str, Any], scheme: int) -> float | None:
    """Size from which on a scheme is more efficient than direct simulation, interpolated."""
    shown = _shown(f)
    sizes = np.array(SIZES)[shown]
    ratio = np.log(np.asarray(f["ratio"], float)[scheme, len(MOMENTS) :][shown])
    below = np.flatnonzero(ratio < 0)
    if len(below) in (0, len(ratio)) or below[-1] == len(ratio) - 1:
        return None if len(below) else float(sizes[0])
    k = below[-1]
    share = -ratio[k] / (ratio[k + 1] - ratio[k])
    return float(np.exp(np.log(sizes[k]) + share * np.log(sizes[k + 1] / sizes[k])))


def _checks(data: dict[str, Any]) -> list[Check]:
    checks = []
    for name, f in data["found"].items():
        flow = list(SCHEMES).index(FLOW)
        low, high = (np.asarray(f[key], float)[flow] for key in ("ratio_lower", "ratio_upper"))
        last = len(MOMENTS) + int(np.flatnonzero(_shown(f))[-1])
        size = SIZES[last - len(MOMENTS)]
        checks += [
            Check(
                f"{name}: mass flow against direct simulation with doubling, monomers",
                f"{low[len(MOMENTS)]:.2g} to {high[len(MOMENTS)]:.2g} (95 %)",
                "direct simulation is better for small sizes (section 4.4)",
                "< 1",
                bool(high[len(MOMENTS)] < 1),
            ),
            Check(
                f"{name}: the same for size {size}, over that for monomers",
                f"{low[last] / high[len(MOMENTS)]:.0f} to {high[last] / low[len(MOMENTS)]:.0f}",
                "mass flow is for large sizes (section 4.4)",
                "> 10",
                bool(low[last] > 10 * high[len(MOMENTS)]),
            ),
        ]
        if CASES[name][1] != "0":
            checks.append(
                Check(
                    f"{name}: the same, size {size}",
                    f"{low[last]:.2g} to {high[last]:.2g} (95 %)",
                    "mass flow is better for large sizes and kernels that grow (section 4.4)",
                    "> 1",
                    bool(low[last] > 1),
                )
            )
    return checks


def _table(data: dict[str, Any]) -> Table:
    rows = []
    for name, f in data["found"].items():
        ratio, best = np.asarray(f["ratio"], float), np.asarray(f["best"])
        for s, scheme in enumerate(SCHEMES):
            crossing = _crossing(f, s) if s else None
            cells = [name if not s else "", scheme, f["methods"][s],
                     f"{1e3 * f['cost'][s]:.2g}"]  # fmt: skip
            for m in range(len(MOMENTS)):
                text = f"{ratio[s, m]:.2g}"
                cells.append(f"**{text}**" if best[s][m] else text)
            cells.append("–" if crossing is None else f"{crossing:.2g}")
            rows.append(cells)
    head = [
        "kernel", "weighting", "method", "ms a replica", "M₀", "M₂", "M₃",
        "densities: better from size",
    ]  # fmt: skip
    return Table(
        "Efficiency over that of direct simulation with doubling; bold: none is better beyond "
        "chance",
        head,
        rows,
    )


@styled
def _figure(data: dict[str, Any]) -> Any:
    figure = new_figure("double", 0.4)
    panels = np.atleast_1d(figure.subplots(1, len(data["found"]), sharey=True))
    for ax, (name, f) in zip(panels, data["found"].items(), strict=True):
        use_log(ax, "x")
        use_log(ax, "y")
        shown = _shown(f)
        sizes = np.array(SIZES)[shown]
        low, mid, high = (
            np.asarray(f[key], float)[:, len(MOMENTS) :][:, shown]
            for key in ("ratio_lower", "ratio", "ratio_upper")
        )
        for s, scheme in enumerate(SCHEMES):
            label = {NUMBER: "direct simulation", FLOW: "mass flow"}.get(
                scheme, f"weight $l^{{{scheme.split('^')[-1]}}}$"
            )
            ax.errorbar(sizes, mid[s], yerr=[mid[s] - low[s], high[s] - mid[s]], lw=0.8,
                        color=PALETTE[s], marker=MARKERS[s], label=label)  # fmt: skip
        degree, mean = CASES[name][1], f["reference"][1]
        ax.axvline(mean, color="0.6", ls=":", lw=0.8, zorder=0)
        ax.set_title(f"{name} (degree {degree})")
        ax.set_xlabel("size $k$")
    panels[0].set_ylabel("efficiency for $n_k$ over that\nof direct simulation")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


def present(data: dict[str, Any]) -> Outcome:
    return Outcome(
        ran=f"Three kernels, until a tenth of the clusters is left: {count(PARTICLES)} particles "
        f"with doubling, {count(REPLICAS)} replicas of each weighting, with the method that "
        "method='auto' chooses.",
        checks=_checks(data),
        tables=[_table(data)],
        notes=[
            "Efficiency is 1 / (cost × variance). What is best for a size depends on how many "
            "simulated particles stand for it: one of size l stands for l^-q particles.",
            "Bias is no part of it, and is smaller with weights that grow with the size.",
        ],
        figure=_figure(data),
        caption=(
            "The map: efficiency for the density of one size, over that of direct simulation with "
            "doubling, with 95 % intervals. Dotted: the mean size by mass, M₂ / M₁."
        ),
    )


ITEM = Item("map", "The map: which weighting for which observable", compute, present)
