"""Tables 4.3 to 4.13: error, statistical error and cost of every algorithm, at the paper's N.

Tables that differ only in N are computed and shown together, so that laws in 1/N can be checked.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from smolux.plotting.style import MARKERS, PALETTE, new_figure, styled, use_linear, use_log
from verification.outcome import Check, Item, Outcome, Table, worst

from .common import (
    KERNEL_NAME,
    QUICK,
    cost,
    count,
    exact,
    finite,
    measure,
    target,
    within,
)

#: simulated particles of a row, all replicas together; direct simulation is cheaper
_PARTICLES = {
    "constant": {"MMF": 30e6, "MMF doubling": 20e6, "": 10e6},
    "additive": {"MMF": 8e6, "MMF doubling": 4e6, "": 3e6},
}
#: where few particles have a faster method than the one estimated to be
_METHOD = {("additive", "MFA"): "low-rank"}
#: turns of a table: what disturbs some of them does not disturb the median of the costs
_ROUNDS = 3
#: bias, in per cent, up to which statistical errors are compared with the paper's
_BIASED = 10.0
#: names below the axes
_SHORT = {
    "MMF": "MMF",
    "MMF doubling": "MMF,\ndoubling",
    "MFA": "MFA",
    "WA q=0.5": "WA,\n$q=0.5$",
    "WA q=1": "WA,\n$q=1$",
    "WA q=1.25": "WA,\n$q=1.25$",
}


def _replicas(kernel: str, row: dict[str, Any], quick: bool) -> int:
    budget = _PARTICLES[kernel]
    most = budget.get(row["algorithm"], budget[""]) / (100 if quick else 1)
    return max(min(row["M"], int(most / row["N"])), 30)


def compute(names: tuple[str, ...], quick: bool) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name in names[-1:] if quick else names:  # the last one has fewer particles
        table = target(name)
        times, observables = table["times"], [table["observable"]]
        found[name] = {"exact": exact(table["kernel"], observables, times)[0], "rows": {}}
        for row in table["rows"]:
            algorithm, n = row["algorithm"], row["N"]
            if quick and algorithm not in QUICK:
                continue
            replicas = _replicas(table["kernel"], row, quick)
            ours = measure(
                table["kernel"], algorithm, observables, times, n, replicas, rounds=_ROUNDS,
                method=_METHOD.get((table["kernel"], algorithm)),
            )  # fmt: skip
            for key in ("mean", "error", "variance", "variance_error"):
                ours[key] = ours[key][0]
            if algorithm == "MMF":
                ours["law"] = finite(table["kernel"], observables, times, n)[0]
            found[name]["rows"][algorithm] = ours
    return found


class _Row:
    """One row of a table: ours, and the paper's."""

    def __init__(self, u: np.ndarray, ours: dict[str, Any], paper: dict[str, Any]) -> None:
        self.ours, self.paper = ours, paper
        self.bias = 100 * (np.asarray(ours["mean"], float) / u - 1)
        self.error = 100 * np.asarray(ours["error"], float) / u
        relative = np.asarray(ours["variance"], float) / u**2
        statistical = 300 * np.sqrt(relative / paper["M"])
        self.at = int(np.argmax(statistical))
        #: that of the paper's number of samples, the largest over time, and its relative error
        self.statistical = float(statistical[self.at])
        self.statistical_error = float(np.asarray(ours["variance_error"], float)[self.at]) / 2
        self.cost = cost(ours)
        #: seconds until the statistical error is one per cent
        self.seconds = self.cost * 9e4 * float(relative[self.at])
        self.paper_seconds = paper["tauM"] * paper["St"] ** 2

    @property
    def seconds_error(self) -> float:
        """Relative error of the seconds."""
        spread = np.ptp(self.ours["cost"]) / 2 / self.cost
        return float(np.hypot(2 * self.statistical_error, spread))


def _rows(data: dict[str, Any]) -> dict[str, dict[str, _Row]]:
    tables = {}
    for name, found in data.items():
        u = np.asarray(found["exact"])
        paper = {row["algorithm"]: row for row in target(name)["rows"]}
        tables[name] = {a: _Row(u, ours, paper[a]) for a, ours in found["rows"].items()}
    return tables


def _checks(names: tuple[str, ...], data: dict[str, Any]) -> list[Check]:
    tables, checks = _rows(data), []
    for name in names:
        item, rows = target(name)["item"], tables[name]
        u, law = (np.asarray(x) for x in (data[name]["exact"], rows["MMF"].ours["law"]))
        exact_bias = 100 * (law / u - 1)
        scores = (rows["MMF"].bias - exact_bias) / rows["MMF"].error
        checks.append(worst(f"{item}: mean of MMF, as of the law of the finite system", scores))
        checks += _flow(name, item, rows)
        reference = target(name)["reference"]
        if "Er" in reference:
            largest = float(np.abs(exact_bias).max())
            checks.append(
                within(f"{item}: exact Er of MMF over that computed independently",
                       [largest / reference["Er"]], 0.999, 1.001, "(six digits, grid of times)")
            )  # fmt: skip
        if "St" in reference:
            score = np.log(rows["MMF"].statistical / reference["St"])
            checks.append(
                worst(f"{item}: St of MMF, as computed independently",
                      [score / rows["MMF"].statistical_error])
            )  # fmt: skip
    return checks + _paper(names, tables) + _laws(names, tables) + _orders(names, tables)


def _flow(name: str, item: str, rows: dict[str, _Row]) -> list[Check]:
    """Mass flow and the second moment, constant kernel: the mean is ``1 + t (N - 1) / N``."""
    table = target(name)
    if (table["kernel"], table["observable"]) != ("constant", "M2"):
        return []
    times, checks = np.array(table["times"]), []
    for algorithm in ("MFA", "WA q=1"):
        if algorithm in rows:
            row = rows[algorithm]
            law = -100 * times / (row.paper["N"] * (1 + times))
            scores = (row.bias - law) / row.error
            checks.append(
                worst(f"{item}: mean of {algorithm}, as of the law of the finite system", scores)
            )
    return checks


def _paper(names: tuple[str, ...], tables: dict[str, dict[str, _Row]]) -> list[Check]:
    """St beside the paper's; for the weight algorithms only where the removal does not matter.

    Systems so small that the bias exceeds `_BIASED` have too few large clusters, and so a smaller
    variance; the paper's must have had another bias.
    """
    checks = []
    for name in names:
        table = target(name)
        ratios = {
            a: row.statistical / row.paper["St"]
            for a, row in tables[name].items()
            if abs(row.bias[-1]) <= _BIASED
        }
        if table["observable"] == "M2":
            ratios = {a: r for a, r in ratios.items() if not a.startswith("WA")}
        checks.append(
            within(f"{table['item']}: St over the paper's, {', '.join(ratios)}",
                   list(ratios.values()), 0.9, 1.1, "(the paper's have two or three digits)")
        )  # fmt: skip
    return checks


def _laws(names: tuple[str, ...], tables: dict[str, dict[str, _Row]]) -> list[Check]:
    """Bias and variance in proportion to 1/N: the last times of two tables.

    Where the bias exceeds `_BIASED`, N is too small for such a law.
    """
    if len(names) < 2:
        return []
    many, few = (tables[name] for name in names)
    both = [a for a in many if a in few and abs(few[a].bias[-1]) <= _BIASED]
    scores, ratios, allowed = [], [], []
    for a in both:
        one, two = many[a], few[a]
        n, m = one.paper["N"], two.paper["N"]
        error = np.hypot(n * one.error[-1], m * two.error[-1])
        scores.append((n * one.bias[-1] - m * two.bias[-1]) / error)
        ratios.append(
            n * one.statistical**2 * one.paper["M"] / (m * two.statistical**2 * two.paper["M"])
        )
        scatter = 2 * np.hypot(one.statistical_error, two.statistical_error)
        allowed.append(0.1 + 2 / m + 4 * scatter)
    far = max(abs(r - 1) / most for r, most in zip(ratios, allowed, strict=True))
    return [
        worst(f"N times the bias, the same in both tables, {', '.join(both)}", scores),
        Check(
            f"N times the variance, one table over the other, {', '.join(both)}",
            f"{min(ratios):.3g} to {max(ratios):.3g}",
            "1",
            "within 10 %, 2/N of the smaller N (higher orders in 1/N) and four standard errors",
            bool(far <= 1),
        ),
    ]


def _orders(names: tuple[str, ...], tables: dict[str, dict[str, _Row]]) -> list[Check]:
    """Bias at equal N: Conclusion 4.2, where it is more than chance."""
    checks = []
    for name in names:
        rows = tables[name]
        direct = abs(rows["MMF"].bias[-1]) * rows["MMF"].paper["N"]
        spread = rows["MMF"].error[-1] * rows["MMF"].paper["N"]
        others = {
            a: (abs(row.bias[-1]) - 2 * row.error[-1]) * row.paper["N"]
            for a, row in rows.items()
            if a != "MMF"
        }
        largest = max(others, key=others.__getitem__)
        checks.append(
            Check(
                f"{target(name)['item']}: bias at equal N at most that of MMF, within two errors",
                f"{others[largest]:.3g} % N ({largest})",
                f"{direct:.3g} % N",
                "≤ that of MMF and two of its errors",
                bool(others[largest] <= direct + 2 * spread),
            )
        )
    return checks


def _table(name: str, rows: dict[str, _Row], law: np.ndarray, u: np.ndarray) -> Table:
    lines = []
    for algorithm, row in rows.items():
        paper, seconds = row.paper, f"{row.seconds:.2g}"
        ratio = rows["MMF"].seconds / row.seconds
        spread = np.hypot(rows["MMF"].seconds_error, row.seconds_error) * ratio
        lines.append(
            [
                algorithm,
                count(paper["N"]),
                f"{count(row.ours['replicas'])} ({count(paper['M'])})",
                f"{row.bias[-1]:.3f} ± {row.error[-1]:.3f} ({paper['Er']:g})",
                f"{100 * (law[-1] / u[-1] - 1):.3f}" if algorithm == "MMF" else "–",
                f"{row.statistical:.3f} ± {row.statistical * row.statistical_error:.3f} "
                f"({paper['St']:g})",
                f"{1e6 * row.cost:.3g} ({1e6 * paper['tau']:g})",
                f"{seconds} ({row.paper_seconds:.2g})",
                f"{ratio:.2g} ± {spread:.1g} ({rows['MMF'].paper_seconds / row.paper_seconds:.2g})",
                row.ours["method"],
            ]
        )
    head = [
        "algorithm", "N", "M", "bias, %", "exact bias, %", "St, %", "τ, µs",
        "seconds to St = 1 %", "efficiency / MMF", "method",
    ]  # fmt: skip
    table = target(name)
    kind = ": the bias at the last time, the largest St over time" if len(u) > 1 else ""
    return Table(f"{table['item']}, {_case(table)} (in brackets: the paper){kind}", head, lines)


def _case(table: dict[str, Any]) -> str:
    symbol = table["observable"].replace("n_", "u_")
    word = "to" if len(table["times"]) > 1 else "at"
    return f"{symbol} {word} t = {table['times'][-1]:g}, {KERNEL_NAME[table['kernel']]}"


@styled
def _figure(names: tuple[str, ...], data: dict[str, Any]) -> Any:
    tables = _rows(data)
    figure = new_figure("double", 0.42)
    left, right = figure.subplots(1, 2)
    labels, spans = list(tables[names[0]]), []
    left.axhline(0, color="0.6", lw=0.6, zorder=0)
    right.axhline(1, color="0.6", lw=0.6, zorder=0)
    for k, name in enumerate(names):
        rows, item = tables[name], target(name)["item"]
        look = {"ls": "none", "marker": MARKERS[k], "color": PALETTE[k]}
        x = np.array([labels.index(a) for a in rows]) + 0.3 * (k - 0.5 * (len(names) - 1))
        n = np.array([row.paper["N"] for row in rows.values()]) / 100
        bias, error = (n * [getattr(row, key)[-1] for row in rows.values()]
                       for key in ("bias", "error"))  # fmt: skip
        left.errorbar(x, bias, yerr=2 * error, label=item, **look)
        # a bar that is far longer than most may leave the axes
        bar = 2 * np.minimum(error, 2 * np.median(error))
        spans.append((float(min(bias - bar)), float(max(bias + bar))))
        found = data[name]
        law = n[0] * 100 * (found["rows"]["MMF"]["law"][-1] / found["exact"][-1] - 1)
        left.hlines(law, x[0] - 0.12, x[0] + 0.12, color="black", lw=1.2,
                    label="MMF, exact" if not k else None)  # fmt: skip
        ratios = np.array([rows["MMF"].seconds / row.seconds for row in rows.values()])
        spread = np.array([row.seconds_error for row in rows.values()])
        right.errorbar(x, ratios, yerr=2 * ratios * np.hypot(spread, spread[0]), **look)
        printed = [rows["MMF"].paper_seconds / row.paper_seconds for row in rows.values()]
        right.plot(x + 0.1, printed, mfc="white", label=f"{item}, paper", **look)
    low, high = (f(0.0, *(f(span) for span in spans)) for f in (min, max))
    left.set_ylim(low - 0.06 * (high - low), high + 0.06 * (high - low))
    use_log(right, "y")
    use_linear(left, "y")
    for ax in (left, right):
        ax.set_xticks(range(len(labels)), [_SHORT[a] for a in labels])
        ax.tick_params(axis="x", which="both", length=0)
        ax.set_xlim(-0.5, len(labels) - 0.5)
    left.set_ylabel("$N$ × relative bias")
    right.set_ylabel("efficiency over that of MMF")
    handles, texts = (
        [*one, *two]
        for one, two in zip(
            left.get_legend_handles_labels(), right.get_legend_handles_labels(), strict=True
        )
    )
    figure.legend(handles, texts, loc="outside upper center", ncols=6)
    return figure


def present(names: tuple[str, ...], data: dict[str, Any]) -> Outcome:
    names = tuple(name for name in names if name in data)
    tables = _rows(data)
    table = target(names[0])
    law = {name: np.asarray(data[name]["rows"]["MMF"]["law"]) for name in names}
    samples = sum(row.ours["replicas"] for rows in tables.values() for row in rows.values())
    caption = (
        "Left: bias at the last time, times N, with two standard errors. Right: efficiency over "
        "that of MMF, here (filled, with two standard errors) and in the paper (open)."
    )
    return Outcome(
        ran=f"{_case(table)}: the algorithms and N of the paper, {count(samples)} replicas in all.",
        checks=_checks(names, data),
        tables=[_table(n, tables[n], law[n], np.asarray(data[n]["exact"])) for n in names],
        notes=_NOTES + _MORE.get(names[0], []),
        figure=_figure(names, data),
        caption=caption,
    )


_NOTES = [
    "Bias: mean over the exact solution of the rate equations, less one, with one standard error "
    "of our replicas. The paper's Er is not that of direct simulation, whose exact value stands "
    "beside.",
    "St = 300 sqrt(relative variance / M) in per cent, for the paper's M, so that it can be "
    "compared with the paper's whatever number of replicas ours is from.",
    "Times T/8 to T: at shorter ones the relative variance of a size not yet there is without "
    "bound.",
    f"Where the bias is above {_BIASED:g} %, in systems of some twenty particles, large clusters "
    "are too few and their variance is smaller, too: neither St nor laws in 1/N are checked there.",
    "WA: a particle is taken out, or two, by one uniform number here and by two independent ones "
    "in the paper. Means are those of the same equation; the variance of M2 is smaller here.",
]


_MORE = {
    "table4_9": [
        "MFA: the paper's M is ten times too small for its St, see the errata; with 12 000 000 "
        "samples its advantage over MMF would be 3.5 instead of 35.",
    ],
}


def _item(names: tuple[str, ...], title: str) -> Item:
    numbers = [name.removeprefix("table") for name in names]
    return Item(
        "tables" + "_".join(numbers) if len(names) > 1 else names[0],
        f"Table{'s' if len(names) > 1 else ''} "
        f"{' and '.join(n.replace('_', '.') for n in numbers)}: {title}",
        partial(compute, names),
        partial(present, names),
    )


ITEMS = (
    _item(("table4_3", "table4_4"), "u₂, constant kernel"),
    _item(("table4_5", "table4_6"), "u₂, additive kernel"),
    _item(("table4_7",), "u₂₁(8), constant kernel"),
    _item(("table4_8",), "u₅₀(20), constant kernel"),
    _item(("table4_9",), "u₇₀(3), additive kernel"),
    _item(("table4_10", "table4_11"), "second moment, constant kernel"),
    _item(("table4_12", "table4_13"), "second moment, additive kernel"),
)
