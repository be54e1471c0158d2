"""Start-up: import, help, the first simulation with and without compiled code on disk."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

from benchmarks.common import table, write_section

_TINY = """
import smolux as sx
model = sx.Model(kernel=sx.kernels.Ballistic(),
                 processes=[sx.processes.Aggregation(), sx.processes.Shattering(0.01)])
sx.simulate(model, times=[1.0], particles=1000, replicas=2, seed=1, method={method!r})
"""


def seconds(command: list[str], folder: str) -> tuple[float, float]:
    """Wall and processor seconds of a new process, with compiled code kept in `folder`."""
    environment = dict(os.environ, SMOLUX_CACHE_DIR=folder)
    before, start = os.times(), time.perf_counter()
    subprocess.run(command, check=True, env=environment, stdout=subprocess.DEVNULL)
    wall, after = time.perf_counter() - start, os.times()
    cpu = (
        after.children_user + after.children_system - before.children_user - before.children_system
    )
    return wall, cpu


def main() -> None:
    python, folder = sys.executable, tempfile.mkdtemp()
    program = Path(python).with_name("smolux")
    helper = [str(program), "--help"] if program.exists() else [python, "-m", "smolux", "--help"]
    tiny = {m: [python, "-c", _TINY.format(method=m)] for m in ("acceptance-rejection", "inverse")}
    cases = {
        "Python alone": [python, "-c", "pass"],
        "import smolux": [python, "-c", "import smolux"],
        "smolux --help": helper,
        **{f"tiny simulation, {m}, compiled code on disk": c for m, c in tiny.items()},
    }
    rows = []
    try:
        for m, command in tiny.items():
            wall, cpu = seconds(command, folder)
            rows.append(
                [f"tiny simulation, {m}, nothing compiled", f"{wall:.2f}", f"{cpu:.2f}", "–"]
            )
        measured = {name: [] for name in cases}
        for _ in range(5):
            for name, command in cases.items():
                measured[name].append(seconds(command, folder))
    finally:
        shutil.rmtree(folder)
    for name, values in measured.items():
        wall, cpu = np.median(values, axis=0)
        goal = "2" if name.startswith("tiny") else "–"
        rows.append([name, f"{wall:.2f}", f"{cpu:.2f}", goal])
    head = ["new process", "wall, s", "processor, s", "target, s"]
    lines = [
        "Seconds to the end of a new process, medians of five, interleaved (cold: one):",
        "",
        *table(head, rows),
    ]
    write_section("startup", "Start-up", lines)


if __name__ == "__main__":
    main()
