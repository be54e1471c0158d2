"""Small systems of simulated particles as Markov chains, solved exactly, whatever they stand for.

Written from the definitions, not from the program: a state is the sorted tuple of the simulated
sizes, and a model says where it goes and at what rate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import expm_multiply

State = tuple[int, ...]
Moves = Callable[[State], Iterator[tuple[float, State]]]


def law(start: State, moves: Moves, times: tuple[float, ...], depth: int) -> tuple[dict, NDArray]:
    """Return the states reached in `depth` events at most and their probabilities at each time.

    The last column is the probability of more events, or of any state beyond.
    """
    place, layer = {start: 0}, [start]
    entries: list[tuple[int, int, float]] = []
    for level in range(depth + 1):
        following = []
        for state in layer:
            source = place[state]
            for rate, target in moves(state):
                if target not in place and level < depth:
                    place[target] = len(place)
                    following.append(target)
                entries.append((source, place.get(target, -1), rate))
        layer = following
    size = len(place) + 1
    row, column, rate = (np.array(part) for part in zip(*entries, strict=True))
    column = np.where(column < 0, size - 1, column)
    q = sparse.coo_matrix((rate, (column, row)), (size, size)).tocsc()
    q -= sparse.diags(np.asarray(q.sum(axis=0)).ravel())
    first = np.zeros(size)
    first[0] = 1.0
    return place, np.array([expm_multiply(q * t, first) for t in times])


def rounded(mean: float) -> list[tuple[float, int]]:
    """Whole numbers next to a mean, with their probabilities."""
    low = math.floor(mean + 1e-9)
    share = max(mean - low, 0.0)
    return [(1.0 - share, low), (share, low + 1)] if share > 1e-9 else [(1.0, low)]


def put(state: State, gone: tuple[int, ...], come: list[int]) -> State:
    left = [size for k, size in enumerate(state) if k not in gone]
    return tuple(sorted([*left, *come]))


def pairs(
    kernel: Callable[[int, int], float],
    weight: Callable[[int], float],
    volume: float,
    shattering: float = 0.0,
) -> Moves:
    """Aggregation and shattering of particles that stand for ``1 / weight(size)``.

    Of i and j at most one stays, or at least one, whichever fits the sum of their chances.
    """

    def moves(state: State) -> Iterator[tuple[float, State]]:
        for a, b in combinations(range(len(state)), 2):
            i, j = state[a], state[b]
            w = weight(i), weight(j), weight(i + j)
            top = max(w)
            rate = kernel(i, j) * top / (w[0] * w[1]) / volume
            stay = 1.0 - w[0] / top, 1.0 - w[1] / top
            both = max(stay[0] + stay[1] - 1.0, 0.0)
            gone = [
                (both, ()), (stay[0] - both, (b,)), (stay[1] - both, (a,)),
                (1.0 - stay[0] - stay[1] + both, (a, b)),
            ]  # fmt: skip
            made = [(1.0, i + j, w[2] / top)]
            if shattering:
                made.append((shattering, 1, (i + j) * weight(1) / top))
            for share, size, mean in made:
                for p, count in rounded(mean):
                    for r, out in gone:
                        if r > 1e-12:
                            yield rate * share * p * r, put(state, out, [size] * count)

    return moves


def evaporation(rate: float, weight: Callable[[int], float]) -> Moves:
    """Each particle of size k > 1 is replaced by ``k - 1`` and 1, ``w(k') / w(k)`` of each.

    Both numbers are rounded by one uniform number, so that their sum is next to its mean.
    """

    def moves(state: State) -> Iterator[tuple[float, State]]:
        for a, k in enumerate(state):
            if k == 1 or rate == 0.0:
                continue
            means = [2 * weight(1) / weight(2)] if k == 2 else [
                weight(k - 1) / weight(k), weight(1) / weight(k)
            ]  # fmt: skip
            ends = np.cumsum(means)
            cuts = sorted({0.0, 1.0, *(1.0 - (end % 1.0) for end in ends)})
            for low, high in pairwise(cuts):
                if high - low < 1e-9:
                    continue
                upto = np.floor(ends + 0.5 * (low + high) + 1e-9).astype(int)
                made = np.diff(upto, prepend=0)
                sizes = [1] if k == 2 else [k - 1, 1]
                come = [s for s, c in zip(sizes, made, strict=True) for _ in range(c)]
                yield rate * (high - low), put(state, (a,), come)

    return moves


def both(one: Moves, other: Moves) -> Moves:
    def moves(state: State) -> Iterator[tuple[float, State]]:
        yield from one(state)
        yield from other(state)

    return moves
