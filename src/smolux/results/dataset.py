"""The shape of every result: an `xarray.Dataset` with units, provenance and the seed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray
from xarray.indexes import PandasIndex

from smolux import observables
from smolux.model import Model
from smolux.model_dict import model_to_dict
from smolux.results.records import Records

from .attributes import provenance

Float = NDArray[np.float64]

#: variable -> (dimensions, long name)
VARIABLES = {o.name: (o.dims, o.long_name) for o in observables.OBSERVABLES}


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
        **_joint(records),
    }


def _joint(records: Records) -> dict[str, Any]:
    """Return what the particles of whole populations carry."""
    if records.joint is None:
        return {}
    times, width = len(records.times), len(records.components)
    none = np.empty((0, width), np.int64)
    rows = [r[t] if t < len(r) else none for r in records.joint for t in range(times)]
    return {"sample_composition": (("sample", "component"), np.concatenate([*rows, none]))}


def _values(records: Records, lengths: Mapping[str, int]) -> dict[str, Any]:
    """Return the variables; those that every result has are NaN where they are not known."""
    found: dict[str, Any] = {}
    for o in observables.OBSERVABLES:
        if o.name in records.values:
            found[o.name] = (o.dims, np.asarray(records.values[o.name], float))
        elif o.everywhere:
            found[o.name] = (o.dims, np.full([lengths[d] for d in o.dims], np.nan))
    return found


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
    replicas, ragged = len(records.values["number_density"]), _ragged(records)
    coordinates: dict[str, Any] = {
        "replica": np.arange(replicas),
        "time": np.asarray(records.times, float),
        "order": np.asarray(records.orders, float),
        "size": np.arange(1, np.shape(records.values["n"])[2] + 1),
        "process": np.asarray(records.processes, dtype=np.str_),
        **_bins(records.bin_edges),
        **({"component": np.asarray(records.components)} if records.components else {}),
        **{k: ragged.pop(k) for k in ("instance_replica", "instance_time") if k in ragged},
    }
    values = _values(records, {k: len(v) for k, v in coordinates.items()})
    ds = xr.Dataset({**values, **ragged}, _indexed(coordinates), _provenance(model, records))
    long_names = {name: text for name, (text, _) in observables.COORDINATES.items()}
    long_names |= {o.name: o.long_name for o in observables.OBSERVABLES}
    for name in map(str, ds.variables):
        ds[name].attrs["long_name"] = long_names[name]
        if name not in ("process", "replica", "instance_replica", "component"):
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
