"""A hand-written low-rank loop, flat and without any structure: the yardstick of that method.

It simulates aggregation from monomers for one kernel: segment trees of fan-out 4 over slots of
sizes, 64 an octave, the factors of the majorant at their bounds over each slot in whole quanta, the
exponential clock, the doubling of the volume. It knows nothing else: no output, no other processes,
no checks, quanta chosen once, arrays that never grow, particles that move to the end of one array
when their slot is full.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numba
import numpy as np

import smolux as sx
from benchmarks.common import group_of, interleaved, loop_seconds, model, table, write_section
from benchmarks.flat import stream
from smolux.core import rng
from smolux.core.slots import slot_edges, slot_of
from smolux.core.state import TRIALS
from smolux.methods.low_rank.majorants import from_powers
from smolux.methods.low_rank.segment_tree import levels_of

_BITS = 6
_COUNTED = 2 << _BITS
#: quanta in the first sum of each row
_AIM = 2.0**40
#: kernel, end, octaves that its sizes reach, nanoseconds of the paper on its hardware
CASES = (
    (sx.kernels.Brownian(), 10.0, 10, 1e9 * 3.5 / 2.3e7),
    (sx.kernels.Brownian(), 1000.0, 17, 1e9 * 11.0 / 5.5e7),
    (sx.kernels.Brownian(), 100_000.0, 24, 1e9 * 27.0 / 8.9e7),
    (sx.kernels.Ballistic(), 1.0, 8, 1e9 * 4.4 / 1.1e7),
    (sx.kernels.Ballistic(), 50.0, 15, 1e9 * 23.0 / 4.3e7),
    (sx.kernels.Ballistic(), 5000.0, 23, 1e9 * 58.0 / 8.3e7),
    (sx.kernels.Additive(), 1.0, 9, 1e9 * 0.89 / 7.6e6),
    (sx.kernels.Additive(), 3.0, 15, 1e9 * 3.5 / 2.2e7),
    (sx.kernels.Additive(), 6.0, 24, 1e9 * 6.7 / 4.4e7),
)


@numba.njit(error_model="numpy")
def _down(tree, levels, row, x):  # type: ignore[no-untyped-def]
    slot = 0
    for level in range(levels.shape[0] - 2, -1, -1):
        first = levels[level] + 4 * slot
        one = tree[row, first]
        two = one + tree[row, first + 1]
        three = two + tree[row, first + 2]
        before = one if x >= one else 0
        before = two if x >= two else before
        before = three if x >= three else before
        slot = 4 * slot + (x >= one) + (x >= two) + (x >= three)
        x -= before
    return slot, x


@numba.njit(error_model="numpy")
def _pick(state, tree, levels, row, grains, number):  # type: ignore[no-untyped-def]
    root = tree[row, tree.shape[1] - 1]
    slot, x = _down(tree, levels, row, min(np.int64(rng.uniform(state) * root), root - 1))
    return slot, min(np.int64(float(x) / grains[slot, row]), np.int64(number[slot]) - 1)


def flat_loop(rate: Callable[..., Any]) -> Callable[..., Any]:  # noqa: C901
    """Compile the loop for a kernel."""

    @numba.njit(error_model="numpy", nogil=True)
    def run(state, n, end, tables, number, tree, levels, start, room, pool):  # type: ignore[no-untyped-def]  # noqa: C901
        grains, share, weight, term = tables
        volume, t, half = float(n), 0.0, n // 2
        events, trials, tail = 0, 0, 0
        rows, root = tree.shape[0], tree.shape[1] - 1
        number[1] = n
        for row in range(rows):
            for level in range(levels.shape[0]):
                tree[row, levels[level] + (1 if level == 0 else 0)] = n * np.int64(grains[1, row])
        while n > 1:
            total = 0.0
            for k in range(weight.shape[0]):
                total += weight[k] * (float(tree[term[k, 0], root]) * float(tree[term[k, 1], root]))
            trials += 1
            t += rng.exponential(state) * volume / total
            if t >= end:
                break
            k = 0
            if weight.shape[0] > 1:
                x = rng.uniform(state) * total
                while k < weight.shape[0] - 1:
                    left, right = tree[term[k, 0], root], tree[term[k, 1], root]
                    x -= weight[k] * (float(left) * float(right))
                    if x < 0.0:
                        break
                    k += 1
            a, ka = _pick(state, tree, levels, term[k, 0], grains, number)
            b, kb = _pick(state, tree, levels, term[k, 1], grains, number)
            if a == b and ka == kb:
                continue
            i = a if a < _COUNTED else pool[start[a] + ka]
            j = b if b < _COUNTED else pool[start[b] + kb]
            x = rng.uniform(state)
            if x >= share[a] * share[b]:
                bound = 0.0
                for k in range(weight.shape[0]):
                    left, right = term[k, 0], term[k, 1]
                    bound += weight[k] * (
                        grains[a, left] * grains[b, right] + grains[b, left] * grains[a, right]
                    )
                if x * bound >= rate(float(i), float(j)):
                    continue
            events += 1
            n -= 1
            if a == b and ka < kb:
                ka, kb = kb, ka
            number[a] -= 1.0
            if a >= _COUNTED:
                pool[start[a] + ka] = pool[start[a] + np.int64(number[a])]
            number[b] -= 1.0
            if b >= _COUNTED:
                pool[start[b] + kb] = pool[start[b] + np.int64(number[b])]
            c = slot_of(i + j, _BITS)
            if c >= _COUNTED:
                m = np.int64(number[c])
                if m == room[c]:
                    room[c] += room[c] // 2 + 16
                    for k in range(m):
                        pool[tail + k] = pool[start[c] + k]
                    start[c] = tail
                    tail += room[c]
                pool[start[c] + m] = i + j
            number[c] += 1.0
            for row in range(rows):
                ga, gb = np.int64(grains[a, row]), np.int64(grains[b, row])
                gc, p, q, r = np.int64(grains[c, row]), a, b, c
                for level in range(levels.shape[0]):
                    tree[row, levels[level] + p] -= ga
                    tree[row, levels[level] + q] -= gb
                    tree[row, levels[level] + r] += gc
                    p, q, r = p >> 2, q >> 2, r >> 2
            while n <= half:
                for c in range(number.shape[0]):
                    m = np.int64(number[c])
                    if c >= _COUNTED and m > 0:
                        room[c] = 2 * m + m // 2 + 16
                        for k in range(m):
                            pool[tail + k] = pool[start[c] + k]
                            pool[tail + m + k] = pool[start[c] + k]
                        start[c] = tail
                        tail += room[c]
                    number[c] *= 2.0
                tree *= 2
                n *= 2
                volume *= 2.0
        return events, trials

    return run


def new_arrays(kernel: Any, particles: int, octaves: int) -> tuple[Any, ...]:
    """Make tables and empty arrays for sizes below ``2**octaves``."""
    edges = slot_edges(_BITS)
    slots = -(-int(np.searchsorted(edges, 1 << octaves)) // 4) * 4
    given = from_powers(kernel.majorant(), edges)
    factor = given.factor[0, :slots]
    scale = _AIM / (particles * factor[1])
    grains = np.floor(factor * scale) + 1.0
    exact = (factor[1:] * scale / grains[1:]).min(axis=1)
    share = given.shares[0, :slots] * np.append(0.0, exact)
    left, right = given.term[0].T
    weight = given.weights[0] / (scale[left] * scale[right] * given.units[0])
    levels = levels_of(slots)
    return (
        (grains, share, weight, given.term[0]),
        np.zeros(slots),
        np.zeros((grains.shape[1], levels[-1] + 1), np.int64),
        levels,
        np.zeros(slots, np.int64),
        np.zeros(slots, np.int64),
        np.zeros(40 * particles + (1 << 20), np.int64),
    )


def _measures(kernel: Any, end: float, octaves: int, particles: int) -> tuple[Any, Any, list[Any]]:
    inner, p = numba.njit(error_model="numpy")(kernel.rate), kernel.parameters
    # all laws here have one or two parameters
    if len(p) == 2:
        first, second = p
        rate = numba.njit(lambda i, j: inner(i, j, first, second), error_model="numpy")
    else:
        (only,) = p
        rate = numba.njit(lambda i, j: inner(i, j, only), error_model="numpy")
    run = flat_loop(rate)
    run(stream(1), 1000, 1.0, *new_arrays(kernel, 1000, octaves))
    physics = model(kernel)
    counts: list[Any] = []

    def flat() -> float:
        arrays = new_arrays(kernel, particles, octaves)
        start = time.thread_time()
        events, trials = run(stream(1), particles, end, *arrays)
        seconds = time.thread_time() - start
        counts.append(("flat", events, trials))
        return 1e9 * seconds / events

    def ours() -> float:
        group = group_of(physics, end, particles, "low-rank")
        seconds = loop_seconds(group)
        counts.append(("smolux", group.events, int(group.state.count[0, TRIALS])))
        return 1e9 * seconds / group.events

    return flat, ours, counts


def comparison(particles: int, repeats: int) -> list[str]:
    """Measure the method against the flat loop, beside the paper's seconds."""
    rows = []
    for kernel, end, octaves, paper in CASES:
        flat, ours, counts = _measures(kernel, end, octaves, particles)
        ns = interleaved((flat, ours), repeats)
        a, b = np.median(ns, axis=0)
        events, trials = next(c[1:] for c in counts if c[0] == "smolux")
        rows.append(
            [
                kernel.name,
                f"{end:g}",
                f"{a:.0f}",
                f"{b:.0f}",
                f"{np.median(ns[:, 1] / ns[:, 0]):.2f}",
                f"{paper:.0f}",
                f"{events / trials:.3f}",
            ]
        )
        print(rows[-1], flush=True)
    head = ["kernel", "t", "flat, ns", "smolux, ns", "ratio (median)", "paper, ns", "acceptance"]
    return [
        f"Nanoseconds per collision of the low-rank method at N = {particles:.0e} against the flat "
        "loop of `flat_low_rank.py`, and the paper's seconds at N = 1e7 on its hardware:",
        "",
        *table(head, rows),
    ]


if __name__ == "__main__":
    size = int(float(sys.argv[1])) if len(sys.argv) > 1 else 10_000_000
    lines = comparison(size, 3)
    if len(sys.argv) <= 1:
        write_section("low-rank", "The low-rank method", lines)
