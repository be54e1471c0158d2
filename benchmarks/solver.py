"""Speed and accuracy of the deterministic solver, and where its time goes."""

from __future__ import annotations

import csv
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
from scipy import fft

import smolux as sx
from benchmarks.common import model, table, write_section
from smolux.deterministic import hopf_threshold
from smolux.deterministic.operator import Direct, LowRank, OperatorFactory

DATA = Path(__file__).resolve().parent.parent / "tests" / "reference" / "data"


def reference(name: str, kernel: str) -> dict[float, tuple[float, float]]:
    """Return the number density and the second moment by time."""
    with (DATA / name).open() as file:
        rows = [row for row in csv.DictReader(file) if row["kernel"] == kernel]
    return {float(row["t"]): (float(row["M0"]), float(row["M2"])) for row in rows}


BALLISTIC = reference("ballistic_shatter_lam0.01_moments.csv", "ballistic")
BROWNIAN = reference("aggregation_moments.csv", "brownian")
#: M0 and M2 of a = 0.95, shattering 0.01
OSCILLATION = {60.0: (0.0878760857, 90.4491542)}

#: title, model, end, options, exact values
CASES: tuple[tuple[str, sx.Model, float, dict[str, Any], dict[float, Any]], ...] = (
    ("ballistic, λ = 0.01, t = 10", model(sx.kernels.Ballistic(), 0.01), 10.0, {}, BALLISTIC),
    (
        "the same, 5000 sizes throughout",
        model(sx.kernels.Ballistic(), 0.01),
        10.0,
        {"window": 5000},
        BALLISTIC,
    ),
    ("ballistic, λ = 0.01, t = 100", model(sx.kernels.Ballistic(), 0.01), 100.0, {}, BALLISTIC),
    ("Brownian, t = 1000", model(sx.kernels.Brownian()), 1000.0, {}, BROWNIAN),
    (
        "(i/j)^0.95 + (j/i)^0.95, λ = 0.01, t = 60",
        model(sx.kernels.GeneralizedBrownian(0.95), 0.01),
        60.0,
        {},
        OSCILLATION,
    ),
)


def transform_seconds(length: int) -> float:
    """Processor seconds of one real transform."""
    x = np.random.default_rng(0).random((16, length))
    fft.rfft(x)
    start = time.process_time()
    for _ in range(5):
        fft.rfft(x)
    return (time.process_time() - start) / 80


def runs(tolerances: Sequence[float]) -> list[str]:
    """Solve each case for each tolerance."""
    rows = []
    for title, physics, end, options, exact in CASES:
        for tolerance in tolerances:
            seconds = []
            for _ in range(3):
                start = time.process_time()
                ds = sx.solve(physics, [end], tolerance=tolerance, **options)
                seconds.append(time.process_time() - start)
            found = float(ds["number_density"][0, 0]), float(ds["moment"][0, 0, 2])
            errors = [abs(a / b - 1.0) for a, b in zip(found, exact[end], strict=True)]
            mass = abs(float(ds["moment"][0, 0, 1]) - 1.0)
            rows.append(
                [title, f"{tolerance:.0e}", f"{min(seconds):.2f}"]
                + [str(ds.attrs[key]) for key in ("steps", "rate_evaluations")]
                + [ds.attrs["window"].strip("[]"), *(f"{e:.0e}" for e in (*errors, mass))]
            )
    header = ["case", "tolerance", "s", "steps", "evaluations", "sizes", "M0", "M2", "mass"]
    return table(header, rows)


def evaluation(sizes: int) -> list[list[str]]:
    """Time one evaluation of loss and gain, by each way of summing."""
    k = np.arange(1.0, sizes + 1.0)
    n = np.exp(-30 * k / sizes) * np.ones((4, 1))
    rows = []
    for kernel in (sx.kernels.Ballistic(), sx.kernels.Brownian(), sx.kernels.Constant()):
        low_rank = OperatorFactory(kernel, "low-rank", 1e-9)(sizes)
        assert isinstance(low_rank, LowRank)
        low_rank.prepare(n[0])
        transforms = (low_rank.rank + 1) * transform_seconds(2 * sizes)
        times = [_seconds(low_rank, n), transforms]
        times.append(_seconds(Direct(kernel, sizes), n) if sizes <= 4000 else np.nan)
        rows.append(
            [kernel.name, str(sizes), str(low_rank.rank)]
            + [f"{1e3 * t:.2f}" if t == t else "" for t in times]
        )
    return rows


def _seconds(operator: Any, n: np.ndarray) -> float:
    best = np.inf
    for _ in range(7):
        start = time.process_time()
        operator.loss(n)
        operator.gain(n)
        best = min(best, time.process_time() - start)
    return best / len(n)


def thresholds() -> list[str]:
    """Find the onset of oscillations."""
    rows = []
    for a in (1.0, 0.95, 0.9):
        start = time.process_time()
        found = hopf_threshold(sx.kernels.GeneralizedBrownian(a))
        seconds = time.process_time() - start
        rows.append([f"{a:g}", f"{found.rate:.7f}", f"{found.period:.4f}", f"{seconds:.1f}"])
    return table(["a", "λ_c", "period at the onset", "s"], rows)


def main() -> None:
    sx.solve(model(sx.kernels.Ballistic(), 0.01), [1.0])  # imports
    write_section(
        "solver",
        "Deterministic solver",
        [
            "Processor seconds of one core, the least of three; relative errors at the end time.",
            "The reference values are good to 1e-10, that of the oscillating case to 4e-9.",
            "",
            *runs((1e-6, 1e-8, 1e-10)),
            "",
            "One evaluation of loss and gain, in ms, four densities at once. The transforms alone, "
            "R + 1 of them of twice the length, are the limit of the second column:",
            "",
            *table(
                ["kernel", "sizes", "R", "low-rank", "its transforms alone", "direct"],
                [row for sizes in (1000, 4000, 32000) for row in evaluation(sizes)],
            ),
            "",
            "Onset of oscillations for (i/j)^a + (j/i)^a with shattering:",
            "",
            *thresholds(),
        ],
    )


if __name__ == "__main__":
    main()
