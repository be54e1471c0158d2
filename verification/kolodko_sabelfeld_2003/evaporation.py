"""Figures 5.1 and 5.2: coagulation and evaporation in the free-molecular regime."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

import smolux as sx
from smolux.plotting.style import MARKERS, PALETTE, new_figure, styled, use_log
from verification.outcome import Check, Item, Outcome, Table, mean_sigmas, worst

from .common import SEED, count, curves, within

#: j*: the paper does not say which one its figures have
SIZES = (2, 5, 10, 20)
#: the one that is drawn, and for which the statements of the text are checked
_DRAWN = 5
TIMES = np.array([0.1, 0.2, 0.5, 1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 70, 100])
_FINE = np.geomspace(0.1, 100, 61)
#: counts of fewer particles in all runs are not normal and are not judged
_FEW = 100
_PARTICLES, _RUNS = 5_000, 16


def _model(beta: float, a: float, printed: bool) -> sx.Model:
    processes: list[Any] = [sx.processes.Aggregation()]
    if beta:
        processes.append(sx.processes.Evaporation.free_molecular(beta, a, printed=printed))
    return sx.Model(kernel=sx.kernels.Ballistic(scale=2**-2.5), processes=processes)


def _above(ds: Any) -> np.ndarray:
    """Densities of the sizes from each j* on, of shape (..., sizes, times)."""
    total = ds["number_density"]
    n = ds["n"].cumsum("size")
    parts = [(total - n.sel(size=j - 1)).transpose(..., "time").values for j in SIZES]
    return np.stack(parts, axis=-2)


def _cases(name: str) -> list[tuple[float, float]]:
    rows = curves(name)
    return sorted({(float(r["beta"]), float(r["A"])) for r in rows})


def _curve(beta: float, a: float, printed: bool, times: np.ndarray) -> np.ndarray:
    ds = sx.solve(_model(beta, a, printed), times, sizes=SIZES[-1], tolerance=1e-7)
    return _above(ds).reshape(len(SIZES), -1)


def compute(name: str, quick: bool) -> dict[str, Any]:
    particles, runs = (500, 8) if quick else (_PARTICLES, _RUNS)
    times = TIMES[TIMES <= 5] if quick else TIMES
    fine = np.unique(np.concatenate((times, _FINE[times[-1] >= _FINE])))
    found = {}
    for beta, a in _cases(name)[:: 4 if quick else 1]:
        ds = sx.simulate(
            _model(beta, a, False), times, particles=particles, replicas=runs, seed=SEED,
            sizes=SIZES[-1],
        )  # fmt: skip
        found[f"{beta:g}, {a:g}"] = {
            "beta": beta,
            "A": a,
            "consistent": _curve(beta, a, False, fine),
            "printed": _curve(beta, a, True, fine) if beta else None,
            "runs": _above(ds),
            "volume": ds["volume"].values.reshape(runs, -1).mean(axis=0),
            "method": ds.attrs["method"],
        }
    return {
        "times": times,
        "fine": fine,
        "found": found,
        "particles": particles,
        "replicas": runs,
    }


def _solver_checks(name: str, data: dict[str, Any]) -> list[Check]:
    checks, reference = [], curves(name)
    for kind, flag in (("consistent", 1), ("printed", 0)):
        ratios = []
        for f in data["found"].values():
            if f[kind] is None:
                continue
            rows = reference[(reference["consistent"] == (flag if f["beta"] else 0))
                             & (reference["beta"] == f["beta"])
                             & (reference["A"] == f["A"])]  # fmt: skip
            rows = rows[rows["tau"] <= data["times"][-1]]
            lines = dict(zip(SIZES, np.asarray(f[kind]), strict=True))
            for j in SIZES:
                ours = np.interp(rows["tau"], data["fine"], lines[j])
                seen = rows[f"c_{j}"] > 1e-6
                ratios += (ours[seen] / rows[f"c_{j}"][seen]).tolist()
        what = "rates that are consistent with (15)" if flag else "rates as printed in (18)"
        checks.append(
            within(f"solver over reference, {what}, c above 10⁻⁶", ratios, 1 - 2e-5, 1 + 2e-5,
                   "(tolerance of the solver)")
        )  # fmt: skip
    return checks


def _simulated(data: dict[str, Any]) -> list[Check]:
    scores = []
    for f in data["found"].values():
        runs, line = np.asarray(f["runs"], float), _at_times(data, f["consistent"])
        many = line * np.asarray(f["volume"]) * data["replicas"] > _FEW
        scores += mean_sigmas(runs[:, many], line[many]).tolist()
    return [worst("Monte Carlo over the solver, all curves, j* and times", np.array(scores), 4.8)]


def _at_times(data: dict[str, Any], curve: Any) -> np.ndarray:
    return np.array([np.interp(data["times"], data["fine"], line) for line in np.asarray(curve)])


def _drawn(data: dict[str, Any], kind: str) -> dict[tuple[float, float], np.ndarray]:
    """Curves of the size that is drawn, by beta and A."""
    row = SIZES.index(_DRAWN)
    return {
        (f["beta"], f["A"]): np.asarray(f[kind if f["beta"] else "consistent"])[row]
        for f in data["found"].values()
    }


def _text(name: str, data: dict[str, Any]) -> list[Check]:
    """Check what the text says of the curves, for the consistent rates."""
    curve, fine = _drawn(data, "consistent"), np.asarray(data["fine"])
    ascending = sorted(curve)
    peaks = [float(curve[key].max()) for key in ascending]
    falling = name == "figure5_1"
    step = np.diff(peaks) * (-1 if falling else 1)
    checks = [
        Check(
            f"the largest c_{_DRAWN} {'falls with β' if falling else 'grows with A'}",
            ", ".join(f"{p:.4f}" for p in peaks),
            "monotonic (the text)",
            "each step",
            bool((step > 0).all()),
        )
    ]
    if not falling:
        return checks
    above = {b: float(x[-1] / curve[0.0, 1.0][-1]) for (b, _), x in sorted(curve.items()) if b}
    checks.append(
        Check(
            f"second stage, τ = 100: c_{_DRAWN} over that of pure coagulation",
            ", ".join(f"{x:.3f} (β = {b:g})" for b, x in above.items()),
            "> 1 (the text)",
            "> 1 from β = 0.1 on (β = 0.01 acts later)",
            bool(min(x for b, x in above.items() if b >= 0.1) > 1),
        )
    )
    for kind in ("consistent", "printed"):
        falls = {b: x[fine >= 10] for (b, _), x in _drawn(data, kind).items()}
        falls = {b: float(x[0] / x[-1]) for b, x in falls.items()}
        constant = [x for b, x in falls.items() if b >= 1]
        if kind == "printed":
            checks.append(
                Check(
                    f"the same with the rates as printed, β = 1: c_{_DRAWN}(10) / c_{_DRAWN}(100)",
                    f"{falls[1.0]:.2f}",
                    "not constant",
                    "> 3",
                    bool(falls[1.0] > 3),
                )
            )
            continue
        checks.append(
            Check(
                f"β ≥ 1: c_{_DRAWN} practically constant, c_{_DRAWN}(10) / c_{_DRAWN}(100)",
                ", ".join(f"{x:.2f}" for x in constant),
                f"{falls[0.0]:.2f} for pure coagulation",
                "< 2",
                bool(max(constant) < 2),
            )
        )
    return checks


def _table(data: dict[str, Any]) -> Table:
    row, rows = SIZES.index(_DRAWN), []
    times = np.asarray(data["times"])
    chosen = [t for t in (1.0, 5.0, 20.0, 100.0) if t in times]
    for f in data["found"].values():
        runs = np.asarray(f["runs"], float)[:, row]
        for kind in ("consistent", "printed"):
            if f[kind] is None:
                continue
            line = _at_times(data, f[kind])[row]
            cells = [f"{f['beta']:g}", f"{f['A']:g}", kind]
            for t in chosen:
                at = int(np.argmax(times == t))
                text = f"{line[at]:.5f}"
                if kind == "consistent":
                    error = runs[:, at].std(ddof=1) / np.sqrt(len(runs))
                    text += f"; {runs[:, at].mean():.5f} ± {error:.5f}"
                cells.append(text)
            rows.append(cells)
    return Table(
        f"c_{_DRAWN}: solver; Monte Carlo with one standard error",
        ["β", "A", "rates", *(f"τ = {t:g}" for t in chosen)],
        rows,
    )


@styled
def _figure(name: str, data: dict[str, Any]) -> Any:
    figure = new_figure("double", 0.42)
    panels = figure.subplots(1, 2, sharey=True)
    row, parameter = SIZES.index(_DRAWN), "beta" if name == "figure5_1" else "A"
    symbol = r"\beta" if parameter == "beta" else "A"
    for ax, kind in zip(panels, ("consistent", "printed"), strict=True):
        use_log(ax, "x")
        use_log(ax, "y")
        for k, f in enumerate(sorted(data["found"].values(), key=lambda f: f[parameter])):
            line = np.asarray(f[kind] or f["consistent"])[row]
            look = {"color": PALETTE[k]}
            label = f"${symbol} = {f[parameter]:g}$"
            if kind == "consistent":
                runs = np.asarray(f["runs"], float)[:, row]
                error = 2 * runs.std(axis=0, ddof=1) / np.sqrt(len(runs))
                ax.errorbar(data["times"], runs.mean(axis=0), yerr=error, marker=MARKERS[k],
                            ls="none", label=label, zorder=3, **look)  # fmt: skip
            ax.plot(data["fine"], line, lw=0.9, **look)
        ax.set(xlabel=r"time $\tau$", xlim=(0.3, 120), ylim=(1e-4, 0.12))
    panels[0].set_ylabel(rf"$c_{{{_DRAWN}}}(\tau)$")
    panels[0].set_title("rates consistent with (15)")
    panels[1].set_title("rates as printed in (18)")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=6)
    return figure


def present(name: str, data: dict[str, Any]) -> Outcome:
    methods = sorted({f["method"] for f in data["found"].values()})
    complete = len(data["found"]) == len(_cases(name)) and data["times"][-1] >= 100
    varied = "A = 1, β = 0 to 2" if name == "figure5_1" else "β = 1, A = 0.5 to 4"
    return Outcome(
        ran=f"Free-molecular kernel with evaporation, {varied}, to τ = {data['times'][-1]:g}: "
        f"{data['replicas']} runs of {count(data['particles'])} particles with doubling "
        f"({', '.join(methods)}), over the solver.",
        checks=_solver_checks(name, data)
        + _simulated(data)
        + (_text(name, data) if complete else []),
        tables=[_table(data)],
        notes=[
            "The rates of evaporation are those that follow from (15) to (17); (18) as printed "
            "lacks a factor K(1, j) / K(1, 2), and what the text says of the curves does not hold "
            "with it. `Evaporation.free_molecular(β, A, printed=True)` has the printed ones.",
            f"The paper does not say which j* is plotted; here j* = {_DRAWN}. Means are "
            f"compared for j* = {', '.join(map(str, SIZES))}.",
        ],
        figure=_figure(name, data),
        caption=(
            f"Density of the sizes from {_DRAWN} on. Symbols: Monte Carlo, mean with two standard "
            "errors; lines: solver."
        ),
    )


def _item(name: str, title: str) -> Item:
    return Item(name, title, partial(compute, name), partial(present, name))


ITEMS = (
    _item("figure5_1", "Figure 5.1: evaporation, several β"),
    _item("figure5_2", "Figure 5.2: evaporation, several A"),
)
