"""Discs in a box to one cluster: processor seconds of the methods, exponents, memory.

``python benchmarks/spatial.py`` goes to 10^5 discs; with ``large`` to 10^6, in some minutes; with
``memory`` it measures the memory of 10^5 to 10^7 discs alone, down to a tenth of the clusters; with
``radii`` the cost of radii that differ widely.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

import smolux.spatial as sp
from benchmarks.common import table, write_section
from smolux.spatial.methods.base import SpatialMethod

#: dimension, volume fraction, side of the lattice at each size
CASES = (
    (2, 0.1, (50, 100, 200, 316, 1000)),
    (2, 0.3, (50, 100, 200, 316, 1000)),
    (3, 0.2, (14, 22, 34, 46, 100)),
)
#: processor seconds that were asked for: dimension, volume fraction, side -> seconds
TARGETS = {
    (2, 0.1, 100): 0.2,
    (2, 0.1, 316): 3.0,
    (2, 0.1, 1000): 40.0,
    (2, 0.3, 1000): 20.0,
    (3, 0.2, 100): 40.0,
}
_SMALL = 100_000


def seconds(method: type[SpatialMethod], system: sp.System) -> tuple[float, int]:
    """Processor seconds to one cluster, set-up included, and events."""
    start = time.process_time()
    run = method().start(system, np.empty(0))
    while run.advance(np.inf, 1, 1 << 16) is None:
        pass
    return time.process_time() - start, run.events


def compiled(dimension: int) -> None:
    """Have the loops ready."""
    for method in (sp.Windowed, sp.Cells, sp.AllPairs):
        seconds(method, sp.lattice(4**dimension, 0.1, dimension=dimension, seed=1))


def windowed(large: bool) -> list[str]:
    """Table of the windowed method, with the exponent over the last factor of ten."""
    rows = []
    for dimension, fraction, sides in CASES:
        compiled(dimension)
        known: list[tuple[int, float]] = []
        for side in sides:
            discs = side**dimension
            if discs > _SMALL and not large:
                continue
            system = sp.lattice(discs, fraction, dimension=dimension, seed=1)
            repeats = 3 if discs <= 10_000 else 1
            measured = [seconds(sp.Windowed, system) for _ in range(repeats)]
            cost, events = min(measured)
            known.append((discs, cost))
            target = TARGETS.get((dimension, fraction, side))
            rows.append([
                f"{dimension}D, {fraction:g}", f"{discs:,}", f"{cost:.3g} s",
                f"{1e6 * cost / discs:.1f} µs", f"{events:,}", f"{target:g} s" if target else "",
            ])  # fmt: skip
            print(*rows[-1], flush=True)
        if len(known) > 1:
            first = next(k for k in known if k[0] * 30 >= known[-1][0] or k is known[-2])
            slope = np.log(known[-1][1] / first[1]) / np.log(known[-1][0] / first[0])
            rows.append([
                "", f"{first[0]:,} to {known[-1][0]:,}", f"exponent {slope:.2f}", "", "", "",
            ])  # fmt: skip
    return table(["box", "discs", "to one cluster", "each disc", "events", "asked for"], rows)


def references() -> list[str]:
    """Compare all three methods on the same systems, in the same run."""
    rows = []
    for fraction in (0.1, 0.3):
        for side in (20, 40):
            system = sp.lattice(side**2, fraction, seed=1)
            fast = min(seconds(sp.Windowed, system)[0] for _ in range(5))
            cells, pairs = (seconds(m, system)[0] for m in (sp.Cells, sp.AllPairs))
            rows.append([
                f"{fraction:g}", f"{side**2:,}", f"{pairs:.3g} s", f"{cells:.3g} s",
                f"{1e3 * fast:.2g} ms", f"{pairs / fast:.0f}", f"{cells / fast:.0f}",
            ])  # fmt: skip
            print(*rows[-1], flush=True)
    header = ["volume fraction", "discs", "all-pairs", "cells", "windowed", "all-pairs / windowed"]
    return table([*header, "cells / windowed"], rows)


def memory(discs: int) -> list[str]:
    """Peak of the resident memory over what Python and the compiled code take."""
    side, each, _ = measured_peak(discs)
    return [f"Memory of a run of {side**2:,} discs, its system included: {each:.0f} bytes a disc."]


def measured_peak(discs: int) -> tuple[int, float, float]:
    """Side of the lattice, bytes a disc and processor seconds, of a process of its own."""
    side = round(discs**0.5)
    out = subprocess.run(
        [sys.executable, __file__, "peak", str(side)], capture_output=True, text=True, check=True
    )
    each, cost = map(float, out.stdout.split())
    return side, each, cost


def memories() -> list[str]:
    """Table of the memory by the number of discs."""
    rows = []
    for discs in (100_000, 1_000_000, 10_000_000):
        side, each, cost = measured_peak(discs)
        rows.append([f"{side**2:,}", f"{each:.0f}", f"{each * side**2 / 2**30:.2f} GiB",
                     f"{cost:.3g} s", "400"])  # fmt: skip
        print(*rows[-1], flush=True)
    return table(["discs", "bytes a disc", "in all", "processor time", "asked for"], rows)


def power_law(generator: np.random.Generator, n: int) -> np.ndarray:
    """Radii from 1 to 100, with a density that falls as ``r**-2.5``."""
    return (1 + generator.random(n) * (100**-1.5 - 1)) ** (1 / -1.5)


def radii() -> list[str]:
    """Table of the cost by the distribution of radii, at equal volume fraction and number."""
    rows = []
    kinds = (
        ("equal", None),
        ("lognormal, 1.3", sp.lognormal_radii(1.3)),
        ("lognormal, 2", sp.lognormal_radii(2.0)),
        ("power law, 1 to 100", power_law),
    )
    for dimension in (2, 3):
        compiled(dimension)
        seconds(sp.Windowed, sp.random(64, 0.1, radii=power_law, dimension=dimension, seed=1))
        for discs in (10_000, 50_000):
            equal = 0.0
            for name, drawn in kinds:
                system = sp.random(discs, 0.1, radii=drawn, dimension=dimension, seed=1)
                cost, events = min(seconds(sp.Windowed, system) for _ in range(2))
                equal = equal or cost
                rows.append([
                    f"{dimension}D", f"{discs:,}", name,
                    f"{system.radius.max() / system.radius.min():.0f}", f"{cost:.3g} s",
                    f"{cost / equal:.1f}", f"{events:,}",
                ])  # fmt: skip
                print(*rows[-1], flush=True)
    header = ["box", "discs", "radii", "largest / smallest", "to one cluster", "/ equal radii"]
    return table([*header, "events"], rows)


def highest() -> int:
    """Peak of the resident memory of this process in bytes; that of `getrusage` is inherited."""
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.partition("VmHWM:")[2].split()[0])


def peak(side: int) -> None:
    """Print bytes a disc and processor seconds; runs in a process of its own."""
    seconds(sp.Windowed, sp.lattice(400, 0.1, seed=1))
    before = highest()
    system = sp.lattice(side**2, 0.1, seed=1)
    start = time.process_time()
    run = sp.Windowed().start(system, np.empty(0))
    while run.clusters > side**2 // 10 and run.advance(np.inf, 1, 1 << 16) is None:
        pass
    print((highest() - before) / side**2, time.process_time() - start)


def main() -> None:
    if sys.argv[1:2] == ["peak"]:
        peak(int(sys.argv[2]))
        return
    if sys.argv[1:2] == ["memory"]:
        lines = [
            "2D, volume fraction 0.1, the system included, down to a tenth of the clusters.",
            "",
        ]
        write_section("spatial-memory", "Memory of discs in a box", [*lines, *memories()])
        return
    if sys.argv[1:2] == ["radii"]:
        lines = ["Random positions, volume fraction 0.1, speeds of 1, reflecting walls.", ""]
        write_section("spatial-radii", "Radii that differ widely", [*lines, *radii()])
        return
    large = "large" in sys.argv[1:]
    lines = [
        "Discs on a lattice, speeds of 1, reflecting walls, until one cluster is left.",
        "",
        *windowed(large),
        "",
        *references(),
        "",
        *memory(1_000_000 if large else _SMALL),
    ]
    write_section("spatial", "Discs in a box", lines)


if __name__ == "__main__":
    main()
