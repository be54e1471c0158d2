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
from benchmarks.common import interleaved, model, table, write_section
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


def _with(kernel: Any, *processes: Any, initial: Any = None) -> sx.Model:
    every = [sx.processes.Aggregation(), *processes]
    return sx.Model(kernel, every, initial=initial or sx.initial.monodisperse())


_K1, _P, _I = sx.kernels.Constant(), sx.processes, sx.initial
#: what has always worked and must not become slower: title, model, end, options
WORKING: tuple[tuple[str, sx.Model, float, dict[str, Any]], ...] = (
    ("constant, t = 8", _with(_K1), 8.0, {}),
    ("constant, t = 1000", _with(_K1), 1000.0, {}),
    ("additive, t = 1", _with(sx.kernels.Additive()), 1.0, {}),
    ("multiplicative, t = 0.8", _with(sx.kernels.Multiplicative()), 0.8, {}),
    ("Brownian, t = 100", _with(sx.kernels.Brownian()), 100.0, {}),
    ("ballistic, t = 10", _with(sx.kernels.Ballistic()), 10.0, {}),
    ("ballistic, exponential of 10, t = 1",
     _with(sx.kernels.Ballistic(), initial=_I.exponential(10.0)), 1.0, {}),
    ("constant, lognormal 100, 1.05, t = 0.5", _with(_K1, initial=_I.lognormal(100, 1.05)), 0.5,
     {}),
    ("ballistic, λ = 0.01, 5000 sizes, t = 10, 1e-9",
     _with(sx.kernels.Ballistic(), _P.Shattering(0.01)), 10.0,
     {"largest": 5000, "tolerance": 1e-9}),
    ("ballistic, λ = 0.01, t = 100", _with(sx.kernels.Ballistic(), _P.Shattering(0.01)), 100.0, {}),
    ("oscillations, a = 0.95, λ = 0.01, t = 60",
     _with(sx.kernels.GeneralizedBrownian(0.95), _P.Shattering(0.01)), 60.0, {}),
    ("a = 0.9, λ falls in time, t = 15",
     _with(sx.kernels.GeneralizedBrownian(0.9), _P.Shattering("0.01*(1 - t/400)"),
           initial=_I.from_sizes(dict.fromkeys(range(1, 11), 0.1))), 15.0, {}),
    ("sedimentation, direct, exponential of 3, t = 0.05",
     _with(sx.kernels.Sedimentation(), initial=_I.exponential(3.0)), 0.05, {"method": "direct"}),
    ("formula without given factors, t = 3", _with(sx.kernels.formula("log(1 + i + j + i*j)")),
     3.0, {}),
    ("constant, source of monomers, t = 30", _with(_K1, _P.Source(1.0), initial=_I.empty()), 30.0,
     {}),
    ("Brownian, evaporation, t = 20", _with(sx.kernels.Brownian(), _P.Evaporation(0.3)), 20.0, {}),
    ("constant, scission, t = 20", _with(_K1, _P.Fragmentation(0.1)), 20.0, {}),
    ("Brownian, source, deposition, t = 20",
     _with(sx.kernels.Brownian(), _P.Source(1.0), _P.Removal("0.1*k**(1/3)")), 20.0, {}),
    ("constant, debris, t = 10", _with(_K1, _P.CollisionalFragmentation(0.1, [3, 2, 1])), 10.0,
     {}),
)  # fmt: skip


def _yardstick() -> float:
    """Processor seconds of fixed work of the kind that a solution is made of."""
    x = np.random.default_rng(0).random((4, 8192))
    a = np.random.default_rng(1).random((500, 500))
    start = time.process_time()
    for _ in range(150):
        y = fft.irfft(fft.rfft(x, 16384) ** 2, 16384)
    for _ in range(200):
        a @ a[0]
    for _ in range(2000):
        np.cumsum(y[0, :2000] * x[0, :2000]).sum()
    return time.process_time() - start


def against_yardstick(repeats: int = 5) -> list[str]:
    """Time what has always worked in units of the yardstick, least of both."""
    rows = []
    for title, physics, end, options in WORKING:

        def solution(physics: Any = physics, end: float = end, options: Any = options) -> float:
            start = time.process_time()
            sx.solve(physics, [end], **options)
            return time.process_time() - start

        yard, seconds = interleaved([_yardstick, solution], repeats).min(axis=0)
        rows.append([title, f"{seconds:.2f}", f"{seconds / yard:.2f}"])
    return table(["case", "s", "yardsticks"], rows)


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
            "What has always worked, in seconds and in units of fixed work of transforms and sums "
            "within one run, by which two versions can be compared; the least of five:",
            "",
            *against_yardstick(),
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
