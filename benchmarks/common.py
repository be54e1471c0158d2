"""Clocks, medians and the page of results, shared by the benchmarks."""

from __future__ import annotations

import datetime
import os
import platform
import re
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import smolux as sx
from smolux.stochastic.make_plan import make_plan
from smolux.stochastic.replicas import Group

RESULTS = Path(__file__).with_name("RESULTS.md")


def model(kernel: Any, shattering: float = 0.0) -> sx.Model:
    """Make aggregation of monomers, with shattering if its rate is above zero."""
    processes = [sx.processes.Aggregation()]
    if shattering > 0:
        processes.append(sx.processes.Shattering(shattering))
    return sx.Model(kernel=kernel, processes=processes)


def group_of(
    physics: sx.Model, end: float | Sequence[float], particles: int, method: str, seed: int = 1
) -> Group:
    """Prepare one replica, compiled, ready to run to one output time or through several."""
    plan = make_plan(
        physics,
        end,
        method=method,
        particles=particles,
        replicas=1,
        seed=seed,
        orders=(0, 1, 2),
        sizes=1024,
    )
    group = Group.start(plan, 0, 1)
    group.compile()
    return group


def loop_seconds(group: Group, stop: Callable[[], bool] = lambda: False) -> float:
    """Processor seconds of the event loop; a shared machine disturbs them less than wall time."""
    start = time.thread_time()
    group.advance(stop)
    return time.thread_time() - start


def interleaved(measures: Sequence[Callable[[], float]], repeats: int) -> np.ndarray:
    """Run A B A B ...; array of shape (repeats, measures)."""
    return np.array([[measure() for measure in measures] for _ in range(repeats)])


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a table in Markdown."""
    return ["| " + " | ".join(row) + " |" for row in [header, ["---"] * len(header), *rows]]


def write_section(name: str, title: str, lines: Sequence[str]) -> None:
    """Put a section into the page of results, in the place of its older self."""
    import numba
    import scipy

    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    versions = (
        f"smolux {sx.__version__}, Python {platform.python_version()}, NumPy {np.__version__}, "
        f"SciPy {scipy.__version__}, Numba {numba.__version__}"
    )
    when = f"{datetime.date.today().isoformat()}, 2 cores of a server CPU ({platform.machine()})"
    note = f"*{when}, load average {load:.1f}; {versions}.*"
    body = "\n".join(
        [f"<!-- begin {name} -->", f"## {title}", "", note, "", *lines, f"<!-- end {name} -->"]
    )
    page = RESULTS.read_text() if RESULTS.exists() else _HEAD
    pattern = re.compile(f"<!-- begin {name} -->.*?<!-- end {name} -->", re.S)
    page = (
        pattern.sub(lambda _: body, page) if pattern.search(page) else f"{page.rstrip()}\n\n{body}"
    )
    RESULTS.write_text(page.rstrip() + "\n")
    print("\n".join(lines))


_HEAD = """# Benchmarks

Ratios within one run on one machine, never absolute times of different machines. Seconds are
processor seconds of one core, medians of interleaved repetitions (A B A B ...), unless a table says
"wall". Other programs were running on the machine, so caches and memory were shared. Run again with

```
python benchmarks/speed.py
python benchmarks/startup.py
python benchmarks/memory.py
python benchmarks/solver.py
python benchmarks/flat_low_rank.py
python benchmarks/osinsky_2022.py
python benchmarks/kolodko_2003.py
python benchmarks/estimators.py
python benchmarks/auto.py
python benchmarks/parallel.py
python benchmarks/breakage.py
python benchmarks/composition.py
python benchmarks/bounds.py
```
"""
