"""What is read from a result: its warnings, a whole population."""

from __future__ import annotations

import json
import os
from typing import TypeVar

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from smolux.errors import InputError, warn

Result = TypeVar("Result", xr.Dataset, xr.DataTree)


def require(
    ds: object,
    *needed: str,
    what: str = "ds",
    source: str = "simulate or solve",
    tree: bool = False,
    orders: tuple[float, ...] = (),
) -> None:
    """Check that an argument is a result, before anything is read from it.

    Parameters
    ----------
    ds : object
    *needed : str
        Variables, coordinates and dimensions that it must have.
    what : str
        The argument, for messages.
    source : str
        What makes such a result, for messages.
    tree : bool
        Whether the tree of a spatial run is one, too.
    orders : tuple of float
        Of the moments that it must have.

    Raises
    ------
    InputError
    """
    if isinstance(ds, (str, os.PathLike)):
        raise InputError(
            f"{what} = {str(ds)!r}: is a path or a text; read a file with smolux.results.load"
        )
    if not isinstance(ds, (xr.Dataset, xr.DataTree) if tree else xr.Dataset):
        raise InputError(
            f"{what} = {ds!r:.60}: is no dataset but of the type {type(ds).__name__}; give a "
            f"result of {source}"
        )
    missing = [name for name in needed if name not in ds and name not in ds.dims]
    if missing:
        raise InputError(f"{what}: is no result of {source}, it has no {', '.join(missing)}")
    present = list(np.asarray(ds["order"])) if orders else []
    lacking = [f"{p:g}" for p in orders if p not in present]
    if lacking:
        there = ", ".join(f"{p:g}" for p in present)
        raise InputError(
            f"{what}: has moments of the orders {there or 'none'}, and none of the order "
            f"{' and '.join(lacking)}, which is needed; name it in orders= of {source}"
        )


def warnings(ds: xr.Dataset | xr.DataTree) -> list[str]:
    """Return what a result warns of, in the order in which it came.

    Each is issued as a `SmoluxWarning` too, when a computation ends; this is for a result that was
    read from a file, or made where nobody looked.

    Parameters
    ----------
    ds : xarray.Dataset or xarray.DataTree

    Returns
    -------
    list of str
        Empty if there is nothing to beware of.

    Examples
    --------
    >>> import smolux as sx
    >>> model = sx.Model(kernel=sx.kernels.Constant())
    >>> ds = sx.simulate(model, times=[1], particles=1000, seed=1)
    >>> sx.results.warnings(ds)
    []
    """
    require(ds, source="smolux", tree=True)
    return list(json.loads(ds.attrs.get("warnings", "[]")))


def told(ds: Result) -> Result:
    """Issue the warnings of a result, and return it: for what the user called, and nothing else."""
    warn(warnings(ds), level=2)
    return ds


def population(ds: xr.Dataset, replica: int, time: float) -> tuple[NDArray[np.int64], ...]:
    """Return the whole population of one replica at one time, if the result holds it.

    Parameters
    ----------
    ds : xarray.Dataset
        A result of ``simulate(..., distribution=True)``.
    replica : int
    time : float
        One of the output times.

    Returns
    -------
    sizes, counts : ndarray of int64
        The sizes present, and how many simulated particles have each; empty if the time was not
        reached.

    Raises
    ------
    InputError
        If the result holds no populations, or none of that replica and time.
    """
    require(ds, "replica", "time", source="simulate")
    if "row_size" not in ds:
        raise InputError(
            "the result holds no whole populations: simulate with distribution=True, "
            "or use the densities n and n_bin"
        )
    rows = ds["row_size"].values
    found = np.flatnonzero(
        (ds["instance_replica"].values == replica) & (ds["instance_time"].values == time)
    )
    if not found.size:
        raise InputError(
            f"replica = {replica!r}, time = {time!r}: no such population; "
            f"replicas are 0 to {ds.sizes['replica'] - 1}, times are {ds['time'].values.tolist()}"
        )
    start = int(rows[: found[0]].sum())
    row = slice(start, start + int(rows[found[0]]))
    return ds["sample_size"].values[row], ds["sample_count"].values[row]
