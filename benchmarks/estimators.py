"""What estimators are worth: by rates, the same seed, control variates, extrapolation in N.

The cases are those of Kolodko and Sabelfeld (2003), with 1024 particles and doubling. Cost is that
of `simulate` and what follows, in processor seconds; batches of all schemes are run in turn.
"""

from __future__ import annotations

import sys
import time
from itertools import product
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

import smolux as sx
from benchmarks.common import table, write_section

AR = "acceptance-rejection"
SCHEMES = ((AR, "number"), ("size-class", "mass-flow"))
#: kernel, size, time, and output times from which the density is found by rates
CASES: tuple[tuple[str, Any, int, float, Any], ...] = (
    ("constant", sx.kernels.Constant(), 50, 20.0, np.linspace(4, 20, 21)),
    ("additive", sx.kernels.Additive(0.5), 70, 3.0, np.linspace(2, 3, 21)),
)
PARTICLES, REPLICAS, BATCHES = 1024, 1000, 3


def sample(kernel: Any, scheme: Any, times: Any, size: int, seed: int) -> tuple[Any, Any, float]:
    """Return densities and moments of some replicas, and processor seconds of each."""
    begun = time.process_time()
    ds = sx.simulate(
        sx.Model(kernel), times, method=scheme[0], weighting=scheme[1], particles=PARTICLES,
        replicas=REPLICAS, seed=seed, sizes=128,
    )  # fmt: skip
    if len(times) > 1:
        values = sx.analysis.densities_by_rates(ds, [size])["n"].values[:, -1, 0]
    else:
        values = ds["n"].sel(size=size).values[:, -1]
    return values, ds["moment"].values[:, -1], (time.process_time() - begun) / REPLICAS


def explained(y: Any, columns: Any) -> float:
    """Return R^2 of a linear regression."""
    x = np.column_stack([np.ones(len(y)), columns])
    left = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
    return float(1.0 - left.var() / y.var())


def by_rates() -> tuple[list[str], list[str]]:
    """Measure counts against rates; and, of the counts, what moments explain."""
    rows, controls = [], []
    for name, kernel, size, end, times in CASES:
        ways = [(s, t) for t, s in product(([end], times), SCHEMES)]
        for scheme, t in ways:  # compile
            sample(kernel, scheme, t, size, 1)
        found = [[sample(kernel, s, t, size, 2 + b) for s, t in ways] for b in range(BATCHES)]
        truth = sx.exact.solution(sx.Model(kernel)).densities([end], [size])[0, 0]
        base = None
        for k, (scheme, t) in enumerate(ways):
            values = np.concatenate([batch[k][0] for batch in found])
            cost = float(np.median([batch[k][2] for batch in found]))
            variance = float(values.var(ddof=1))
            base = base or (cost, variance)
            error = 100 * np.sqrt(variance / len(values)) / truth
            rows.append(
                [
                    f"{name}, n_{size}({end:g})", ", ".join(scheme),
                    "counts" if len(t) == 1 else f"rates, {len(t)} times",
                    f"{100 * (values.mean() / truth - 1):.2g} ± {error:.2g}", f"{1e6 * cost:.3g}",
                    f"{base[1] / variance:.3g}", f"{base[0] * base[1] / cost / variance:.3g}",
                ]
            )  # fmt: skip
            if len(t) == 1:
                m = np.concatenate([batch[k][1] for batch in found])
                controls.append(
                    [
                        f"{name}, {scheme[1]}", f"{explained(values, m[:, [0, 2, 3]]):.3f}",
                        f"{explained(m[:, 2], m[:, 0]):.3f}",
                    ]
                )  # fmt: skip
    header = (
        "case", "scheme", "estimate", "deviation, 1 σ (%)", "cost µs", "variance, first /",
        "efficiency / first",
    )  # fmt: skip
    return table(header, rows), table(
        ("case", "R² of n_k with M0, M2, M3", "of M2 with M0"), controls
    )


def same_seed() -> list[str]:
    """Measure variances of differences with other seeds over those with the same one."""
    rows = []
    for method, end in product((AR, "size-class"), (2.0, 20.0)):

        def run(c: float, seed: int, method: str = method, end: float = end) -> Any:
            kernel = sx.kernels.formula("1 + c*(i + j)", c=c)
            return sx.simulate(
                sx.Model(kernel), [end], method=method, particles=PARTICLES, replicas=400,
                seed=seed, sizes=16,
            ).isel(time=0)  # fmt: skip

        one, same, other = run(0.0, 1), run(0.001, 1), run(0.001, 2)
        cells = []
        for pick in (
            lambda ds: ds["number_density"], lambda ds: ds["moment"].sel(order=2),
            lambda ds: ds["n"].sel(size=5),
        ):  # fmt: skip
            apart = [float((pick(ds) - pick(one)).var()) for ds in (other, same)]
            cells.append(f"{apart[0] / apart[1]:.3g}")
        rows.append([method, f"{end:g}", *cells])
    return table(("method", "t", "number of clusters", "M2", "n_5"), rows)


def extrapolation() -> list[str]:
    """Measure bias and cost of ``2 X_2N - X_N`` for the second moment."""
    rows, found = [], []
    for particles in (256, 512):
        ds = sx.ensemble(
            sx.Model(sx.kernels.Constant()), [20.0], ["M2"], method=AR, particles=particles,
            replicas=20_000, seed=particles, threads=1,
        ).isel(observable=0, time=0)  # fmt: skip
        found.append([float(ds[x]) for x in ("mean", "standard_error", "cost")])
    (a, error_a, cost_a), (b, error_b, cost_b) = found
    both = (2 * b - a, float(np.hypot(2 * error_b, error_a)), cost_a + cost_b)
    for name, (mean, error, cost) in zip(("256", "512", "both"), (*found, both), strict=True):
        share = cost * error**2 / (cost_b * error_b**2)
        bias = f"{100 * (mean / 21 - 1):.2f} ± {196 * error / 21:.2f}"
        rows.append([name, bias, f"{share:.3g}"])
    return table(("N", "bias of M2(20) %, 95 %", "cost for the same error / that of 512"), rows)


if __name__ == "__main__":
    rates, controls = by_rates()
    lines = [
        "Densities by rates (`analysis.densities_by_rates`) against counts, with "
        f"{PARTICLES} particles, {REPLICAS * BATCHES} replicas, all included:",
        "", *rates, "", "What control variates could explain of the counts:", "", *controls, "",
        "Variance of the difference between K = 1 and K = 1 + 0.001 (i + j), with other seeds over "
        "that with the same seed:", "", *same_seed(), "",
        "Extrapolation in N, constant kernel:", "", *extrapolation(),
    ]  # fmt: skip
    write_section("estimators", "Estimators beyond counting", lines)
