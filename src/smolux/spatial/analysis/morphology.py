"""What clusters look like: their shapes, and their contacts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from smolux.errors import InputError
from smolux.spatial.box import Box
from smolux.spatial.system import System

Float = NDArray[np.float64]
Int = NDArray[np.int64]

#: equal discs or spheres that can touch one, by dimension
_KISSING = {2: 6, 3: 12}
_AXES = ("axis", "other_axis")


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Discs at an instant, of a run or from arrays.

    Parameters
    ----------
    position : array_like of shape (N, d)
        Centres. Along periodic axes clusters must be whole: not wrapped.
    radius : float or array_like of shape (N,)
    box : Box, optional
        Free space if left out.
    cluster : array_like of int, shape (N,), optional
        Which cluster each disc belongs to; all to one if left out.
    mass : float or array_like of shape (N,)

    Raises
    ------
    InputError
        With every mistake: shapes that do not fit, values that are not finite or not positive.
    """

    position: Float
    radius: Float
    box: Box | None
    cluster: Int
    mass: Float

    def __init__(
        self,
        position: ArrayLike,
        radius: ArrayLike,
        box: Box | None = None,
        cluster: ArrayLike | None = None,
        mass: ArrayLike = 1.0,
    ) -> None:
        x = np.asarray(position, np.float64)
        problems = []
        if x.ndim != 2 or x.shape[1] not in (2, 3) or not len(x) or not np.isfinite(x).all():
            problems.append(
                f"position: has the shape {x.shape}; must be (N, 2) or (N, 3), of finite numbers"
            )
        n = len(x) if x.ndim else 0
        if box is not None and not problems and box.dimension != x.shape[1]:
            problems.append(f"box: has {box.dimension} axes, the positions {x.shape[1]}")
        columns = {}
        for name, value in (("radius", radius), ("mass", mass), ("cluster", cluster)):
            given = np.asarray(0 if value is None else value)
            if given.shape not in ((), (n,)):
                problems.append(f"{name}: has the shape {given.shape}; must be one for each disc")
            elif name != "cluster" and not (np.isfinite(given) & (given > 0)).all():
                problems.append(f"{name}: must be positive finite numbers")
            else:
                columns[name] = np.broadcast_to(given, (n,))
        if problems:
            raise InputError(problems)
        object.__setattr__(self, "position", x)
        object.__setattr__(self, "radius", columns["radius"].astype(np.float64))
        object.__setattr__(self, "box", box)
        object.__setattr__(self, "cluster", columns["cluster"].astype(np.int64))
        object.__setattr__(self, "mass", columns["mass"].astype(np.float64))

    def __len__(self) -> int:
        return len(self.position)

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return int(self.position.shape[1])

    @property
    def diameter(self) -> float:
        """Mean diameter."""
        return 2 * float(self.radius.mean())

    def tree(self) -> Any:
        """Return a `scipy.spatial.cKDTree` of the centres that knows the periodic axes."""
        from scipy.spatial import cKDTree

        if self.box is None:
            return cKDTree(self.position)
        return cKDTree(self.box.wrap(self.position), boxsize=self.box.periods)


#: what the functions of morphology take
Discs = Snapshot | System | xr.DataTree


def snapshot(discs: Discs, time: float | None = None) -> Snapshot:
    """Return the discs of a run at an instant.

    Parameters
    ----------
    discs : xarray.DataTree, System or Snapshot
        What `smolux.spatial.simulate` returned, or what it starts from.
    time : float, optional
        Which instant, of a run by an exact method; the end if left out.

    Returns
    -------
    Snapshot

    Raises
    ------
    InputError
        If the time was not reached, or cannot be replayed.
    """
    from smolux.spatial.results.result import replay, system_of

    if isinstance(discs, Snapshot):
        return discs
    if isinstance(discs, System):
        alone = np.arange(len(discs))
        return Snapshot(discs.position, discs.radius, discs.box, alone, discs.mass)
    s = system_of(discs)
    ds = discs.to_dataset() if time is None else replay(discs, time)
    return Snapshot(ds["position"].values, s.radius, s.box, ds["cluster"].values, s.mass)


def shapes(discs: Discs, by_mass: bool = False) -> xr.Dataset:
    """Describe the shape of each cluster by its gyration tensor.

    Parameters
    ----------
    discs : Snapshot, System or xarray.DataTree
    by_mass : bool
        Weight centres by the masses of their discs, instead of equally.

    Returns
    -------
    xarray.Dataset
        By cluster: ``size`` (discs), ``mass``, ``centre``, the ``gyration`` tensor of the centres
        of discs and its eigenvalues from the largest to the least, ``radius_of_gyration`` (root of
        their sum), ``aspect_ratio`` (root of the first over the second, (4.11); NaN for one disc,
        infinite for a line), ``direction`` (unit vector of the first) and, in two dimensions,
        ``orientation``: its angle, from 0 to pi (4.12).

    References
    ----------
    P. Degond, G. Dimarco, M. Ferreira, S. Hecht, (4.11) and (4.12).
    """
    s = snapshot(discs)
    names, which, size = np.unique(s.cluster, return_inverse=True, return_counts=True)
    weight = s.mass if by_mass else np.ones(len(s))
    total = np.bincount(which, weight)

    def mean(values: Float) -> Float:
        return np.bincount(which, weight * values) / total

    d = s.dimension
    centre = np.stack([mean(s.position[:, k]) for k in range(d)], 1)
    away = s.position - centre[which]
    tensor = np.empty((len(names), d, d))
    for j in range(d):
        for k in range(d):
            tensor[:, j, k] = mean(away[:, j] * away[:, k])
    values, vectors = np.linalg.eigh(tensor)
    rounding = 1e-14 * np.maximum(values[:, -1:], 0)
    principal = np.where(values > rounding, values, 0.0)[:, ::-1]
    first = vectors[:, :, -1]
    with np.errstate(divide="ignore", invalid="ignore"):
        aspect = np.sqrt(principal[:, 0] / principal[:, 1])
    data: dict[str, Any] = {
        "size": ("cluster", size),
        "mass": ("cluster", np.bincount(which, s.mass)),
        "centre": (("cluster", "axis"), centre),
        "gyration": (("cluster", *_AXES), tensor),
        "principal": (("cluster", "rank"), principal),
        "radius_of_gyration": ("cluster", np.sqrt(principal.sum(1))),
        "aspect_ratio": ("cluster", aspect),
        "direction": (("cluster", "axis"), first),
    }
    if d == 2:
        data["orientation"] = ("cluster", np.mod(np.arctan2(first[:, 1], first[:, 0]), np.pi))
    return xr.Dataset(data, {"cluster": names})


@dataclass(frozen=True, eq=False)
class Contacts:
    """Discs that touch, within a tolerance.

    Attributes
    ----------
    pairs : ndarray of int, shape (C, 2)
    per_disc : ndarray of int, shape (N,)
        Contacts of each disc; itself is none.
    tolerance : float
        Gap up to which discs touch, over the sum of their radii.
    dimension : int
    """

    pairs: Int
    per_disc: Int
    tolerance: float
    dimension: int

    @property
    def mean(self) -> float:
        """Contacts of a disc, on average: ``2 - 2/N`` for a tree of exact links."""
        return float(self.per_disc.mean())

    def kappa(self, include_self: bool = False) -> float:
        """Share of the contacts that a disc could have, 6 in the plane and 12 in space.

        Parameters
        ----------
        include_self : bool
            Count each disc as a contact of its own, as the double sum of (4.13) does by its letter.

        References
        ----------
        P. Degond, G. Dimarco, M. Ferreira, S. Hecht, (4.13).
        """
        return (self.mean + include_self) / _KISSING[self.dimension]


def contacts(discs: Discs, tolerance: float = 0.01) -> Contacts:
    """Find the discs that touch.

    Parameters
    ----------
    discs : Snapshot, System or xarray.DataTree
    tolerance : float
        Gap up to which discs touch, over the sum of their radii: with 0.5, equal discs touch
        up to a distance of 1.5 diameters.

    Returns
    -------
    Contacts

    Raises
    ------
    InputError
        If the tolerance is negative, or more than half a period.
    """
    s = snapshot(discs)
    reach = (1 + tolerance) * 2 * float(s.radius.max()) if tolerance >= 0 else np.nan
    if not within_half_period(s, reach):
        raise InputError(
            f"tolerance = {tolerance!r}: must be zero or more, and reach less than half a period"
        )
    pairs = s.tree().query_pairs(reach, output_type="ndarray").astype(np.int64)
    i, j = pairs.T
    apart = s.position[j] - s.position[i]
    if s.box is not None:
        apart = s.box.nearest(apart)
    near = (apart**2).sum(1) <= ((1 + tolerance) * (s.radius[i] + s.radius[j])) ** 2
    pairs = pairs[near]
    per_disc = np.bincount(pairs.ravel(), minlength=len(s))
    return Contacts(pairs, per_disc, float(tolerance), s.dimension)


def within_half_period(s: Snapshot, distance: float) -> bool:
    """Whether a distance is a number below half of every period."""
    periods = s.box.periods if s.box is not None else np.zeros(1)
    return bool(np.isfinite(distance) and all(p == 0 or distance <= p / 2 for p in periods))
