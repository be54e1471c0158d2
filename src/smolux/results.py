"""The shape of every result: an `xarray.Dataset` with units, provenance and the seed; its files."""

from __future__ import annotations

import csv
import datetime
import io
import json
import os
import platform
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray
from xarray.indexes import PandasIndex

from . import __version__
from .errors import InputError, warn
from .files import replacing
from .model import Model
from .model_dict import model_to_dict
from .records import Records

Float = NDArray[np.float64]
Result = TypeVar("Result", xr.Dataset, xr.DataTree)

#: raised whenever a name, a dimension or a meaning changes
SCHEMA = 1

#: variable -> (dimensions, long name)
VARIABLES: dict[str, tuple[tuple[str, ...], str]] = {
    "number_density": (("replica", "time"), "number of clusters per unit volume"),
    "moment": (("replica", "time", "order"), "moment of the size distribution, sum_k k^p n_k"),
    "largest": (("replica", "time"), "size of the largest cluster"),
    "particles": (("replica", "time"), "number of simulated particles"),
    "collisions": (("replica", "time"), "number of collisions so far"),
    "volume": (("replica", "time"), "simulated volume"),
    "n": (("replica", "time", "size"), "number density of clusters of one size"),
    "n_bin": (("replica", "time", "bin"), "number density of clusters in a bin of sizes"),
    "events": (("replica", "time", "process"), "number of collisions so far, by outcome"),
    "attempts": (("replica", "process"), "number of candidates for these, accepted or not"),
    "extinction_time": (("replica",), "time at which all particles had become one cluster"),
}

_COORDINATES = {
    "replica": "replica",
    "time": "time",
    "order": "order of the moment",
    "size": "cluster size in monomers",
    "process": "outcome of a collision",
    "bin": "geometric centre of the sizes in a bin",
    "bin_lower": "smallest size in a bin",
    "bin_upper": "edge above a bin: the bin holds the whole sizes bin_lower <= k < bin_upper",
    "bin_width": "number of whole sizes in a bin",
}


def _attribute(value: Any) -> Any:
    """Return what netCDF can hold: a text, a number or numbers; all else becomes JSON text."""
    if isinstance(value, (bool, np.bool_)):
        return int(value)
    if isinstance(value, (int, np.integer)) and not isinstance(value, np.timedelta64):
        # seeds have up to 128 bits
        return int(value) if -(2**63) <= value < 2**63 else str(value)
    if isinstance(value, (float, np.floating)):
        return float(value)
    if (
        isinstance(value, np.ndarray)
        and value.dtype.kind in "iuf"
        and value.ndim == 1 <= value.size
    ):
        return value
    return _text(value)


def _text(value: Any) -> str:
    """Return a text that HDF5 takes: a text as it is, unless it is not valid; else JSON."""
    if isinstance(value, str):
        try:
            if b"\0" not in value.encode():
                return value
        except UnicodeEncodeError:
            pass
    try:
        return json.dumps(value, default=_listed)
    except (TypeError, ValueError):  # keys that are no texts, or something within itself
        return json.dumps(repr(value))


def _listed(value: Any) -> Any:
    """Return what JSON does not know as what it does: numbers of NumPy, else a text."""
    known = isinstance(value, (np.ndarray, np.generic)) and value.dtype.kind not in "mM"
    return value.tolist() if known else str(value)


def _versions() -> dict[str, str]:
    versions = {"smolux": __version__, "python": platform.python_version()}
    for package in ("numpy", "scipy", "numba", "xarray"):
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = "unknown"
    return versions


def _bins(edges: Float) -> dict[str, Any]:
    """Coordinates of bins ``edges[b] <= k < edges[b + 1]`` of whole sizes."""
    edges = np.asarray(edges, float)
    first, stop = np.ceil(edges[:-1]), np.ceil(edges[1:])
    last = np.maximum(stop - 1, first)
    return {
        "bin": np.sqrt(first * last),
        "bin_lower": ("bin", first),
        "bin_upper": ("bin", stop),
        "bin_width": ("bin", stop - first),
    }


def _ragged(records: Records) -> dict[str, Any]:
    """Return whole populations as a CF contiguous ragged array, one row for a replica and time."""
    if records.distribution is None:
        return {}
    times, replicas = len(records.times), len(records.distribution)
    rows = [
        replica[t] if t < len(replica) else ((), ())
        for replica in records.distribution
        for t in range(times)
    ]
    sizes = [np.asarray(size, np.int64) for size, _ in rows]
    counts = [np.asarray(count, np.int64) for _, count in rows]
    empty = [np.empty(0, np.int64)]
    return {
        "instance_replica": ("instance", np.repeat(np.arange(replicas), times)),
        "instance_time": ("instance", np.tile(np.asarray(records.times, float), replicas)),
        "row_size": ("instance", np.array([s.size for s in sizes], np.int64)),
        "sample_size": ("sample", np.concatenate(sizes + empty)),
        "sample_count": ("sample", np.concatenate(counts + empty)),
    }


#: of systems that are open, see `Records.balance`
_BALANCE = {
    "mass": "mass in the simulated volume, in monomers",
    "mass_in": "mass that sources have brought into this volume",
    "mass_out": "mass that has left this volume",
}

_RAGGED_NAMES = {
    "instance_replica": "replica of a population",
    "instance_time": "time of a population",
    "row_size": "number of different sizes in a population",
    "sample_size": "cluster size in monomers",
    "sample_count": "number of simulated particles of that size",
}


def provenance(title: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the attributes of a result: where it comes from, and all that is `given` about it."""
    own = {
        "Conventions": "CF-1.11",
        "title": title,
        "source": f"smolux {__version__}",
        "smolux_schema": SCHEMA,
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "platform": platform.platform(),
        "versions": _versions(),
    }
    known = {key: value for key, value in given.items() if value is not None}
    return {key: _attribute(value) for key, value in (own | known).items()}


def _provenance(model: Model, records: Records) -> dict[str, Any]:
    own = {"model": model_to_dict(model), "warnings": list(records.warnings)}
    given = {k: v for k, v in records.attributes.items() if k != "units"}
    return provenance("Kinetics of aggregation and fragmentation", own | given)


def to_dataset(model: Model, records: Records) -> xr.Dataset:
    """Put the records of a computation into the Dataset that every method and solver returns.

    Parameters
    ----------
    model : Model
        What was computed; stored as JSON text in the attribute ``model``.
    records : Records
        What was observed. Its ``attributes`` become attributes of the result; an entry ``units``
        of it maps names of variables to their units, which are "1" where it says nothing.

    Returns
    -------
    xarray.Dataset
        With the dimensions replica, time, order, size, bin and process, see the page on the
        dataset in the reference documentation.
    """
    units: Mapping[str, str] = records.attributes.get("units") or {}
    replicas = np.shape(records.number_density)[0]
    ragged = _ragged(records)
    coordinates: dict[str, Any] = {
        "replica": np.arange(replicas),
        "time": np.asarray(records.times, float),
        "order": np.asarray(records.orders, float),
        "size": np.arange(1, np.shape(records.n)[2] + 1),
        "process": np.asarray(records.processes, dtype=np.str_),
        **_bins(records.bin_edges),
        **{k: ragged.pop(k) for k in ("instance_replica", "instance_time") if k in ragged},
    }
    values = {
        name: (dims, np.asarray(getattr(records, name), float))
        for name, (dims, _) in VARIABLES.items()
        if getattr(records, name) is not None
    }
    if records.balance is not None:
        mass = (np.asarray(column, float) for column in records.balance)
        values |= {k: (("replica", "time"), m) for k, m in zip(_BALANCE, mass, strict=True)}
    ds = xr.Dataset({**values, **ragged}, _indexed(coordinates), _provenance(model, records))
    long_names = _COORDINATES | _RAGGED_NAMES | _BALANCE
    long_names |= {k: text for k, (_, text) in VARIABLES.items()}
    for name in map(str, ds.variables):
        ds[name].attrs["long_name"] = long_names[name]
        if name not in ("process", "replica", "instance_replica"):
            ds[name].attrs["units"] = units.get(name, "1")
    if "row_size" in ds:
        ds["row_size"].attrs["sample_dimension"] = "sample"
    return ds


def _indexed(coordinates: Mapping[str, Any]) -> xr.Coordinates:
    """Return the same with indexes: to make them, xarray would load every library of arrays."""
    found: dict[str, Any] = {}
    indexes = {}
    for name, values in coordinates.items():
        if isinstance(values, np.ndarray):
            index = PandasIndex(pd.Index(values), name, coord_dtype=values.dtype)
            found |= index.create_variables()
            indexes[name] = index
        else:
            found[name] = values
    return xr.Coordinates(found, indexes)


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


def save(ds: xr.Dataset | xr.DataTree, path: str | os.PathLike[str]) -> Path:
    """Write a result as a netCDF-4 file, whole or not at all.

    Parameters
    ----------
    ds : xarray.Dataset or xarray.DataTree
    path : str or path
        Replaced in one step if it exists; see `smolux.files.replacing`.

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
        holder.attrs = {str(k): _attribute(v) for k, v in holder.attrs.items()}
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
