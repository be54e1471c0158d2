"""The merger tree, from the pairs of discs that met: for methods whose log is all there is."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def merger_tree(
    first: NDArray[np.int32], second: NDArray[np.int32], mass: NDArray[np.float64]
) -> dict[str, Any]:
    """Return ``parents``, ``sizes`` and ``masses`` of each merge.

    Parameters
    ----------
    first, second : ndarray of int, shape (M,)
        Discs of the two clusters that merge, in the order of time.
    mass : ndarray of shape (N,)
        Of the discs.

    Returns
    -------
    dict of ndarray of shape (M, 2)
        Nodes of the tree: 0 to N - 1 are the discs, N + m is what merge m made.
    """
    n, m = len(mass), len(first)
    parents, sizes, masses = (
        np.empty((m, 2), np.int32),
        np.empty((m, 2), np.int32),
        np.empty((m, 2)),
    )
    above, node = list(range(n)), list(range(n))
    size, weight = [1] * n, mass.tolist()

    def root(i: int) -> int:
        while above[i] != i:
            above[i] = above[above[i]]
            i = above[i]
        return i

    for k, pair in enumerate(zip(first.tolist(), second.tolist(), strict=True)):
        a, b = root(pair[0]), root(pair[1])
        parents[k], sizes[k] = (node[a], node[b]), (size[a], size[b])
        masses[k] = weight[a], weight[b]
        if size[b] > size[a]:
            a, b = b, a
        above[b], node[a] = a, n + k
        size[a] += size[b]
        weight[a] += weight[b]
    return {"parents": parents, "sizes": sizes, "masses": masses}
