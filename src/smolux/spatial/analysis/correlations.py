"""Order of discs in their box: the pair distribution and the structure factor."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from smolux.errors import InputError
from smolux.spatial.box import Box

from .morphology import Discs, Snapshot, snapshot, within_half_period

Float = NDArray[np.float64]

#: mean over directions of the product of so many components of a unit vector, without signs
_COMPONENTS = {2: (1.0, 2 / np.pi, 1 / np.pi), 3: (1.0, 1 / 2, 2 / (3 * np.pi), 1 / (4 * np.pi))}
_CHUNK = 8192
#: default distances: from just above contact to so many diameters
_FROM, _TO, _STEP = 1.02, 10.0, 0.1


def pair_distribution(discs: Discs, edges: ArrayLike | None = None) -> xr.Dataset:
    """Count the discs at each distance from a disc.

    Parameters
    ----------
    discs : Snapshot, System or xarray.DataTree
        In a box.
    edges : array_like of shape (B + 1,), optional
        Distances, ascending; from 1.02 to 10 mean diameters in steps of a tenth if left out, which
        keeps contacts out.

    Returns
    -------
    xarray.Dataset
        ``neighbours``: the mean number of other discs in each shell, the paper's (4.14); ``g``:
        over what it is for independent discs uniform in the box, walls allowed for. At ``r``, the
        middle of ``r_lower`` to ``r_upper``.

    Raises
    ------
    InputError
        If there is no box, or distances do not ascend or exceed a side of it or half a period.

    Notes
    -----
    Of two uniform points in a box the nearest wall takes some directions away. What is left at a
    distance r is the mean over directions u of ``prod_k (1 - r |u_k| / L_k)`` over reflecting axes.

    References
    ----------
    P. Degond, G. Dimarco, M. Ferreira, S. Hecht, (4.14).
    """
    s = snapshot(discs)
    box = _box(s)
    if edges is None:
        r = s.diameter * np.arange(_FROM, _TO + _STEP / 2, _STEP)
        r = r[[within_half_period(s, x) and x <= min(box.lengths) for x in r]]
    else:
        r = np.atleast_1d(np.asarray(edges, np.float64))
    good = r.ndim == 1 and len(r) > 1 and r[0] >= 0 and bool((np.diff(r) > 0).all())
    if not good or not within_half_period(s, float(r[-1])) or r[-1] > min(box.lengths):
        raise InputError(
            "edges: must be two or more ascending distances, none beyond the least side of the "
            "box or half a period"
        )
    n = len(s)
    tree = s.tree()
    ordered = np.asarray(tree.count_neighbors(tree, r), np.float64)
    counts = np.diff(ordered) / n
    expected = (n - 1) * np.diff(_share_within(r, box))
    data = {
        "neighbours": ("r", counts),
        "g": ("r", counts / expected),
        "r_lower": ("r", r[:-1]),
        "r_upper": ("r", r[1:]),
    }
    return xr.Dataset(data, {"r": (r[1:] + r[:-1]) / 2}, {"diameter": s.diameter})


def _share_within(r: Float, box: Box) -> Float:
    """Probability that two uniform points of a box are nearer than `r`."""
    d = box.dimension
    inverse = [1 / side for side, p in zip(box.lengths, box.periodic, strict=True) if not p]
    sphere = 2 * np.pi if d == 2 else 4 * np.pi
    share = np.zeros_like(r)
    for order in range(len(inverse) + 1):
        walls = sum(float(np.prod(chosen)) for chosen in combinations(inverse, order))
        power = d + order
        share += (-1) ** order * _COMPONENTS[d][order] * walls * r**power / power
    return sphere * share / box.volume


def structure_factor(discs: Discs, shells: int = 64) -> xr.Dataset:
    """Return the structure factor of the centres, averaged over directions.

    Parameters
    ----------
    discs : Snapshot, System or xarray.DataTree
        In a box.
    shells : int
        Largest wave number, in units of ``2 pi`` over the longest side; wave vectors are
        averaged in shells of this width.

    Returns
    -------
    xarray.Dataset
        ``S``: the mean of ``|sum_i exp(i q x_i)|^2 / N`` over the ``vectors`` of each shell, at
        ``q``, their mean length. 1 for independent uniform discs.

    Notes
    -----
    Wave vectors are those of the periodic box, ``2 pi n_k / L_k``, between reflecting walls too:
    there the transform of the box itself vanishes. The sums are products of matrices, as
    ``exp(i q x)`` is a product over axes.
    """
    s = snapshot(discs)
    box = _box(s)
    if not (isinstance(shells, (int, np.integer)) and shells >= 1):
        raise InputError(f"shells = {shells!r}: must be a whole number, one or more")
    longest = max(box.lengths)
    most = [int(shells * side / longest) for side in box.lengths]
    # q and -q have the same S: half of the vectors, by the first axis
    numbers = [np.arange(0 if k == 0 else -m, m + 1) for k, m in enumerate(most)]
    power = np.abs(_amplitudes(s, box, numbers)) ** 2 / len(s)
    mesh = np.meshgrid(*numbers, indexing="ij", sparse=True)
    length = np.sqrt(
        sum((longest / side * n) ** 2 for n, side in zip(mesh, box.lengths, strict=True))
    )
    # of the vectors without a first component each comes with its opposite
    weight = np.broadcast_to(np.where(mesh[0] == 0, 0.5, 1.0), length.shape)
    shell = np.rint(length).astype(np.int64)
    used = (shell >= 1) & (shell <= shells)
    vectors = np.bincount(shell[used], weight[used], shells + 1)[1:]
    held = vectors > 0
    with np.errstate(invalid="ignore"):
        mean = np.bincount(shell[used], (weight * power)[used], shells + 1)[1:] / vectors
        q = np.bincount(shell[used], (weight * length)[used], shells + 1)[1:] / vectors
    data = {"S": ("q", mean[held]), "vectors": ("q", vectors[held])}
    return xr.Dataset(data, {"q": 2 * np.pi / longest * q[held]}, {"diameter": s.diameter})


def _amplitudes(s: Snapshot, box: Box, numbers: list[NDArray[np.int64]]) -> NDArray[np.complex128]:
    """Sum ``exp(i q x)`` over discs, for all wave vectors of a grid."""
    total = np.zeros([len(n) for n in numbers], np.complex128)
    for start in range(0, len(s), _CHUNK):
        x = s.position[start : start + _CHUNK]
        waves = [
            np.exp(2j * np.pi / side * np.outer(n, x[:, k]))
            for k, (n, side) in enumerate(zip(numbers, box.lengths, strict=True))
        ]
        if box.dimension == 2:
            total += waves[0] @ waves[1].T
        else:
            for a, wave in enumerate(waves[0]):
                total[a] += (wave * waves[1]) @ waves[2].T
    return total


def _box(s: Snapshot) -> Box:
    if s.box is None:
        raise InputError("discs: a Snapshot in free space; give it a box")
    return s.box
