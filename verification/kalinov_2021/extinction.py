"""Figure 3(a): extinction; small systems end as one cluster where large ones oscillate."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from scipy import stats

import smolux as sx
from smolux.plotting.style import PALETTE, new_figure, styled, use_linear, use_log
from verification.outcome import Check, Item, Outcome, Table, at_most, mean_sigmas, worst

from .common import AR, brownian, curves, simulate

#: when a few large clusters are left they meet at a rate of order 1/N, so the end must be late
_END = 1e5
#: particles -> runs and their end, without doubling
RUNS = {
    100: (200, _END),
    300: (200, _END),
    1000: (100, _END),
    3000: (40, _END),
    10_000: (12, _END),
    100_000: (3, 100.0),
}
QUICK = {100: (100, 2e4), 300: (40, 2e4), 1000: (10, 50.0)}
#: every half to here, then in equal ratios
_FINE = 150.0
_CONFIDENCE = 0.95
#: line styles tell curves apart without colour
LINES = ("-", "--", "-.", ":")


def _times(end: float) -> np.ndarray:
    fine = np.arange(0.5, min(end, _FINE) + 0.1, 0.5)
    return np.concatenate((fine, np.geomspace(_FINE, end, 120)[1:])) if end > _FINE else fine


def compute(quick: bool) -> dict[str, Any]:
    physics = brownian(0.95, 0.005, spread=True)
    solved = _times(12.0 if quick else 40.0)
    found: dict[str, Any] = {}
    for particles, (runs, end) in (QUICK if quick else RUNS).items():
        options = {"method": AR, "population": "fixed-volume", "orders": (1, 2), "sizes": 1}
        times = _times(end)
        ds = simulate(physics, times, particles, runs, **options)
        second = ds["moment"].sel(order=2).values
        first = ds["moment"].sel(order=1).values
        collisions = ds["collisions"].values[:, -1] / particles
        longest = int(np.argmax(collisions))
        early = (1, 3, 5, 7, 9)  # t = 1 .. 5
        found[particles] = {
            "extinct": ds["extinction_time"].values, "times": times, "curve": second[longest],
            "early": second[:, early], "left": ds["particles"].values[:, -1],
            "mass": float(np.abs(first / first[:, :1] - 1).max()), "end": end,
            "collisions": collisions, "volume": float(ds["volume"].values[0, 0]),
            "fewest": ds["particles"].values.min(axis=1),
        }  # fmt: skip
    doubled = simulate(physics, [40.0], 100, 40, method=AR, orders=(1,), sizes=1)
    line = sx.solve(physics, solved, orders=(2,), sizes=1, tolerance=1e-7)
    return {
        "found": found, "line": line["moment"].values.ravel(),
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
    sizes = sorted(map(int, found))
    line = np.asarray(data["line"])
    same = float(np.abs(line / reference["M2"][: len(line)] - 1).max())
    early = reference["M2"][[1, 3, 5, 7, 9]]
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
    ]
    for n in sizes:
        died, runs, _, _ = _share(found[str(n)]["extinct"])
        end = found[str(n)]["end"]
        if end > _FINE:
            paper = " (the paper shows one)" if n == 10_000 else ""
            goal, passed = f"most of them{paper}", 2 * died > runs
            what, limit = f"N = {n} dies out before t = {end:g}", "more than half"
        else:
            goal, passed = "0", died == 0
            what, limit = f"N = {n} goes on to t = {end:g}", "0"
        checks.append(Check(what, f"{died} of {runs}", goal, limit, passed))
    lives = {n: np.asarray(found[str(n)]["collisions"]) for n in sizes if n >= 300}
    longer = [lives[b].mean() > lives[a].mean() for a, b in pairwise(lives)]
    judged = max(n for n in sizes if len(found[str(n)]["extinct"]) >= 6)
    return [
        *checks,
        Check(
            "larger systems live longer: collisions per particle at the end, mean over runs, "
            f"N = {', '.join(map(str, lives))}",
            ", ".join(f"{x.mean():.3g}" for x in lives.values()),
            "growing",
            "growing",
            all(longer),
        ),
        Check(
            "with doubling, N = 100: none dies out",
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
        worst(f"M2 at t = 1 .. 5, N = {judged}", mean_sigmas(found[str(judged)]["early"], early)),
    ]


@styled
def _figure(data: dict[str, Any]) -> Any:
    figure = new_figure("double", 0.42)
    left, right = figure.subplots(1, 2, width_ratios=(1.7, 1))
    reference, found = curves("figure3a"), data["found"]
    use_log(left, "x")
    use_log(left, "y")
    sizes = sorted(map(int, found))
    mortal = max(n for n in sizes if _share(found[str(n)]["extinct"])[0])
    for k, n in enumerate(dict.fromkeys([mortal, sizes[-1]])):
        f = found[str(n)]
        look = {"color": PALETTE[(1, 0)[k]], "lw": (1.0, 0.9)[k], "ls": ("--", "-")[k]}
        text = f"$N = {_power(n)}$" + (", a run that dies out" if n == mortal else "")
        left.plot(f["times"], np.array(f["curve"], float), label=text, **look)
    left.plot(
        reference["t"], reference["M2"], color="black", lw=0.8, label="rate equations", zorder=3
    )
    low = 0.7 * min(np.min(np.array(line.get_ydata())[1:]) for line in left.lines)
    alone = 5.5**2 * found[str(mortal)]["volume"]
    left.axhline(alone, color="0.5", lw=0.7, ls=":", zorder=1)
    left.annotate("one cluster", (1.3, alone), xytext=(0, -2), textcoords="offset points",
                  va="top", fontsize=6.5, color="0.3")  # fmt: skip
    end = max(f["end"] for f in found.values())
    left.set(xlabel="time $t$", ylabel="$M_2$", xlim=(1, end), ylim=(low, 2 * alone))
    use_log(right, "x")
    for k, n in enumerate(sizes):
        f = found[str(n)]
        times = np.sort(np.array([t for t in f["extinct"] if t is not None], float))
        alive = 1 - np.arange(len(times) + 1) / len(f["extinct"])
        right.step(
            [1e-9, *times, f["end"]], [*alive, alive[-1]], where="post", color=PALETTE[k],
            ls=LINES[k % len(LINES)], label=f"${_power(n)}$",
        )  # fmt: skip
    right.set(xlabel="time $t$", ylabel="share of runs not extinct", xlim=(1, end), ylim=(0, 1.04))
    use_linear(right, "y")
    figure.legend(
        *left.get_legend_handles_labels(), loc="outside upper left", ncols=3, borderaxespad=0.3
    )
    right.legend(title="$N$", loc="lower left", fontsize=6.5, title_fontsize=6.5)
    return figure


def _power(n: int) -> str:
    """Write 10000 as a power of ten, and 3000 as a multiple of one."""
    digits = len(str(n)) - 1
    lead = n // 10**digits
    return f"10^{digits}" if lead == 1 else rf"{lead}\times 10^{digits}"


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
                f"{np.median(known):.4g}" if known else "–",
                f"{np.median(f['fewest']):.0f}",
                f"{np.mean(f['collisions']):.3g}",
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
    sizes = sorted(map(int, data["found"]))
    last = data["found"][str(sizes[-1])]
    return Outcome(
        ran="a = 0.95, shattering 0.005, n_k(0) = 0.1 for k = 1..10, acceptance-rejection "
        f"without doubling, N = {sizes[0]} to {sizes[-1]}, {len(last['extinct'])} runs of the "
        f"largest to t = {last['end']:g}.",
        checks=_checks(data),
        tables=[Table("Runs that ended as one cluster", head, rows)],
        notes=[
            "With doubling there are always half of the initial particles left, so extinction "
            "needs the volume fixed; the paper does not say this.",
            "A run is lost when a minimum of the number of clusters passes without a shattering: "
            "of the few hundred collisions that are left at N = 10⁴ each shatters with "
            "probability 0.005 only. The last clusters then meet at a rate of order 1/N, "
            "so the end itself comes much later than the end of the oscillations.",
            "The paper shows one run at N = 10⁴ that dies out, and larger ones that do not. "
            "N = 10⁶ was not run: it would take many minutes and follows the rate equations.",
        ],
        figure=_figure(data),
        caption="Left: second moment of single runs without doubling, and of the rate equations; "
        "dotted: that of a single cluster. Right: share of runs that have not died out.",
    )


ITEM = Item("figure3a", "Figure 3(a): extinction", compute, present)
