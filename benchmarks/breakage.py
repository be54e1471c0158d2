"""What an event of breakage costs, by the law and the size, against removal of a particle."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

import smolux as sx
from benchmarks.common import group_of, interleaved, loop_seconds, table, write_section

P = sx.processes
#: each of a rate of order one at all sizes
LAWS = {
    "uniform binary": "2/(i + j - 1)",
    "halves": "max(0, 1 - max(0, abs(i - j) - 1))",
    "small pieces": "1/(i*j) * (i + j)/log(1 + i + j)",
}
END = 1.5
SIZES = (100, 1000, 10_000, 100_000, 10_000_000)
PARTICLES, REPEATS = 20_000, 5


def _case(process: object, size: int, end: float):  # type: ignore[no-untyped-def]
    # encounters next to never come: what is timed is breakage
    kernel = sx.kernels.Constant(1e-30)
    physics = sx.Model(kernel, [P.Aggregation(), process], sx.initial.monodisperse(size=size))
    counts: list[float] = []

    def measure() -> float:
        group = group_of(physics, end, PARTICLES, "size-class")
        seconds = loop_seconds(group)
        events = int(group.state.events.sum())
        counts[:] = [group.state.attempts.sum() / events]
        return 1e9 * seconds / events

    return measure, counts


def breakage() -> list[str]:
    """Time the cases, interleaved."""
    cases = [("removal", 1000, *_case(P.Removal(1.0), 1000, END))]
    for name, law in LAWS.items():
        for size in SIZES:
            cases.append((name, size, *_case(P.Fragmentation(law), size, END)))
    for _, _, measure, _ in cases:
        measure()
    seconds = np.median(interleaved([case[2] for case in cases], REPEATS), axis=0)
    rows = [
        [name, f"{size:g}", f"{ns:.0f}", f"{ns / seconds[0]:.2f}", f"{counts[0]:.2f}"]
        for (name, size, _, counts), ns in zip(cases, seconds, strict=True)
    ]
    return [
        f"{PARTICLES} particles of one size at the start, no encounters, size-class; medians of "
        f"{REPEATS}, interleaved. All sizes that occur are new in each run, so that going through "
        "their splits is part of the time.",
        "",
        *table(["law", "size", "ns an event", "by removal", "candidates an event"], rows),
    ]


if __name__ == "__main__":
    write_section("breakage", "Breakage", breakage())
