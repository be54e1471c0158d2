"""A hand-written acceptance-rejection loop, flat and without any structure: the yardstick.

It simulates aggregation with shattering for one kernel, with the random generator of the package,
the exponential clock and the doubling of the volume. It knows nothing else: sizes in one array, no
grouping of monomers, no output, no checks, no bound that is renewed but the one written out here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from smolux.core import rng
from smolux.core.seeds import streams


def flat_loop(rate: Callable[..., Any], constant: bool) -> Callable[..., Any]:
    """Compile the loop for a kernel; a constant one needs no rejection and no largest size.

    The bound of another kernel is taken at (1, largest), where the ballistic kernel has it.
    """

    @numba.njit(error_model="numpy", nogil=True)
    def run(state, sizes, n, shattering, end):  # type: ignore[no-untyped-def]
        volume, t, half = float(n), 0.0, n // 2
        share = shattering / (1.0 + shattering)
        largest, events, trials, since = 1, 0, 0, 0
        bound = rate(1.0, 1.0)
        while n > 1:
            trials += 1
            t += (
                rng.exponential(state) * 2.0 * volume / (n * (n - 1.0) * bound * (1.0 + shattering))
            )
            if t >= end:
                break
            a = np.int64(rng.uniform(state) * n)
            b = np.int64(rng.uniform(state) * (n - 1))
            b += b >= a
            i, j = sizes[a], sizes[b]
            if not constant and rng.uniform(state) * bound >= rate(float(i), float(j)):
                continue
            events += 1
            since += 1
            if shattering > 0.0 and rng.uniform(state) < share:
                sizes[a] = 1
                sizes[b] = 1
                for k in range(n, n + i + j - 2):
                    sizes[k] = 1
                n += i + j - 2
            else:
                sizes[a] = i + j
                sizes[b] = sizes[n - 1]
                n -= 1
                if not constant and i + j > largest:
                    largest = i + j
                    bound = max(rate(1.0, float(largest)), rate(1.0, 1.0))
            if not constant and since > n:
                since, largest = 0, 1
                for k in range(n):
                    largest = max(largest, sizes[k])
                bound = max(rate(1.0, float(largest)), rate(1.0, 1.0))
            while n <= half:
                for k in range(n):
                    sizes[n + k] = sizes[k]
                n *= 2
                volume *= 2.0
        return events, trials, n, volume

    return run


@numba.njit(error_model="numpy")
def constant_rate(i: float, j: float) -> float:
    return 1.0


@numba.njit(error_model="numpy")
def ballistic_rate(i: float, j: float) -> float:
    s = np.cbrt(i) + np.cbrt(j)
    return s * s * math.sqrt(1.0 / i + 1.0 / j)


def new_sizes(particles: int, room: float = 1.1) -> np.ndarray:
    """Monomers, with room for what shattering makes."""
    sizes = np.zeros(int(room * particles) + 1024, np.int64)
    sizes[:particles] = 1
    return sizes


def stream(seed: int) -> np.ndarray:
    """State of the random generator."""
    return streams(seed, 0, 1)[0].copy()
