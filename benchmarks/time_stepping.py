"""Time stepping of discs in a box to one cluster: processor seconds, exponents, failures.

``python benchmarks/time_stepping.py``, about a minute.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

import smolux.spatial as sp
from benchmarks.common import table, write_section

_SIDES = (20, 50, 100, 200)


def seconds(method: sp.TimeStepping | sp.Windowed, system: sp.System) -> tuple[float, dict]:
    """Processor seconds to one cluster, and counts."""
    start = time.process_time()
    run = method.start(system, np.empty(0))
    while run.advance(np.inf, 1, 1 << 16) is None:
        pass
    return time.process_time() - start, run.trace().attributes


def main() -> None:
    rows = []
    for method in (sp.TimeStepping(), sp.TimeStepping(rigid=True), sp.Windowed()):
        seconds(method, sp.lattice(16, 0.1, seed=1))
    for fraction in (0.1, 0.3):
        for rigid in (False, True):
            known = []
            for side in _SIDES:
                system = sp.lattice(side**2, fraction, seed=1)
                cost, counts = seconds(sp.TimeStepping(rigid=rigid), system)
                exact, _ = seconds(sp.Windowed(), system)
                known.append(cost)
                rows.append([
                    f"{fraction:g}", "rigid" if rigid else "non-rigid", f"{side**2:,}",
                    f"{cost:.3g} s", f"{cost / exact:.0f}", f"{counts['steps']:,}",
                    f"{counts['failures']}", "10 s" if side == 100 and not rigid else "",
                ])  # fmt: skip
                print(*rows[-1], flush=True)
            slope = np.log(known[-1] / known[1]) / np.log((_SIDES[-1] / _SIDES[1]) ** 2)
            text = f"exponent {slope:.2f}"
            rows.append(["", "", f"{_SIDES[1] ** 2:,} to {_SIDES[-1] ** 2:,}", text, *[""] * 4])
            print(*rows[-1], flush=True)
    header = ["volume fraction", "clusters", "discs", "to one cluster", "over windowed", "steps"]
    lines = [
        "Steps of 0.2 radii, the default; discs on a lattice, speeds of 1, reflecting walls.",
        "",
    ]
    lines += table([*header, "failures", "asked for"], rows)
    write_section("time-stepping", "Discs in a box by time steps", lines)


if __name__ == "__main__":
    main()
