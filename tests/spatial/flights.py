"""Runs without results: quick, and near to the methods."""

from __future__ import annotations

import numpy as np

import smolux.spatial as sp
from smolux.spatial.methods.base import SpatialMethod
from smolux.spatial.results.trace import Trace

METHODS = {method.name: method for method in sp.METHODS if method.exact}

#: walls of the three axes
WALLS = (("reflecting",) * 3, ("periodic",) * 3, ("periodic", "reflecting", "periodic"))


def system(number: int, dimension: int = 2, most: int = 60) -> sp.System:
    """One of many systems: all kinds of walls, radii, densities and velocities."""
    rng = np.random.default_rng(number)
    walls = WALLS[number // 3 % 3][:dimension]
    phi = float(rng.choice([0.02, 0.1, 0.3, 0.5][: 4 if dimension == 2 else 2]))
    common = {"dimension": dimension, "walls": walls, "seed": number}
    if phi == 0.5:
        side = int(rng.integers(3, int(most ** (1 / dimension)) + 1))
        return sp.lattice(side**dimension, phi, **common)
    return sp.random(
        int(rng.integers(6, most)),
        phi,
        radii=[None, sp.lognormal_radii(1.2), sp.bimodal_radii(2.0, 0.1)][number % 3],
        velocities="maxwellian" if number % 2 else "unit",
        **common,
    )


def wide_system(number: int, dimension: int = 2, most: int = 100) -> sp.System:
    """One of many systems whose radii differ by a factor of 50 to 200."""
    rng = np.random.default_rng(number)
    n = int(rng.integers(most // 2, most))
    ratio = float(rng.uniform(50, 200))
    # few large discs: by a power law, or two kinds
    radii = ratio ** (rng.random(n) ** 2 if number % 2 else rng.random(n) < 0.1)
    radii[:2] = 1, ratio
    return sp.random(
        n,
        float(rng.choice([0.02, 0.1] if dimension == 2 else [0.005, 0.02])),
        radii=radii,
        dimension=dimension,
        walls=WALLS[number // 2 % 3][:dimension],
        velocities="maxwellian" if number // 4 % 2 else "unit",
        seed=number,
    )


def run(system: sp.System, method: str | SpatialMethod, until: float = np.inf, clusters: int = 1):
    """Run to the end; return the trace, with the reason why it ended."""
    chosen = METHODS[method]() if isinstance(method, str) else method
    current = chosen.start(system, np.empty(0))
    while (stopped := current.advance(until, clusters, 1 << 16)) is None:
        pass
    trace = current.trace()
    trace.stopped = stopped
    return trace


def merges(trace: Trace) -> np.ndarray:
    """Pairs of discs, in the order in which they met."""
    log = trace.log
    return np.stack([log.first, log.second], 1)[log.merges]


def assert_same(one: Trace, other: Trace) -> None:
    """Check that two runs made the same merges at the same times, and ended in the same places."""
    np.testing.assert_array_equal(merges(one), merges(other))
    times = (trace.log.time[trace.log.merges] for trace in (one, other))
    np.testing.assert_allclose(*times, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(one.position, other.position, rtol=0, atol=1e-8)
    np.testing.assert_array_equal(one.cluster, other.cluster)
