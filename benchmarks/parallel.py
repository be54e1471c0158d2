"""Two workers against one: replicas on threads, processes and Dask; one system as sub-volumes."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import smolux as sx
from benchmarks.common import interleaved, table, write_section

MODEL = sx.Model(kernel=sx.kernels.Ballistic())
REPEATS = 3

_LARGE = """
import json, resource, sys, time
import smolux as sx
parts, particles, end = int(sys.argv[1]), int(float(sys.argv[2])), float(sys.argv[3])
model = sx.Model(kernel=sx.kernels.Ballistic())
def run(particles, end):
    return sx.simulate(model, [end], particles=particles, replicas=1, seed=2, subvolumes=parts,
                       method="size-class")
run(5000, 0.1)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
start = time.perf_counter()
events = run(particles, end).attrs["events"]
wall = time.perf_counter() - start
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps([wall, events, (peak - before) * 1024 / particles]))
"""


@contextmanager
def _dask(workers: int) -> Iterator[Executor]:
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        yield client


KINDS: dict[str, Callable[[int], object]] = {
    "threads": ThreadPoolExecutor,
    "processes": ProcessPoolExecutor,
    "Dask": _dask,
}


def _replicas(executor: object) -> float:
    """Wall seconds of four replicas of a second or so, on workers that are warm."""
    start = time.perf_counter()
    sx.simulate(
        MODEL, [10.0], particles=8_000_000, replicas=4, seed=1, method="size-class",
        executor=executor,  # type: ignore[arg-type]
    )  # fmt: skip
    return time.perf_counter() - start


def _workers(kind: str) -> list[str]:
    make = KINDS[kind]
    with make(1) as one, make(2) as two:  # type: ignore[attr-defined]
        for executor in (one, two):
            sx.simulate(MODEL, [0.1], particles=100_000, replicas=8, seed=1, method="size-class",
                        executor=executor)  # fmt: skip
        seconds = interleaved([lambda: _replicas(one), lambda: _replicas(two)], REPEATS)
    single, double = (sorted(column)[REPEATS // 2] for column in seconds.T)
    target = 1.7 if kind == "Dask" else 1.8
    ratio = single / double
    return [kind, f"{single:.2f}", f"{double:.2f}", f"{ratio:.2f}", f"{target}",
            "yes" if ratio >= target else "**no**"]  # fmt: skip


def _large(parts: int, particles: float, end: float) -> tuple[float, float, float]:
    done = subprocess.run(
        [sys.executable, "-c", _LARGE, str(parts), str(particles), str(end)],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    wall, events, memory = json.loads(done.stdout.splitlines()[-1])
    return wall, events, memory


def main() -> None:
    kinds = [k for k in KINDS if k != "Dask" or importlib.util.find_spec("distributed")]
    rows = []
    for kind in kinds:
        rows.append(_workers(kind))
        print(rows[-1], flush=True)
    large = []
    for particles, end in ((1e6, 100.0), (1e7, 20.0), (1e8, 10.0)):
        found = [_large(parts, particles, end) for parts in (1, 2)]
        for parts, (wall, events, memory) in enumerate(found, 1):
            gain = found[0][0] / wall
            large.append([f"{particles:.0e}", f"{end:g}", str(parts), f"{wall:.2f}",
                          f"{events / 1e6:.1f}", f"{1e9 * wall / events:.1f}", f"{gain:.2f}",
                          f"{memory:.1f}"])  # fmt: skip
            print(large[-1], flush=True)
    lines = [
        "Four replicas of 8 10^6 particles, ballistic kernel, to t = 10, wall seconds:",
        "",
        *table(["workers are", "one, s", "two, s", "ratio", "target", "met"], rows),
        "",
        "One system, ballistic kernel, size-class method, in so many sub-volumes; the volume is "
        "doubled at a mixing, and so somewhat later, which saves collisions, too:",
        "",
        *table(["N", "t", "sub-volumes", "wall, s", "10^6 collisions", "ns per collision",
                "wall ratio", "bytes per particle"], large),
    ]  # fmt: skip
    write_section("parallel", "Two workers", lines)


if __name__ == "__main__":
    main()
