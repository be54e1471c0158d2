"""Figure 3(a): extinction; small systems end as one cluster where large ones oscillate."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from scipy import stats

import smolux as sx
from smolux.plotting.style import PALETTE, new_figure, styled, use_linear, use_log

from ..outcome import Check, Item, Outcome, Table, at_most, mean_sigmas, worst
from .common import AR, brownian, curves, simulate

#: particles -> runs and their end, without doubling
RUNS = {
    100: (200, 500.0),
    300: (200, 500.0),
    1000: (40, 500.0),
    3000: (16, 500.0),
    10_000: (6, 500.0),
    100_000: (1, 100.0),
}
QUICK = {100: (100, 200.0), 300: (40, 200.0), 1000: (10, 50.0)}
_CONFIDENCE = 0.95


def compute(quick: bool) -> dict[str, Any]:
    physics = brownian(0.95, 0.005, spread=True)
    plan = QUICK if quick else RUNS
    times = np.arange(0.5, max(end for _, end in plan.values()) + 0.1, 0.5)
    solved = 12.0 if quick else 40.0
    found: dict[str, Any] = {}
    for particles, (runs, end) in plan.items():
        options = {"method": AR, "population": "fixed-volume", "orders": (1, 2), "sizes": 1}
        ds = simulate(physics, times[times <= end], particles, runs, **options)
        second = ds["moment"].sel(order=2).values
        extinct = ds["extinction_time"].values
        # the run to be drawn: one that died out, the one that lasted longest, or the first
        drawn = int(np.nanargmax(extinct)) if np.isfinite(extinct).any() else 0
        first = ds["moment"].sel(order=1).values
        early = (1, 3, 5, 7, 9)  # t = 1 .. 5
        found[particles] = {
            "extinct": extinct, "curve": second[drawn], "early": second[:, early],
            "left": ds["particles"].values[:, -1], "fewest": ds["particles"].values.min(axis=1),
            "mass": float(np.abs(first / first[:, :1] - 1).max()), "end": end,
            "collisions": float(ds["collisions"].values[:, -1].mean()) / particles,
        }  # fmt: skip
    doubled = simulate(physics, [40.0], 100, 40, method=AR, orders=(1,), sizes=1)
    line = sx.solve(physics, times[times <= solved], orders=(2,), sizes=1, tolerance=1e-7)
    return {
        "times": times, "found": found, "line": line["moment"].values.ravel(),
        "doubled": int(np.isfinite(doubled["extinction_time"].values).sum()), "doubled_runs": 40,
    }  # fmt: skip


def _share(extinct: list[float | None]) -> tuple[int, int, float, float]:
    """Extinct runs, runs, and the exact (Clopper-Pearson) interval of the probability."""
    died = sum(t is not None for t in extinct)
    interval = stats.binomtest(died, len(extinct)).proportion_ci(_CONFIDENCE, "exact")
    return died, len(extinct), float(interval.low), float(interval.high)


def _checks(data: dict[str, Any]) -> list[Check]:
    found = data["found"]
    reference = curves("figure3a")
    wrong = sum(
        (t is not None) != (left == 1)
        for f in found.values()
        for t, left in zip(f["extinct"], f["left"], strict=True)
    )
    shares = {int(n): _share(f["extinct"]) for n, f in found.items()}
    sizes = sorted(shares)
    falls = all(shares[b][0] / shares[b][1] <= shares[a][3] for a, b in pairwise(sizes))
    line = np.asarray(data["line"])
    same = float(np.abs(line / reference["M2"][: len(line)] - 1).max())
    largest = max(n for n in sizes if shares[n][1] >= 6)
    early = reference["M2"][[1, 3, 5, 7, 9]]
    few, most = shares[sizes[0]], shares[sizes[-1]]
    checks = [
        Check(
            "extinct runs are those that end as one cluster",
            f"{wrong} exceptions",
            "0",
            "0",
            wrong == 0,
        ),
        at_most(
            "mass, largest relative change",
            max(f["mass"] for f in found.values()),
            1e-12,
            "(rounding)",
        ),
        Check(
            f"small systems die out, N = {sizes[0]}",
            f"{few[0]} of {few[1]}",
            "most of them",
            "more than half",
            2 * few[0] > few[1],
        ),
        Check(
            "the share of extinct runs falls with N",
            ", ".join(f"{shares[n][0]}/{shares[n][1]}" for n in sizes),
            "falling",
            "not above the interval of the next smaller N",
            falls,
        ),
        Check(
            f"none at N = {sizes[-1]} to t = {found[str(sizes[-1])]['end']:g}",
            f"{most[0]} of {most[1]}",
            "0",
            "0",
            most[0] == 0,
        ),
        Check(
            "with doubling, N = 100: none",
            f"{data['doubled']} of {data['doubled_runs']}",
            "0",
            "0 (half of the particles are always left)",
            data["doubled"] == 0,
        ),
        at_most(
            f"solver: M2(t) to t = {len(line) / 2:g}, largest relative difference from the "
            "reference",
            same,
            5e-5,
            "(accuracy of the reference)",
        ),
        worst(f"M2 at t = 1 .. 5, N = {largest}", mean_sigmas(found[str(largest)]["early"], early)),
    ]
    return checks if sizes[-1] > 10_000 else [c for c in checks if not c.what.startswith("none at")]


@styled
def _figure(data: dict[str, Any]) -> Any:
    figure = new_figure("double", 0.38)
    left, right = figure.subplots(1, 2, width_ratios=(1.9, 1))
    reference = curves("figure3a")
    found, times = data["found"], np.asarray(data["times"])
    use_log(left, "y")
    end = max(f["end"] for f in found.values())
    left.plot(
        reference["t"], reference["M2"], color="black", lw=0.8, label="rate equations", zorder=3
    )
    sizes = sorted(map(int, found))
    died = [n for n in sizes if _share(found[str(n)]["extinct"])[0]]
    shown = list(dict.fromkeys([died[-1] if died else sizes[0], sizes[-1]]))
    for k, n in enumerate(shown):
        curve = np.array(found[str(n)]["curve"], float)
        dead = _share(found[str(n)]["extinct"])[0]
        text = f"$N = {n}$" + (", a run that dies out" if dead and n == shown[0] else "")
        style = "--" if dead and n == shown[0] else "-"
        left.plot(times[: len(curve)], curve, style, color=PALETTE[(1, 0)[k]], lw=0.9, label=text)
    left.set(xlabel="time $t$", ylabel="$M_2$", xlim=(0, end))
    use_linear(left, "x")
    left.legend(loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0.3, ncols=3)
    use_log(right, "x")
    for n in sizes:
        d, runs, low, high = _share(found[str(n)]["extinct"])
        share = d / runs
        right.errorbar(n, share, yerr=[[share - low], [high - share]], color=PALETTE[0], marker="o")
        if n >= 3000:
            right.annotate(f"{d} of {runs}", (n, high), ha="center", va="bottom", xytext=(0, 3),
                           textcoords="offset points", fontsize=6)  # fmt: skip
    right.set(xlabel="particles $N$", ylabel="share of extinct runs", ylim=(-0.04, 1.04))
    use_linear(right, "y")
    return figure


def present(data: dict[str, Any]) -> Outcome:
    rows = []
    for n, f in data["found"].items():
        died, runs, low, high = _share(f["extinct"])
        known = [t for t in f["extinct"] if t is not None]
        rows.append(
            [
                n,
                str(runs),
                f"{f['end']:g}",
                str(died),
                f"{died / runs:.3f}",
                f"{low:.3f} to {high:.3f}",
                f"{np.median(known):.0f}" if known else "–",
                f"{np.median(f['fewest']):.0f}",
                f"{f['collisions']:.0f}",
            ]
        )
    head = [
        "N",
        "runs",
        "to t",
        "extinct",
        "share",
        "95 % interval",
        "median time of extinction",
        "fewest particles seen, median",
        "collisions per particle",
    ]
    end = max(f["end"] for f in data["found"].values())
    return Outcome(
        ran="a = 0.95, shattering 0.005, n_k(0) = 0.1 for k = 1..10, acceptance-rejection "
        "without doubling, "
        f"N = {min(map(int, data['found']))} to {max(map(int, data['found']))}, to t = "
        ""
        ""
        f"{end:g}.",
        checks=_checks(data),
        tables=[Table("Runs that ended as one cluster", head, rows)],
        notes=[
            "With doubling there are always half of the initial particles left, so extinction "
            "needs the volume "
            "fixed; the paper does not say this.",
            "The paper shows one run at N = 10⁴ that dies out at a large time. Without the time "
            "range of its "
            "figure, a probability can be given but not compared.",
            "When a few large clusters are left, they meet at a rate of order 1/V, so small "
            "systems stay for "
            "long with two or three clusters before the last one is left.",
            "N = 10⁶ was not run: it would take minutes and follows the rate equations.",
        ],
        figure=_figure(data),
        caption="Left: second moment of single runs without doubling, and of the rate equations. "
        "Right: share "
        "of runs that died out, with 95 % binomial "
        ""
        ""
        "intervals.",
    )


ITEM = Item("figure3a", "Figure 3(a): extinction", compute, present)
