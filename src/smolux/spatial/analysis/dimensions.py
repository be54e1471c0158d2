"""Fractal dimensions: by counting boxes, and from the radii of gyration of many clusters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from smolux.errors import InputError

from .morphology import Discs, shapes, snapshot

Float = NDArray[np.float64]

#: sides of boxes to a halving
_STEPS = 4
#: boxes are counted until so many discs have one of their own, and at most so many halvings
_PLATEAU, _HALVINGS = 0.99, 20
#: a power law needs so many points to have an error
_LEAST_POINTS = 3


@dataclass(frozen=True, eq=False)
class Dimension:
    """A fractal dimension, and the fit that it comes from.

    Attributes
    ----------
    value : float
    low, high : float
        95 % confidence interval of the fit.
    x, y : ndarray
        Abscissa and ordinate of all points: sides and counts of boxes, or sizes and radii of
        gyration of clusters.
    used : ndarray of bool
        Which points were fitted.
    slope, intercept : float
        Of ``log y`` on ``log x``.
    """

    value: float
    low: float
    high: float
    x: Float
    y: Float
    used: NDArray[np.bool_]
    slope: float
    intercept: float


def box_dimension(discs: Discs, least: float = 4.0, largest: float | None = None) -> Dimension:
    """Count boxes that hold a centre, ``n(l) = A l^{-D}``.

    Parameters
    ----------
    discs : Snapshot, System or xarray.DataTree
        In a box; all discs count, whatever cluster they belong to.
    least, largest : float
        Fit where the number of boxes lies between these, both excluded; N / 2 if `largest` is
        left out. The dimension depends on this window: state it with the number.

    Returns
    -------
    Dimension
        Boxes have the sides ``L / 2^{k/4}``, L the longest of the box, from a corner of it. The
        interval is that of a line through points taken as independent, which counts of
        neighbouring sides are not: for the error of D compare runs.

    Raises
    ------
    InputError
        If fewer than three sides lie in the window.

    References
    ----------
    P. Degond, G. Dimarco, M. Ferreira, S. Hecht, (4.15).
    """
    s = snapshot(discs)
    if s.box is None:
        raise InputError("discs: a Snapshot in free space; give it a box")
    n = len(s)
    most = n / 2 if largest is None else largest
    x, longest = s.box.wrap(s.position), max(s.box.lengths)
    sides, counts = [], []
    for k in range(_STEPS * _HALVINGS + 1):
        side = longest / 2 ** (k / _STEPS)
        sides.append(side)
        counts.append(_occupied(x, side))
        if counts[-1] > _PLATEAU * n:
            break
    length, count = np.array(sides), np.array(counts, np.float64)
    used = (count > least) & (count < most)
    if used.sum() < _LEAST_POINTS:
        raise InputError(
            f"least, largest = {least:g}, {most:g}: fewer than three sides of boxes have such "
            f"counts, of {n} discs; widen the window"
        )
    return _fitted(length, count, used, lambda slope: -slope)


def _occupied(x: Float, side: float) -> int:
    """Count boxes that hold a point."""
    cell = np.floor(x / side).astype(np.int64)
    cell -= cell.min(0)
    return len(np.unique(np.ravel_multi_index(tuple(cell.T), tuple(cell.max(0) + 1))))


def mass_dimension(discs: Discs, least: int = 30) -> Dimension:
    """Fit ``R_g ~ m^{1/D}`` over clusters.

    Parameters
    ----------
    discs : Snapshot, System or xarray.DataTree
        With many clusters: a run stopped by ``clusters=``, or an instant of it by `snapshot`.
    least : int
        Discs of the smallest cluster that counts.

    Returns
    -------
    Dimension
        With the 95 % interval of the regression of ``log R_g`` on ``log m``, m the number of discs.

    Raises
    ------
    InputError
        If fewer than three such clusters are there, or all are of one size.
    """
    ds = shapes(discs)
    size = ds["size"].values.astype(np.float64)
    radius = ds["radius_of_gyration"].values
    used = (size >= least) & (radius > 0)
    if len(np.unique(size[used])) < 2 or used.sum() < _LEAST_POINTS:
        raise InputError(
            f"least = {least!r}: only {int(used.sum())} clusters have so many discs; three of "
            "different sizes are needed: stop the run earlier, or lower it"
        )
    return _fitted(size, radius, used, _inverse)


def _inverse(slope: float) -> float:
    return 1 / slope if slope > 0 else float("inf")


def _fitted(
    x: Float, y: Float, used: NDArray[np.bool_], dimension: Callable[[float], float]
) -> Dimension:
    """Fit a power law by least squares of logarithms."""
    from scipy.special import stdtrit

    u, v = np.log(x[used]), np.log(y[used])
    away = u - u.mean()
    slope = float(away @ v / (away @ away))
    intercept = float(v.mean() - slope * u.mean())
    free = int(used.sum()) - 2
    variance = np.sum((v - intercept - slope * u) ** 2) / free / (away @ away)
    half = float(stdtrit(free, 0.975) * np.sqrt(variance))
    ends = sorted(dimension(slope + sign * half) for sign in (-1, 1))
    return Dimension(dimension(slope), ends[0], ends[1], x, y, used, slope, intercept)
