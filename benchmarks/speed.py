"""Speed of the event loop: against a flat hand-written loop, and against the paper's times."""

from __future__ import annotations

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

import smolux as sx
from benchmarks.common import group_of, interleaved, loop_seconds, model, table, write_section
from benchmarks.flat import ballistic_rate, constant_rate, flat_loop, new_sizes, stream
from smolux.core.state import TRIALS

AR, INVERSE = "acceptance-rejection", "inverse"
#: kernel, shattering rate, end, particles, repetitions
CASES = (
    ("constant", 0.1, 5000.0, 10_000, 7),
    ("constant", 0.1, 500.0, 100_000, 7),
    ("constant", 0.1, 10.0, 1_000_000, 9),
    ("constant", 0.0, 100.0, 1_000_000, 7),
    ("constant", 0.0, 10.0, 10_000_000, 3),
    ("ballistic", 0.01, 10.0, 1_000_000, 5),
)


def _flat(name: str, shattering: float, end: float, particles: int):  # type: ignore[no-untyped-def]
    rate = {"constant": constant_rate, "ballistic": ballistic_rate}[name]
    run = flat_loop(rate, name == "constant")
    run(stream(1), new_sizes(100, 50.0), 100, shattering, 1.0)
    counts = []

    def measure() -> float:
        state, sizes = stream(1), new_sizes(particles, 1.5)
        start = time.thread_time()
        events, trials, _, _ = run(state, sizes, particles, shattering, end)
        seconds = time.thread_time() - start
        counts.append((events, trials))
        return 1e9 * seconds / events

    return measure, counts


def _ours(name: str, shattering: float, end: float, particles: int):  # type: ignore[no-untyped-def]
    kernel = {"constant": sx.kernels.Constant, "ballistic": sx.kernels.Ballistic}[name]()
    physics = model(kernel, shattering)
    counts = []

    def measure() -> float:
        group = group_of(physics, end, particles, AR)
        seconds = loop_seconds(group)
        counts.append((group.events, int(group.state.count[0, TRIALS])))
        return 1e9 * seconds / group.events

    return measure, counts


def flat_comparison() -> list[str]:
    rows = []
    for name, shattering, end, particles, repeats in CASES:
        flat, flat_counts = _flat(name, shattering, end, particles)
        ours, our_counts = _ours(name, shattering, end, particles)
        ours()
        our_counts.clear()
        ns = interleaved((flat, ours), repeats)
        ratio = float(np.median(ns[:, 1] / ns[:, 0]))
        a, b = np.median(ns, axis=0)
        seconds = b * our_counts[0][0] / 1e9
        trials = " / ".join(f"{c[0][1] / c[0][0]:.2f}" for c in (flat_counts, our_counts))
        rows.append(
            [
                name,
                f"{shattering:g}",
                f"{end:g}",
                f"10^{np.log10(particles):.0f}",
                f"{a:.1f}",
                f"{b:.1f}",
                f"{ns[:, 1].min():.1f}",
                f"{ratio:.2f}",
                trials,
                f"{seconds:.3g}",
            ]
        )
        print(rows[-1], flush=True)
    head = [
        "kernel",
        "shattering",
        "t",
        "N",
        "flat, ns",
        "smolux, ns",
        "smolux, best, ns",
        "ratio (median)",
        "trials per collision",
        "smolux, s",
    ]
    return [
        "Nanoseconds per collision, acceptance-rejection against the flat loop of `flat.py`:",
        "",
        *table(head, rows),
    ]


def fixed_cost() -> list[str]:
    """Measure what a run costs however short it is: returns to Python, mostly for bounds."""
    physics = model(sx.kernels.Constant())
    groups = [group_of(physics, 100.0, 1000, AR) for _ in range(9)]
    seconds = [loop_seconds(group) for group in groups]
    return [
        f"A run of {groups[0].events} collisions takes {1e3 * np.median(seconds):.1f} ms: the loop "
        "returns to Python for a bound of the kernel each time the largest size has grown by two "
        "octaves. This is what short runs of few particles spend their time on.",
    ]


def limit() -> list[str]:
    """Measure what a collision cannot do without: draws and reads."""
    import numba

    from smolux.core import rng

    @numba.njit(error_model="numpy")
    def draws(state, n):  # type: ignore[no-untyped-def]
        x = 0.0
        for _ in range(n):
            x += rng.uniform(state)
        return x

    @numba.njit(error_model="numpy")
    def waits(state, n):  # type: ignore[no-untyped-def]
        x = 0.0
        for _ in range(n):
            x += rng.exponential(state)
        return x

    @numba.njit(error_model="numpy")
    def reads(state, sizes, n):  # type: ignore[no-untyped-def]
        x = 0
        for _ in range(n):
            x += sizes[np.int64(rng.uniform(state) * sizes.shape[0])]
        return x

    n = 5_000_000
    sizes = {m: np.ones(m, np.int64) for m in (10_000, 1_000_000, 10_000_000)}
    calls = [lambda: draws(stream(1), n), lambda: waits(stream(1), n)]
    calls += [lambda a=a: reads(stream(1), a, n) for a in sizes.values()]
    for call in calls:
        call()

    def timed(call):  # type: ignore[no-untyped-def]
        def measure() -> float:
            start = time.thread_time()
            call()
            return 1e9 * (time.thread_time() - start) / n

        return measure

    u, e, *r = np.median(interleaved([timed(c) for c in calls], 5), axis=0)
    bound = 3 * u + e
    return [
        "The limit: a collision of the constant kernel needs four draws, three uniform "
        f"({u:.1f} ns each; the pair, and process or acceptance) and one exponential ({e:.1f} ns), "
        f"together {bound:.0f} ns; two reads and two writes at random places of an array of N "
        "entries, and a division for the waiting time (about 5 ns). A read at a random place, with "
        "its draw, takes "
        + ", ".join(f"{x:.1f} ns (N = {m:.0e})" for x, m in zip(r, sizes, strict=True))
        + ", where the processor can overlap many of them; in an event loop each depends on the "
        "event before, unless it is asked for ahead.",
    ]


def paper_times() -> list[str]:
    """Entries of the paper's Table 4 that the targets name."""
    physics = model(sx.kernels.Ballistic(), 0.01)
    rows = []
    for method, particles, paper, goal in (
        (INVERSE, 100_000, 34.82, 3.48),
        (AR, 1_000_000, 0.96, 1.2),
    ):
        group_of(physics, 10.0, 1000, method)
        seconds = np.median(
            [loop_seconds(group_of(physics, 10.0, particles, method)) for _ in range(5)]
        )
        rows.append(
            [
                method,
                f"10^{np.log10(particles):.0f}",
                f"{seconds:.3g}",
                f"{paper:g}",
                f"{paper / seconds:.3g}",
                f"{goal:g}",
                "yes" if seconds <= goal else "**no**",
            ]
        )
    head = [
        "method",
        "N",
        "smolux, s",
        "paper, s (its hardware)",
        "paper / smolux",
        "target, s",
        "met",
    ]
    return ["Ballistic kernel, shattering 0.01, to t = 10:", "", *table(head, rows)]


if __name__ == "__main__":
    lines = [*flat_comparison(), "", *fixed_cost(), "", *limit(), "", *paper_times()]
    write_section("speed", "Speed of the event loop", lines)
