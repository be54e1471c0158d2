"""The results of the points of a sweep as one dataset, and that as a table."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from smolux.errors import InputError
from smolux.results import require, warnings

from .statistics import Sample, mean_interval
from .table import aligned, pair

#: describe the bins, which may differ in number from point to point
_BIN_COORDINATES = ("bin_lower", "bin_upper", "bin_width")
_KEPT = ("Conventions", "title", "source", "smolux_schema", "method", "platform", "versions")
_LONG_NAMES = {
    "point_status": "whether the point was computed: done or failed",
    "point_message": "why a point failed",
    "point_seed": "seed of the point",
    "point_seconds": "wall time of the point",
    "point_warnings": "warnings of the point",
}


def combine_sweep(
    axes: Mapping[str, Sequence[Any]],
    points: Sequence[xr.Dataset | None],
    messages: Sequence[str],
) -> xr.Dataset:
    """Put results together with a dimension for each key.

    Parameters
    ----------
    axes : mapping
        Keys and their values.
    points : sequence of Dataset or None
        In the order of the grid, the last key fastest; None for a point that failed.
    messages : sequence of str
        Why points failed.

    Returns
    -------
    xarray.Dataset
        What the points have not in common, such as replicas or bins, is filled up with NaN.

    Raises
    ------
    InputError
        If there is no result at all.
    """
    present = [ds for ds in points if ds is not None]
    if not present:
        raise InputError("points: all of them failed, there is nothing to gather")
    bins = _bins(present)
    template = _plain(present[0])
    empty = template.where(False)
    parts = [
        _described(empty if ds is None else _plain(ds), ds, message)
        for ds, message in zip(points, messages, strict=True)
    ]
    for key, values in reversed(list(axes.items())):
        index = xr.DataArray(_labels(values), dims=key, name=key)
        rows = range(0, len(parts), len(values))
        parts = [_joined(parts[r : r + len(values)], index) for r in rows]
    (result,) = parts
    for name in _BIN_COORDINATES:
        if "bin" in result.dims:
            column = [bins[float(b)][name] for b in result["bin"].values]
            result = result.assign_coords({name: ("bin", column)})
    _describe(result, present[0])
    result.attrs = {k: v for k, v in present[0].attrs.items() if k in _KEPT}
    result.attrs["complete"] = int(all(ds is not None for ds in points))
    result.attrs["sweep"] = json.dumps({k: list(v) for k, v in axes.items()})
    result.attrs["warnings"] = json.dumps(_warnings(present))
    return result


def _labels(values: Sequence[Any]) -> list[Any]:
    """Return values that can be coordinates: all numbers, or all texts."""
    numbers = all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values)
    return list(values) if numbers else [str(v) for v in values]


def _joined(parts: list[xr.Dataset], index: xr.DataArray) -> xr.Dataset:
    return xr.concat(
        parts, dim=index, data_vars="all", coords="minimal", compat="override", join="outer",
        combine_attrs="drop_conflicts",
    )  # fmt: skip


def _plain(ds: xr.Dataset) -> xr.Dataset:
    """Leave out whole populations, which have no common shape, and what describes the bins."""
    ragged = [n for n, v in ds.variables.items() if {"instance", "sample"} & set(v.dims)]
    return ds.drop_vars([*ragged, *(n for n in _BIN_COORDINATES if n in ds.variables)])


def _bins(present: Sequence[xr.Dataset]) -> dict[float, dict[str, float]]:
    return {
        float(b): {name: float(ds[name].values[k]) for name in _BIN_COORDINATES}
        for ds in present
        for k, b in enumerate(ds["bin"].values)
    }


def _described(part: xr.Dataset, ds: xr.Dataset | None, message: str) -> xr.Dataset:
    attributes: Mapping[str, Any] = {} if ds is None else ds.attrs
    return part.assign(
        point_status="failed" if ds is None else "done",
        point_message=message,
        point_seed=str(attributes.get("seed", "")),
        point_seconds=float(attributes.get("wall_seconds", np.nan)),
        point_warnings=str(attributes.get("warnings", "[]")),
    )


def _describe(result: xr.Dataset, like: xr.Dataset) -> None:
    for name in map(str, result.variables):
        if name in like.variables:
            result[name].attrs = dict(like[name].attrs)
        elif name in _LONG_NAMES:
            result[name].attrs["long_name"] = _LONG_NAMES[name]
    result["point_seconds"].attrs["units"] = "s"


def _warnings(present: Sequence[xr.Dataset]) -> list[str]:
    counted: dict[str, int] = {}
    for ds in present:
        for text in warnings(ds):
            counted[text] = counted.get(text, 0) + 1
    return [text if n == 1 else f"{text} (at {n} points)" for text, n in counted.items()]


def sweep_table(ds: xr.Dataset) -> tuple[list[str], list[list[str]]]:
    """Write a sweep as a table: one row for each point, its values at the last output time.

    Parameters
    ----------
    ds : xarray.Dataset
        Made by `smolux.sweep`.

    Returns
    -------
    header : list of str
    rows : list of list of str

    Raises
    ------
    InputError
        If it is no sweep.
    """
    require(ds, "time", source="sweep")
    if "sweep" not in ds.attrs:
        raise InputError("ds: is no result of smolux.sweep")
    keys = list(json.loads(ds.attrs["sweep"]))
    columns = {"clusters": ds["number_density"]}
    if 2 in ds["order"].values:
        columns["M2"] = ds["moment"].sel(order=2)
    columns["largest"] = ds["largest"]
    several = ds.sizes["replica"] > 1
    header = [*keys]
    for name in columns:
        header += [name, "95 %"] if several else [name]
    rows = []
    for place in np.ndindex(*(ds.sizes[k] for k in keys)):
        at = dict(zip(keys, place, strict=True))
        row = [_text(ds[k].values[n]) for k, n in at.items()]
        for values in columns.values():
            row += _cells(values.isel(at), several)
        status = str(ds["point_status"].isel(at).values)
        rows.append([*row, "" if status == "done" else status])
    return [*header, ""], rows


def _text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, (float, np.floating)) else str(value)


def _cells(values: xr.DataArray, several: bool) -> list[str]:
    """Return the mean at the last time that was reached, and its interval."""
    table = values.transpose("replica", "time").values
    reached = np.flatnonzero(np.isfinite(table).any(axis=0))
    if not reached.size:
        return ["-", "-"] if several else ["-"]
    sample = Sample.of(table[:, reached[-1]])
    lower, upper = mean_interval(sample)
    _, half = pair(float(sample.mean), float(lower), float(upper))
    cells = [f"{float(sample.mean):.5g}", half]
    return cells if several else cells[:1]


def format_sweep(ds: xr.Dataset) -> str:
    """Write a sweep as text: one line for each point, with its values at the last output time.

    Parameters
    ----------
    ds : xarray.Dataset
        Made by `smolux.sweep`.

    Returns
    -------
    str

    Raises
    ------
    InputError
        If it is no sweep.
    """
    header, rows = sweep_table(ds)
    lines = [line.rstrip() for line in aligned([header, *rows])]
    title = str(ds.attrs.get("title", ""))
    time = f"at t = {float(ds['time'].values[-1]):g}, or the last time that was reached"
    return "\n".join([*([title] if title else []), time, "", *lines]) + "\n"
