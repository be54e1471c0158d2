"""The whole Markov chain on the partitions of a small number, for any kernel."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smolux.errors import InputError

Float = NDArray[np.float64]

#: 37,338 partitions
MOST = 40


@lru_cache(maxsize=4)
def _partitions(n: int) -> tuple[tuple[int, ...], ...]:
    def below(rest: int, largest: int) -> list[tuple[int, ...]]:
        if rest == 0:
            return [()]
        return [
            (first, *tail)
            for first in range(min(rest, largest), 0, -1)
            for tail in below(rest - first, first)
        ]

    return tuple(below(n, n))


def partitions(n: int) -> list[tuple[int, ...]]:
    """All partitions of `n`: sizes in falling order, the single cluster first, all monomers last.

    Parameters
    ----------
    n : int
        1 to 40.
    """
    if not (isinstance(n, (int, np.integer)) and 1 <= n <= MOST):
        raise InputError(f"N = {n!r}: the partitions of 1 to {MOST} particles are served")
    return list(_partitions(int(n)))


def _events(
    kernel: Callable[[Any, Any], Any], n: int, volume: float, shattering: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], Float]:
    """From-states, to-states and rates of all events; a shattered pair of monomers changes none."""
    i = np.arange(1.0, n + 1)
    if getattr(kernel, "in_time", ()):
        raise InputError("kernel: varies in time, and the chain is that of constant rates")
    rates = np.broadcast_to(np.asarray(kernel(i[:, None], i[None, :]), float), (n, n))
    if not (np.all(np.isfinite(rates)) and np.all(rates >= 0) and np.allclose(rates, rates.T)):
        raise InputError("kernel: must give symmetric, finite rates of zero or more")
    states = _partitions(n)
    number = {state: s for s, state in enumerate(states)}
    start, end, rate = [], [], []

    def add(source: int, target: Counter[int], value: float) -> None:
        start.append(source)
        end.append(number[tuple(sorted(target.elements(), reverse=True))])
        rate.append(value)

    for s, state in enumerate(states):
        count = Counter(state)
        sizes = sorted(count)
        for a_index, a in enumerate(sizes):
            for b in sizes[a_index:]:
                pairs = count[a] * (count[a] - 1) / 2 if a == b else count[a] * count[b]
                value = pairs * rates[a - 1, b - 1] / volume
                if value == 0:
                    continue
                left = count - Counter([a, b])
                add(s, left + Counter([a + b]), value)
                if shattering > 0:
                    add(s, left + Counter({1: a + b}), shattering * value)
    return np.array(start, np.int64), np.array(end, np.int64), np.array(rate, float)


def _matrix(
    kernel: Callable[[Any, Any], Any], n: int, volume: float | None, shattering: float
) -> tuple[Any, Any]:
    """Jump rates (column to row) and total rates on the diagonal, as sparse matrices."""
    import scipy.sparse

    problems = []
    if not (np.isfinite(shattering) and shattering >= 0):
        problems.append(f"shattering = {shattering!r}: must be a finite number, zero or more")
    if volume is not None and not (np.isfinite(volume) and volume > 0):
        problems.append(f"volume = {volume!r}: must be a positive finite number")
    if problems:
        raise InputError(problems)
    size = len(partitions(n))
    start, end, rate = _events(kernel, n, float(n if volume is None else volume), shattering)
    jumps = scipy.sparse.csc_array((rate, (end, start)), shape=(size, size))
    total = np.bincount(start, rate, minlength=size).astype(float)
    return jumps, scipy.sparse.diags_array(total)


def partition_pmf(
    kernel: Callable[[Any, Any], Any],
    N: int,
    t: float,
    volume: float | None = None,
    shattering: float = 0.0,
) -> tuple[list[tuple[int, ...]], Float]:
    """Exact law of the sizes of all clusters at the time `t`, from N monomers.

    Solves the master equation on the partitions of N: each pair of clusters of sizes i and j
    merges at the rate ``K(i, j) / V`` and shatters into ``i + j`` monomers at `shattering` times
    that rate.

    Parameters
    ----------
    kernel : callable
        ``K(i, j)`` on arrays of sizes; a `Kernel` serves too.
    N : int
        Monomers at the start; 30 (5604 partitions) takes seconds.
    t : float
        Time.
    volume : float, optional
        V; as large as N if left out.
    shattering : float
        Rate of shattering relative to merging.

    Returns
    -------
    states : list of tuple of int
        The partitions of N, see `partitions`.
    probabilities : ndarray
        Absolute error about 1e-15.

    References
    ----------
    A. H. Marcus, Technometrics 10, 133 (1968);
    A. A. Lushnikov, J. Colloid Interface Sci. 65, 276 (1978), doi:10.1016/0021-9797(78)90158-3.
    """
    import scipy.sparse.linalg

    jumps, total = _matrix(kernel, N, volume, shattering)
    p = np.zeros(jumps.shape[0])
    p[-1] = 1.0  # all monomers
    generator = (jumps - total).tocsc()
    p = scipy.sparse.linalg.expm_multiply(generator * t, p, traceA=t * generator.trace())
    return partitions(N), np.maximum(p, 0.0)


def collision_moments(
    kernel: Callable[[Any, Any], Any],
    N: int,
    t: float,
    volume: float | None = None,
    shattering: float = 0.0,
) -> tuple[float, float]:
    """Mean and variance of the number of collisions up to the time `t`, from N monomers.

    Both mergers and shatterings count, those of two monomers included.

    Parameters
    ----------
    kernel, N, t, volume, shattering
        See `partition_pmf`.
    """
    import scipy.sparse
    import scipy.sparse.linalg

    jumps, total = _matrix(kernel, N, volume, shattering)
    generator = jumps - total
    # p' = Q p, a' = Q a + J p, b' = Q b + 2 J a + J p: sums over paths of 1, C and C**2
    matrix = scipy.sparse.block_array(
        [[generator, None, None], [jumps, generator, None], [jumps, 2 * jumps, generator]],
        format="csc",
    )
    size = jumps.shape[0]
    v = np.zeros(3 * size)
    v[size - 1] = 1.0  # all monomers
    v = scipy.sparse.linalg.expm_multiply(matrix * t, v, traceA=t * matrix.trace())
    mean, square = v[size : 2 * size].sum(), v[2 * size :].sum()
    return float(mean), float(square - mean**2)
