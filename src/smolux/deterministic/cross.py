"""Low-rank factors of a kernel on the sizes ``1 .. M``: exact ones, or by approximation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from smolux.kernels.base import Kernel

from .trial import FLOOR, Sample, values

Float = NDArray[np.float64]

#: a larger rank is no gain over the direct sum
MAX_RANK = 48
#: sizes on which pivots are sought: all small ones, and so many spread evenly in log k
_SMALL, _NODES = 24, 192
_ROUNDS = 4
#: a 1 x 1 pivot is taken if it is at least this share of the largest entry (Bunch and Parlett 1971)
_BUNCH_PARLETT = 0.6404


@dataclass(frozen=True)
class LowRankFactors:
    """A kernel as ``K(i, j) = (i + j)**power sum_rs core[r, s] rows[r, i] rows[s, j]``.

    Attributes
    ----------
    rows : ndarray of shape (R, M)
    core : ndarray of shape (R, R)
        Symmetric.
    power : float
        Exponent of the factor that depends on ``i + j`` alone.
    error : float
        The largest relative error found, see `Sample`.
    worst : (int, int)
        The pair of sizes that has it.
    """

    rows: Float
    core: Float
    power: float = 0.0
    error: float = 0.0
    worst: tuple[int, int] = (1, 1)

    @property
    def rank(self) -> int:
        """Number of rows, that is of forward transforms."""
        return len(self.rows)

    def __call__(self, i: NDArray[np.int64], j: NDArray[np.int64]) -> Float:
        """Evaluate at pairs of sizes."""
        left, right = self.rows[:, i - 1], self.rows[:, j - 1]
        total = (i + j).astype(float)
        return ((self.core @ left) * right).sum(axis=0) * total**self.power

    def columns(self, count: int) -> Float:
        """Return ``K(i, j)`` for all i and ``j = 1 .. count``, shape (M, count)."""
        values = self.rows.T @ (self.core @ self.rows[:, :count])
        if self.power:
            i = np.arange(1.0, len(values) + 1.0)[:, None]
            values *= (i + np.arange(1.0, count + 1.0)) ** self.power
        return values


def given_factors(sample: Sample) -> LowRankFactors | None:
    """Return the exact factors that a law gives, each different row once; None if it gives none."""
    pair = sample.kernel.low_rank_factors(np.arange(1.0, sample.largest + 1.0))
    if pair is None:
        return None
    rows: list[Float] = []
    weights: list[list[tuple[int, float]]] = []
    for side in pair:
        entry = []
        for row in np.atleast_2d(np.asarray(side, float)):
            index, weight = _find(rows, row)
            entry.append((index, weight))
        weights.append(entry)
    core = np.zeros((len(rows), len(rows)))
    for (r, a), (s, b) in zip(*weights, strict=True):
        core[r, s] += 0.5 * a * b
        core[s, r] += 0.5 * a * b
    return sample.tried(LowRankFactors(np.array(rows), core))


def _find(rows: list[Float], row: Float) -> tuple[int, float]:
    """Return which of `rows` is a multiple of `row`, added if there is none, and the multiple."""
    for index, other in enumerate(rows):
        top = int(np.argmax(np.abs(other)))
        weight = row[top] / other[top] if other[top] else 0.0
        if np.allclose(row, weight * other, rtol=1e-14, atol=0.0):
            return index, float(weight)
    rows.append(row)
    return len(rows) - 1, 1.0


def cross_approximation(
    sample: Sample, tolerance: float, power: float = 0.0, max_rank: int = MAX_RANK
) -> LowRankFactors | None:
    """Find low-rank factors of a symmetric kernel from few of its entries.

    Pivots come from the full matrix on a few hundred sizes, spread evenly in ``log k``: the largest
    residual relative to the kernel is eliminated, with its mirror image if it is off the diagonal,
    until all are below the tolerance. The pivots' columns on all sizes then give the factors in
    ``O(M R^2)``, which a QR and an eigenvalue decomposition make as few as the tolerance allows.

    Parameters
    ----------
    sample : Sample
        Of the kernel: pairs on which the factors are tried.
    tolerance : float
        Largest error of an entry relative to it.
    power : float
        Approximate ``K(i, j) / (i + j)**power`` instead.
    max_rank : int
        Give up beyond this rank.

    Returns
    -------
    LowRankFactors or None
        With an `error` above ten tolerances if they miss entries; None if the rank is too large
        at once.

    References
    ----------
    M. Bebendorf, Numer. Math. 86, 565 (2000), doi:10.1007/PL00005410 (cross approximation);
    J. R. Bunch and B. N. Parlett, SIAM J. Numer. Anal. 8, 639 (1971), doi:10.1137/0708060 (pivots).
    """
    kernel, largest = sample.kernel, sample.largest
    found, extra = None, np.empty(0, np.int64)
    for _ in range(_ROUNDS):
        nodes = _nodes(largest, extra)
        blocks = _eliminate(kernel, nodes, tolerance, power, max_rank)
        if blocks is None:
            break
        rows, core = _extend(kernel, nodes, blocks, largest, power)
        found = sample.tried(
            LowRankFactors(*_recompress(kernel, rows, core, tolerance, power), power)
        )
        if found.error <= 10.0 * tolerance:
            break
        # sizes between the nodes matter: let those with the largest errors be nodes too
        bad = np.argsort(sample.errors(found))[-64:]
        extra = np.concatenate([extra, sample.i[bad], sample.j[bad]])
    return found


def interpolation(sample: Sample, tolerance: float = 1e-13) -> LowRankFactors | None:
    """Interpolate a kernel in the logarithms of both sizes, by polynomials at Chebyshev points.

    Of higher rank than a cross approximation, but free of its rounding: close to machine accuracy
    for a law that is smooth in ``log i``. The loss term takes it when the gain has exact factors.

    Parameters
    ----------
    sample : Sample
        Of the kernel: pairs on which the factors are tried.
    tolerance : float
        Largest error of an entry relative to it.

    Returns
    -------
    LowRankFactors or None
        None if the law is not smooth enough.
    """
    x = np.log(np.arange(1.0, sample.largest + 1.0))
    found = None
    for count in range(16, 97, 16):
        angle = np.pi * np.arange(count) / (count - 1)
        nodes = 0.5 * x[-1] * (1.0 - np.cos(angle))
        weight = (-1.0) ** np.arange(count)
        weight[[0, -1]] *= 0.5
        difference = x[None, :] - nodes[:, None]
        hit = difference == 0.0
        difference[hit] = 1.0
        rows = weight[:, None] / difference
        rows /= rows.sum(axis=0)
        at_node = hit.any(axis=0)
        rows[:, at_node] = hit[:, at_node]
        sizes = np.exp(nodes)
        factors = sample.tried(LowRankFactors(rows, sample.kernel(sizes[:, None], sizes[None, :])))
        if found is None or not found.error <= factors.error:
            found = factors
        if found.error <= tolerance:
            break
    return found if found is not None and found.error <= 100.0 * tolerance else None


def _nodes(largest: int, extra: NDArray[np.int64]) -> NDArray[np.int64]:
    small = np.arange(1, min(largest, _SMALL) + 1)
    spread = np.round(np.geomspace(1, largest, _NODES)).astype(np.int64)
    return np.unique(np.concatenate([small, spread, extra]))


def _entries(kernel: Kernel, i: Float, j: Float, power: float) -> Float:
    found = values(kernel, i, j)
    return found / (i + j) ** power if power else found


def _scale(kernel: Kernel, sizes: Float, power: float) -> Float:
    """Return g with ``K(i, j) / (g_i g_j)`` near one on the diagonal, so that entries compare."""
    diagonal = _entries(kernel, sizes, sizes, power)
    if diagonal.min() > 0:
        return np.sqrt(diagonal)
    largest = _entries(kernel, sizes, np.full_like(sizes, sizes.max()), power)
    return np.full(len(sizes), np.sqrt(max(diagonal.max(), largest.max(), 1e-300)))


def _eliminate(
    kernel: Kernel, nodes: NDArray[np.int64], tolerance: float, power: float, max_rank: int
) -> list[tuple[NDArray[np.int64], Float]] | None:
    """Return pivots, one or two nodes each, with the inverse of their block of the residual."""
    sizes = nodes.astype(float)
    g = _scale(kernel, sizes, power)
    matrix = _entries(kernel, sizes[:, None], sizes[None, :], power) / np.outer(g, g)
    top = np.abs(matrix).max()
    weight = 1.0 / (np.abs(matrix) + FLOOR * top)
    noise = 64.0 * np.finfo(float).eps * top
    residual = matrix.copy()
    blocks: list[tuple[NDArray[np.int64], Float]] = []
    rank = 0
    while True:
        size = np.abs(residual)
        p, q = np.unravel_index(np.argmax(size), size.shape)
        if size[p, q] <= noise or (size * weight).max() <= 0.2 * tolerance:
            return blocks
        d = int(np.argmax(np.diag(size)))
        alone = size[d, d] >= _BUNCH_PARLETT * size[p, q]
        pivot = np.array([d] if alone else [p, q])
        inverse = np.linalg.inv(residual[np.ix_(pivot, pivot)])
        blocks.append((pivot, inverse / np.outer(g[pivot], g[pivot])))
        rank += len(pivot)
        if rank > max_rank:
            return None
        residual = residual - residual[:, pivot] @ inverse @ residual[pivot]
        residual = 0.5 * (residual + residual.T)


def _extend(
    kernel: Kernel,
    nodes: NDArray[np.int64],
    blocks: list[tuple[NDArray[np.int64], Float]],
    largest: int,
    power: float,
) -> tuple[Float, Float]:
    """Return the eliminated columns on all sizes, and the block-diagonal core between them."""
    sizes = np.arange(1.0, largest + 1.0)
    columns: list[Float] = []
    for pivot, _ in blocks:
        column = _entries(kernel, sizes[:, None], nodes[pivot].astype(float)[None, :], power)
        for earlier, (_, inverse) in zip(columns, blocks, strict=False):
            column = column - earlier @ (inverse @ earlier[nodes[pivot] - 1].T)
        columns.append(column)
    return np.concatenate(columns, axis=1), linalg.block_diag(*(inverse for _, inverse in blocks))


def _recompress(
    kernel: Kernel, columns: Float, core: Float, tolerance: float, power: float
) -> tuple[Float, Float]:
    """Return orthogonal rows with a diagonal core, without those below the tolerance."""
    g = _scale(kernel, np.arange(1.0, len(columns) + 1.0), power)[:, None]
    q, triangle = np.linalg.qr(columns / g)
    values, vectors = np.linalg.eigh(triangle @ core @ triangle.T)
    rows = q @ vectors
    # what leaving a term out changes in an entry, whose scale is one
    share = np.abs(values) * np.abs(rows).max(axis=0) ** 2
    keep = share > 0.02 * tolerance
    return np.ascontiguousarray((rows[:, keep] * g).T), np.diag(values[keep])
