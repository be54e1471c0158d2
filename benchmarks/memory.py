"""Memory: peak at 10^7 particles, and no growth with the number of events."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

PARTICLES = 10_000_000

_PEAK = """
import json, resource, sys
import smolux as sx
case, particles = sys.argv[1], int(sys.argv[2])
initial = {{"monodisperse": sx.initial.monodisperse(),
           "sizes 1 to 10": sx.initial.from_sizes(dict.fromkeys(range(1, 11), 0.1)),
           "exponential, mean 10": sx.initial.exponential(10.0)}}[case]
model = sx.Model(kernel=sx.kernels.Constant(), initial=initial,
                 processes=[sx.processes.Aggregation(), sx.processes.Shattering(0.1)])
options = dict(times=[2.0], replicas=1, seed=1, method={method!r})
def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
sx.simulate(model, particles=1000, **options)
before = peak()
ds = sx.simulate(model, particles=particles, **options)
print(json.dumps([before, peak(), float(ds["collisions"].sum())]))
"""

_GROWTH = """
import json, os
import smolux as sx
def resident():
    with open("/proc/self/statm") as f:
        return int(f.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
model = sx.Model(kernel=sx.kernels.Constant(),
                 processes=[sx.processes.Aggregation(), sx.processes.Shattering(0.1)])
found = []
for end in (20.0, 20.0, 200.0, 2000.0, 20000.0):
    ds = sx.simulate(model, times=[end], particles=5000, replicas=1, seed=1, method={method!r})
    found.append([float(ds["collisions"].sum()), resident()])
print(json.dumps(found[1:]))
"""


def _child(text: str, *arguments: str) -> list:
    done = subprocess.run(
        [sys.executable, "-c", text, *arguments], check=True, capture_output=True, text=True
    )
    return json.loads(done.stdout.splitlines()[-1])


def main() -> None:
    from benchmarks.common import table, write_section

    rows = []
    for method, case in (
        ("acceptance-rejection", "monodisperse"),
        ("acceptance-rejection", "sizes 1 to 10"),
        ("acceptance-rejection", "exponential, mean 10"),
        ("inverse", "monodisperse"),
    ):
        before, peak, _ = _child(_PEAK.format(method=method), case, str(PARTICLES))
        each = (peak - before) / PARTICLES
        rows.append([method, case, f"{before / 2**20:.0f}", f"{peak / 2**20:.0f}", f"{each:.1f}",
                     "16", "yes" if each < 16 else "**no**"])  # fmt: skip
        print(rows[-1], flush=True)
    head = [
        "method",
        "initial sizes",
        "before, MiB",
        "peak, MiB",
        "bytes per particle",
        "target",
        "met",
    ]
    lines = [
        "Peak resident memory of one run at N = 10^7, above that after a run of 1000 particles:",
        "",
    ]
    lines += [
        *table(head, rows),
        "",
        "Resident memory against the number of collisions, N = 5000, one process:",
        "",
    ]
    rows = []
    for method in ("acceptance-rejection", "inverse"):
        found = _child(_GROWTH.format(method=method))
        first = found[0][1]
        rows += [
            [method, f"{events:.3g}", f"{(resident - first) / 1024:+.0f}"]
            for events, resident in found
        ]
    lines += table(["method", "collisions", "change of resident memory, KiB"], rows)
    write_section("memory", "Memory", lines)


if __name__ == "__main__":
    main()
