"""Efficiencies as text."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from smolux.analysis.table import aligned
from smolux.errors import InputError

_HEADER = (
    "method", "weighting", "bias %", "95 %", "variance", "95 %", "cost µs", "efficiency", "95 %",
    "ratio", "95 %", "",
)  # fmt: skip


def _interval(low: float, high: float) -> str:
    return f"{low:.3g} to {high:.3g}" if np.isfinite([low, high]).all() else "-"


def _number(value: float) -> str:
    return "-" if value != value else f"{value:.3g}"


def _row(place: xr.Dataset) -> tuple[str, ...]:
    """Cells of one method and weighting, for one observable and time."""
    v = {str(name): float(values) for name, values in place.data_vars.items()}
    percent = 100.0 / abs(v["reference"]) if v["reference"] else np.nan
    bias, half = percent * v["bias"], percent * (v["bias_upper"] - v["bias"])
    return (
        str(place["method"].values), str(place["weighting"].values),
        _number(bias), f"±{half:.2g}" if np.isfinite(half) else "-",
        _number(v["variance"]), _interval(v["variance_lower"], v["variance_upper"]),
        _number(1e6 * v["cost"]),
        _number(v["efficiency"]), _interval(v["efficiency_lower"], v["efficiency_upper"]),
        _number(v["ratio"]), _interval(v["ratio_lower"], v["ratio_upper"]),
        "best" if v["best"] else "",
    )  # fmt: skip


def efficiency_tables(ds: xr.Dataset) -> Iterator[tuple[str, list[tuple[str, ...]]]]:
    """Turn what `efficiency` returns into tables of texts: a title and rows, the header first."""
    if "ratio" not in ds or "cost" not in ds:
        raise InputError("ds: make it with smolux.efficiency first")
    for name in map(str, ds["observable"].values):
        for t, time in enumerate(ds["time"].values):
            here = ds.sel(observable=name).isel(time=t)
            rows = [_HEADER, *(_row(here.isel(scheme=k)) for k in range(ds.sizes["scheme"]))]
            yield f"{name} at t = {time:g}", rows


def efficiency_table(ds: xr.Dataset) -> str:
    """Write what `smolux.efficiency` returns as tables, one for each observable and time.

    Parameters
    ----------
    ds : xarray.Dataset

    Returns
    -------
    str
        Bias in per cent of the reference, variance of a replica, cost, efficiency and its ratio to
        that of the first row, with 95 % intervals; "best" where no other row is more efficient
        beyond chance. A dash stands for what is not known.

    Raises
    ------
    InputError
        If the dataset is another one.
    """
    lines: list[str] = []
    for title, rows in efficiency_tables(ds):
        lines += [title, *aligned(rows), ""]
    return "\n".join(lines)
