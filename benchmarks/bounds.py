"""What bounds of a smooth law of the user cost, relative to what four corners and a run cost.

Ratios of processor times, which a busy machine disturbs less: with nothing remembered, in the same
process again, and in a new process.
"""

from __future__ import annotations

import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

import smolux as sx
from benchmarks.common import table, write_section
from smolux.stochastic import bounds_cache, tables

_REPEATS = 5


def fuchs(i: float, j: float) -> float:
    """N. A. Fuchs's coagulation of spheres of 10 nm and more in air."""
    a, b = 1e-8 * i ** (1 / 3), 1e-8 * j ** (1 / 3)
    free, heat, drag = 66e-9, 1.38e-23 * 300, 6 * math.pi * 1.8e-5
    da = heat * (1 + free / a * (1.257 + 0.4 * math.exp(-1.1 * a / free))) / (drag * a)
    db = heat * (1 + free / b * (1.257 + 0.4 * math.exp(-1.1 * b / free))) / (drag * b)
    speed = math.sqrt(6 * heat / (math.pi**2 * 1000))
    va, vb = speed * a**-1.5, speed * b**-1.5
    la, lb = 8 * da / (math.pi * va), 8 * db / (math.pi * vb)
    ga = ((2 * a + la) ** 3 - (4 * a * a + la * la) ** 1.5) / (6 * a * la) - 2 * a
    gb = ((2 * b + lb) ** 3 - (4 * b * b + lb * lb) ** 1.5) / (6 * b * lb) - 2 * b
    s, d, g = a + b, da + db, math.sqrt(ga * ga + gb * gb)
    return 4e15 * math.pi * s * d / (s / (s + g) + 4 * d / (math.sqrt(va * va + vb * vb) * s))


def branch(i: float, j: float) -> float:
    """Return the same, in a way that neither arrays nor intervals follow."""
    if i > j:
        i, j = j, i
    return fuchs(i, j)


def processor(work: Callable[[], Any]) -> float:
    """Processor seconds, the least of some."""
    found = []
    for _ in range(_REPEATS):
        start = time.process_time()
        work()
        found.append(time.process_time() - start)
    return min(found)


def run(kernel: Any, method: str) -> float:
    """Processor seconds for bounds of 4 runs of 1000 particles."""
    ds = sx.simulate(sx.Model(kernel), [1.0], particles=1000, replicas=4, seed=1, method=method)
    return float(ds.attrs["bounds_seconds"])


def forget() -> None:
    """Forget what this process knows."""
    bounds_cache._bounds_of.cache_clear()
    tables.latest.forget()


def runs(law: Callable[..., float], method: str) -> list[str]:
    """One row: the first run, the second one, and one of a new process."""
    kernel, code = sx.kernels.from_function(law), os.environ["SMOLUX_CACHE_DIR"]
    run(kernel, method)  # compiles
    shutil.rmtree(Path(code) / "bounds", ignore_errors=True)
    forget()
    first, again = run(kernel, method), run(kernel, method)
    program = (
        "import smolux as sx; from benchmarks import bounds\n"
        f"print(bounds.run(sx.kernels.from_function(bounds.{law.__name__}), {method!r}))"
    )
    home = Path(__file__).resolve().parent.parent
    done = subprocess.run(
        [sys.executable, "-c", program], check=True, capture_output=True, text=True, cwd=home
    )
    other = float(done.stdout.split()[-1])
    return [law.__name__, method, *(f"{1e3 * x:.0f}" for x in (first, again, other))]


def main() -> None:
    kernel = sx.kernels.from_function(fuchs)
    edges = np.array([1.0, 1000.0])
    corners = processor(lambda: kernel(edges[:, None], edges))
    one = processor(lambda: kernel.bounds(1, 1000, 1, 1000))
    classes = np.unique(np.rint(2.0 ** (np.arange(2, 25) / 2)))
    g, h = np.triu_indices(len(classes) - 1)
    many = (classes[g], classes[g + 1] - 1, classes[h], classes[h + 1] - 1)
    all_pairs = processor(lambda: kernel.bounds(*many)) / len(g)
    upper = float(kernel.bounds(1, 1000, 1, 1000)[1])
    highest = float(kernel(np.geomspace(1, 1000, 300)[:, None], np.geomspace(1, 1000, 300)).max())
    os.environ["SMOLUX_CACHE_DIR"] = tempfile.mkdtemp()
    try:
        rows = [
            runs(law, method)
            for law, methods in (
                (fuchs, ("size-class", "acceptance-rejection")),
                (branch, ("inverse",)),
            )
            for method in methods
        ]
    finally:
        shutil.rmtree(os.environ["SMOLUX_CACHE_DIR"])
    lines = [
        "A law of some sixty operations, one plain function of i and j. Processor time, the least "
        f"of {_REPEATS}, relative to four corners in Python ({1e3 * corners:.2f} ms): one box of "
        f"the sizes 1 to 1000, {one / corners:.0f}; a pair of classes among {len(g)}, "
        f"{all_pairs / corners:.2f}. The bound is {100 * (upper / highest - 1):.1f} % above the "
        "largest value.",
        "",
        "Processor milliseconds for bounds and tables in a run of 4 × 1000 particles "
        "(`bounds_seconds`):",
        "",
        *table(["law", "method", "first", "again", "in a new process"], rows),
    ]
    write_section("bounds", "Bounds of laws of the user", lines)


if __name__ == "__main__":
    main()
