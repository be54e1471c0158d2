"""Which discs overlap, and positions where none do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from smolux.errors import InputError
from smolux.spatial.box import Box

Float = NDArray[np.float64]
Int = NDArray[np.int64]

#: a packing in which so many positions in a row were taken counts as full
_TRIES = 1 << 22


def cells_for(box: Box, side: float, discs: int) -> Int:
    """Count cells along each axis: none shorter than `side`, about as many as discs at most."""
    least = max(side, (box.volume / max(discs, 1)) ** (1 / box.dimension))
    return np.array([max(1, int(length / least)) for length in box.lengths], np.int64)


def overlapping(position: Float, radius: Float, box: Box, most: int) -> list[tuple[int, int]]:
    """Find discs that overlap.

    Parameters
    ----------
    position : ndarray of shape (N, d)
        Wrapped into the box.
    radius : ndarray of shape (N,)
    box : Box
    most : int
        How many pairs to look for.

    Returns
    -------
    list of tuple of int
        Pairs of discs, at most one for each disc with the discs before it.
    """
    from smolux.spatial.events.grid import find_overlaps

    cells = cells_for(box, 2 * float(radius.max()), len(position))
    out = np.empty((most, 2), np.int64)
    head = np.full(int(np.prod(cells)), -1, np.int32)
    following = np.empty(len(position), np.int32)
    found = find_overlaps(
        position, radius, np.array(box.lengths), box.periods, cells, head, following, out
    )
    return [(int(i), int(j)) for i, j in out[:found]]


def placed_at_random(radius: Float, box: Box, contact: str, rng: NDArray[np.uint64]) -> Float:
    """Place discs by random sequential addition, the largest first.

    Parameters
    ----------
    radius : ndarray of shape (N,)
    box : Box
    contact : {"surface", "centre"}
        What of a disc stays within reflecting walls.
    rng : ndarray of uint64, shape (4,)
        A stream of `smolux.core.rng`.

    Returns
    -------
    ndarray of shape (N, d)

    Raises
    ------
    InputError
        If the discs do not fit.
    """
    from smolux.spatial.events.grid import place

    n = len(radius)
    order = np.argsort(-radius, kind="stable")
    r = np.ascontiguousarray(radius[order])
    x = np.zeros((n, box.dimension))
    cells = cells_for(box, 2 * float(r[0]), n)
    head = np.full(int(np.prod(cells)), -1, np.int32)
    following = np.empty(n, np.int32)
    room = r if contact == "surface" else np.zeros(n)
    done, before, length = 0, -1, np.array(box.lengths)
    while before < done < n:
        before = done
        done = place(x, r, room, done, _TRIES, rng, length, box.periods, cells, head, following)
    if done < n:
        raise InputError(
            f"random positions: only {done} of {n} discs fit, no room was found for the next; "
            "discs added at random fill at most 0.547 of a plane and 0.382 of space: use a lower "
            "volume fraction, or a lattice"
        )
    out = np.empty_like(x)
    out[order] = x
    return out
