"""What a composition costs: nanoseconds an event and bytes a particle, with it and without."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

import smolux as sx
from benchmarks.common import group_of, interleaved, loop_seconds, table, write_section
from smolux.methods.base import size_of

CARRIED = {"without": (), "two kinds": ({"a": 1, "b": 1},), "five": (dict.fromkeys("abcde", 1),)}
#: kernel, shattering, particles, end
CASES = (
    ("ballistic", sx.kernels.Ballistic(), 0.0, 1_000_000, 20.0),
    ("ballistic", sx.kernels.Ballistic(), 0.1, 1_000_000, 3.0),
    ("constant", sx.kernels.Constant(), 0.0, 100_000, 20.0),
)
REPEATS = 5


def _case(kernel: object, shattering: float, particles: int, end: float, method: str, kinds):  # type: ignore[no-untyped-def]
    processes = [sx.processes.Aggregation()]
    if shattering > 0.0:
        processes.append(sx.processes.Shattering(shattering))
    attributes = [sx.attributes.Composition(shares) for shares in kinds]
    physics = sx.Model(kernel, processes, attributes=attributes)
    room: list[float] = []

    def measure() -> float:
        group = group_of(physics, end, particles, method)
        room[:] = [size_of(group.work) / particles]
        loop_seconds(group)
        return 1e9 * group.seconds / group.events

    return measure, room


def composition() -> list[str]:
    """Time the cases, interleaved."""
    rows = []
    for name, kernel, shattering, particles, end in CASES:
        for method in ("size-class", "acceptance-rejection"):
            made = [
                _case(kernel, shattering, particles, end, method, kinds)
                for kinds in CARRIED.values()
            ]
            for measure, _ in made:
                measure()
            ns = np.median(interleaved([measure for measure, _ in made], REPEATS), axis=0)
            cells = [f"{t:.0f} ({t / ns[0]:.2f})" for t in ns]
            law = f"{name}, shattering {shattering:g}" if shattering else name
            rooms = " / ".join(f"{room[0]:.0f}" for _, room in made)
            rows.append([law, f"{particles:g}", method, *cells, rooms])
    return [
        f"Monomers at the start, doubling, one replica; medians of {REPEATS}, interleaved. In "
        "brackets the ratio to the same without. With a composition events come one by one, and "
        "monomers are stored. Bytes are those of all work arrays at the start for each particle.",
        "",
        *table(["case", "N", "method", *(f"ns, {k}" for k in CARRIED), "bytes a particle"], rows),
    ]


if __name__ == "__main__":
    write_section("composition", "Composition", composition())
