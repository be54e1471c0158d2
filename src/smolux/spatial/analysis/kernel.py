"""The bridge to the mean field: the collision kernel that a spatial run has had."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy import optimize

from smolux import kernels
from smolux.errors import InputError
from smolux.initial import monodisperse
from smolux.model import Model
from smolux.spatial.results.result import log_of, system_of

Float = NDArray[np.float64]
Int = NDArray[np.int64]

#: merges that are looked at together
_CHUNK = 1 << 15
#: fractal dimensions between which that of the kernel is sought
_LEAST, _MOST = 1.0, 4.0


def measured_kernel(
    result: xr.DataTree,
    start: float = 0.0,
    stop: float | None = None,
    *,
    bins_per_octave: int = 1,
    fractal_dimension: float | None = None,
) -> xr.Dataset:
    """Measure the collision kernel of a spatial run, by pairs of cluster sizes.

    Of C merges of clusters in the bins I and J, and an exposure X of the pairs that could have
    merged, the kernel is ``K = C / X``, and its standard error ``sqrt(C) / X``::

        X_IJ = integral of N_I N_J / V dt,    X_II = integral of N_I (N_I - 1) / (2 V) dt

    Beside it stands the ballistic kernel of the mean field, whose clusters of i discs have the
    radius ``i^{1/D}`` and, as momenta add up at random, the speed ``i^{-1/2}``::

        K(i, j) = c (i^{1/D} + j^{1/D})^{d-1} sqrt(1/i + 1/j)

    Parameters
    ----------
    result : xarray.DataTree
        Of `smolux.spatial.simulate`.
    start, stop : float
        Stretch of time; all that was reached if left out.
    bins_per_octave : int
        Bins of cluster size for each doubling.
    fractal_dimension : float, optional
        D, if it is known from elsewhere, as from the radius of gyration; it is fitted to the
        collisions if left out.

    Returns
    -------
    xarray.Dataset
        ``kernel``, ``error``, ``collisions``, ``exposure`` and ``mean_field`` of (size_i, size_j),
        the mean sizes of clusters in the bins. Attributes: the prefactor ``scale`` and
        ``fractal_dimension`` with standard errors, and ``chi2`` for each of ``freedoms``: about 1
        where the mean field holds.

    Raises
    ------
    InputError
        If there are fewer than 10 merges in that stretch.

    Notes
    -----
    The fit maximises the Poisson likelihood of all collisions, rare pairs included. Clusters of one
    bin count alike.
    """
    log, system = log_of(result), system_of(result)
    reached = float(result.attrs["time_reached"])
    stop = reached if stop is None else float(stop)
    problems = []
    if not 0 <= start < stop <= reached:
        problems.append(
            f"start = {start!r}, stop = {stop!r}: must ascend, up to the time reached, {reached:g}"
        )
    if not (isinstance(bins_per_octave, (int, np.integer)) and bins_per_octave >= 1):
        problems.append(f"bins_per_octave = {bins_per_octave!r}: must be a whole number of bins")
    if fractal_dimension is not None and not _LEAST <= fractal_dimension <= _MOST:
        problems.append(f"fractal_dimension = {fractal_dimension!r}: must lie between 1 and 4")
    events = result["events"].to_dataset()
    if "sizes" not in events:
        problems.append("result: was made by a method that does not tell the sizes of clusters")
    if problems:
        raise InputError(problems)
    sizes = events["sizes"].values.astype(np.int64)
    time = log.time[log.merges]
    inside = (time >= start) & (time < stop) if stop < reached else time >= start
    if inside.sum() < 10:
        raise InputError(
            f"start = {start:g}, stop = {stop:g}: {int(inside.sum())} merges are too few to "
            "measure a kernel; use a longer stretch or more discs"
        )
    edges = _edges(int(sizes.sum(1).max()), bins_per_octave)
    of = np.searchsorted(edges, sizes, side="right") - 1
    collisions = np.zeros((len(edges), len(edges)))
    np.add.at(collisions, (of[inside, 0], of[inside, 1]), 1.0)
    collisions += np.tril(collisions, -1).T + np.triu(collisions, 1).T  # of both orders
    exposure, mean = _exposure(sizes, time, edges, len(system), start, stop, system.box.volume)
    there = np.flatnonzero(np.isfinite(mean))
    pairs = np.ix_(there, there)
    return _dataset(
        mean[there], collisions[pairs], exposure[pairs], system.dimension, fractal_dimension,
        {"start": start, "stop": stop, "density": len(system) / system.box.volume},
    )  # fmt: skip


def mean_field_model(kernel: xr.Dataset) -> Model:
    """Return the well-mixed model with the kernel that was fitted to a spatial run.

    Parameters
    ----------
    kernel : xarray.Dataset
        Of `measured_kernel`.

    Returns
    -------
    Model
        For `smolux.simulate` and `smolux.solve`, of discs alone at first, with their density.
    """
    a = kernel.attrs
    law = kernels.formula(
        "c * (i**p + j**p)**q * sqrt(1/i + 1/j)",
        c=a["scale"], p=1 / a["fractal_dimension"], q=a["space_dimension"] - 1,
    )  # fmt: skip
    return Model(kernel=law, initial=monodisperse(density=a["density"]))


def _edges(largest: int, bins_per_octave: int) -> Int:
    """Lower edges of the bins of sizes."""
    steps = np.arange(int(bins_per_octave * np.log2(largest)) + 2)
    edges = np.unique(np.floor(2.0 ** (steps / bins_per_octave)).astype(np.int64))
    return edges[edges <= largest]


def _exposure(
    sizes: Int, time: Float, edges: Int, discs: int, start: float, stop: float, volume: float
) -> tuple[Float, Float]:
    """Integrals over pairs of bins, and the mean size in each bin over that time."""
    bins = len(edges)
    number, mass = np.zeros(bins), np.zeros(bins)
    number[0] = mass[0] = discs
    pairs, clusters, weight = np.zeros((bins, bins)), np.zeros(bins), np.zeros(bins)
    last = np.clip(np.concatenate([[0.0], time]), start, stop)
    step = np.diff(np.append(last, stop))  # after each merge, and before the first
    for begin in range(0, len(step), _CHUNK):
        # merge k ends step k and begins step k + 1
        which = np.arange(max(begin, 1), min(begin + _CHUNK, len(step))) - 1
        rows = len(step[begin : begin + _CHUNK])
        change, moved = np.zeros((rows, bins)), np.zeros((rows, bins))
        at = which + 1 - begin
        for size, sign in ((sizes[which, 0], -1), (sizes[which, 1], -1), (sizes[which].sum(1), 1)):
            bin_ = np.searchsorted(edges, size, side="right") - 1
            np.add.at(change, (at, bin_), sign)
            np.add.at(moved, (at, bin_), sign * size)
        counts, masses = number + np.cumsum(change, 0), mass + np.cumsum(moved, 0)
        dt = step[begin : begin + _CHUNK, None]
        pairs += (counts * dt).T @ counts
        clusters += (counts * dt).sum(0)
        weight += (masses * dt).sum(0)
        number, mass = counts[-1], masses[-1]
    np.fill_diagonal(pairs, (np.diag(pairs) - clusters) / 2)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.maximum(pairs, 0.0) / volume, np.where(clusters > 0, weight / clusters, np.nan)


def _law(i: Float, j: Float, p: float, d: int) -> Float:
    return np.asarray((i**p + j**p) ** (d - 1) * np.sqrt(1 / i + 1 / j))


def _fit(
    size: Float, collisions: Float, exposure: Float, d: int, given: float | None
) -> tuple[float, float, float, float]:
    """Prefactor and 1/D of greatest likelihood, and their standard errors."""
    upper = np.triu_indices(len(size))
    i, j = size[upper[0]], size[upper[1]]
    count, time = collisions[upper], exposure[upper]

    def scale(p: float) -> float:
        return float(count.sum() / np.sum(time * _law(i, j, p, d)))

    def loss(p: float) -> float:
        expected = scale(p) * time * _law(i, j, p, d)
        good = expected > 0
        return float(np.sum(expected[good] - count[good] * np.log(expected[good])))

    if given is not None:
        return scale(1 / given), 1 / given, scale(1 / given) / float(np.sqrt(count.sum())), 0.0
    p = float(optimize.minimize_scalar(loss, bounds=(1 / _MOST, 1 / _LEAST), method="bounded").x)
    h = 1e-3
    bend = (loss(p + h) - 2 * loss(p) + loss(p - h)) / h**2
    error = float(1 / np.sqrt(bend)) if bend > 0 else np.inf
    slope = (np.log(scale(p + h)) - np.log(scale(p - h))) / (2 * h)
    return scale(p), p, scale(p) * float(np.hypot(count.sum() ** -0.5, slope * error)), error


def _dataset(
    size: Float,
    collisions: Float,
    exposure: Float,
    d: int,
    given: float | None,
    attributes: dict[str, Any],
) -> xr.Dataset:
    c, p, c_error, p_error = _fit(size, collisions, exposure, d, given)
    field = c * _law(size[:, None], size[None, :], p, d)
    with np.errstate(invalid="ignore", divide="ignore"):
        kernel = np.where(exposure > 0, collisions / exposure, np.nan)
        error = np.where(exposure > 0, np.sqrt(collisions) / exposure, np.nan)
    expected = (field * exposure)[np.triu_indices(len(size))]
    found = collisions[np.triu_indices(len(size))]
    often = expected >= 5
    freedoms = max(int(often.sum()) - (1 if given is not None else 2), 1)
    dims = ("size_i", "size_j")
    ds = xr.Dataset(
        {
            "kernel": (dims, kernel),
            "error": (dims, error),
            "collisions": (dims, collisions),
            "exposure": (dims, exposure),
            "mean_field": (dims, field),
        },
        {"size_i": size, "size_j": size},
    )
    texts = {
        "kernel": "collision kernel as measured",
        "error": "its standard error",
        "collisions": "merges",
        "exposure": "integral over time of the pairs that could merge, over the volume",
        "mean_field": "ballistic kernel that fits best",
        "size_i": "mean number of discs of clusters in a bin",
        "size_j": "mean number of discs of clusters in a bin",
    }
    for name, text in texts.items():
        ds[name].attrs |= {"long_name": text, "units": "1"}
    return ds.assign_attrs(
        scale=c,
        scale_error=c_error,
        fractal_dimension=1 / p,
        fractal_dimension_error=float(p_error / p**2),
        fitted=int(given is None),
        chi2=float(np.sum((found - expected)[often] ** 2 / expected[often]) / freedoms),
        freedoms=freedoms,
        space_dimension=d,
        **attributes,
    )
