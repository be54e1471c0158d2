"""Files of results: netCDF, and text for spreadsheets."""

from __future__ import annotations

import csv
import io
import os
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from smolux import __version__
from smolux.errors import InputError
from smolux.runtime.files import replacing

from .attributes import SCHEMA, attribute
from .reading import require

Float = NDArray[np.float64]


def save(ds: xr.Dataset | xr.DataTree, path: str | os.PathLike[str]) -> Path:
    """Write a result as a netCDF-4 file, whole or not at all.

    Parameters
    ----------
    ds : xarray.Dataset or xarray.DataTree
    path : str or path
        Replaced in one step if it exists; see `smolux.runtime.files.replacing`.

    Returns
    -------
    pathlib.Path

    Notes
    -----
    Attributes that netCDF cannot hold are written as what it can: True as 1, None, lists and
    dictionaries as JSON text.

    Raises
    ------
    InputError
        If the folder does not exist.
    OSError
        If the disk is full or read-only; an old file stays as it was.
    """
    require(ds, source="smolux", tree=True)
    # in memory first: HDF5 crashes the process when the disk fills up while it writes
    if isinstance(ds, xr.DataTree):
        tree = ds.map_over_datasets(_writable)
        encodings = {node.path: _packing(node.to_dataset(inherit=False)) for node in tree.subtree}
        content = tree.to_netcdf(engine="h5netcdf", encoding=encodings)
    else:
        ds = _writable(ds)
        content = ds.to_netcdf(engine="h5netcdf", encoding=_packing(ds))
    with replacing(path) as temporary:
        temporary.write_bytes(content)
    return Path(path)


def _writable(ds: xr.Dataset) -> xr.Dataset:
    """Return a copy whose attributes, and those of its variables, are what netCDF can hold."""
    ds = ds.drop_encoding()
    holders: list[Any] = [ds, *ds.variables.values()]
    for holder in holders:
        holder.attrs = {str(k): attribute(v) for k, v in holder.attrs.items()}
    return ds


def _packing(ds: xr.Dataset) -> dict[Any, dict[str, Any]]:
    """How the arrays of a file are compressed."""
    # small arrays gain nothing; shuffling the bytes first is what makes doubles compress
    packed = {"zlib": True, "complevel": 4, "shuffle": True}
    return {
        name: packed
        for name, variable in ds.variables.items()
        if variable.size > 2048 and variable.dtype.kind in "fi"
    }


def load(path: str | os.PathLike[str]) -> Any:
    """Read a result that `save` wrote; bit for bit the same, all in memory.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    xarray.Dataset, or xarray.DataTree of a spatial run

    Raises
    ------
    InputError
        If there is no such file, or if it is no netCDF file, no result of smolux, or one of a newer
        version of smolux.
    """
    file = Path(path).expanduser()
    if not file.is_file():
        what = "is a folder" if file.is_dir() else "there is no such file"
        raise InputError(f"path = {str(path)!r}: {what}; name a results file such as results.nc")
    try:
        ds = xr.load_dataset(file, engine="h5netcdf", decode_times=False)
        tree = None
        if ds.attrs.get("kind") == "spatial":
            tree = xr.load_datatree(file, engine="h5netcdf", decode_times=False)
    except PermissionError:
        raise
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        raise InputError(
            f"path = {str(path)!r}: cannot be read as netCDF-4 ({error}); "
            "it is another kind of file, or a damaged one"
        ) from error
    if "smolux_schema" not in ds.attrs:
        raise InputError(
            f"path = {str(path)!r}: is a netCDF file, but not one that smolux wrote "
            "(it has no attribute 'smolux_schema')"
        )
    if ds.attrs["smolux_schema"] > SCHEMA:
        raise InputError(
            f"path = {str(path)!r}: was written by a newer version, {ds.attrs.get('source')}; "
            f"this is smolux {__version__}: pip install --upgrade smolux"
        )
    attributes = {k: v.item() if isinstance(v, np.generic) else v for k, v in ds.attrs.items()}
    if tree is not None:
        tree = tree.map_over_datasets(lambda node: node.drop_encoding())
        tree.attrs = attributes
        return tree
    ds.attrs = attributes
    return ds.drop_encoding()


def to_csv(ds: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Write the time series of a result for a spreadsheet: one row for each replica and time.

    The columns are replica, time, every quantity of (replica, time) and, side by side, the moments
    (``moment_2``) and the collisions by outcome (``events_shattering``). What was not reached is
    an empty cell. Numbers have as many digits as it takes to read back the same double.

    Parameters
    ----------
    ds : xarray.Dataset
    path : str or path

    Returns
    -------
    pathlib.Path

    Raises
    ------
    InputError, OSError
        As for `save`.
    """
    require(ds, "replica", "time")
    columns: dict[str, Float] = {}
    for name, variable in ds.data_vars.items():
        if variable.dims == ("replica", "time"):
            columns[str(name)] = variable.values
        elif variable.dims in (("replica", "time", "order"), ("replica", "time", "process")):
            labels = ds[variable.dims[2]].values
            for k, label in enumerate(labels):
                text = f"{label:g}" if variable.dims[2] == "order" else label
                columns[f"{name}_{text}"] = variable.values[:, :, k]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["replica", "time", *columns])
    for r, replica in enumerate(ds["replica"].values):
        for t, time in enumerate(ds["time"].values):
            row = [float(values[r, t]) for values in columns.values()]
            table.writerow([replica, float(time), *("" if v != v else repr(v) for v in row)])
    with replacing(path) as temporary:
        temporary.write_text(text.getvalue(), encoding="utf-8")
    return Path(path)
