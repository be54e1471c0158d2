"""A summary as text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import floor, isfinite, log10, nan

import numpy as np
import xarray as xr

from smolux.errors import InputError, did_you_mean
from smolux.results import require


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}g}" if isfinite(value) else "-" if value != value else f"{value:g}"


def pair(mean: float, lower: float, upper: float) -> tuple[str, str]:
    """Write a mean to the second digit of its interval, and the interval, by one or two numbers."""
    low, high = mean - lower, upper - mean
    half = max(low, high)
    if not (isfinite(mean) and isfinite(half) and half > 0 and mean != 0):
        return _number(mean, 6), _number(half, 2)
    if half > abs(mean):
        digits = 2
    else:
        digits = min(max(floor(log10(abs(mean))) - floor(log10(half)) + 2, 2), 12)
    one = abs(high - low) < 0.1 * half  # by less than its two digits can well show
    return _number(mean, digits), f"±{half:.2g}" if one else f"-{low:.2g} +{high:.2g}"


def _rows(variable: xr.DataArray) -> list[tuple[str, ...]]:
    """Header and rows of one table; columns of which nothing is known are left out."""
    column = {str(k): variable.sel(statistic=k).values for k in variable["statistic"].values}
    scatter = bool(np.any(np.isfinite(column["standard_error"])))
    known = bool(np.any(~np.isnan(column["exact"])))
    header = ["time", "mean", "95 %"] if scatter else ["time", "value"]
    if known:
        header += ["exact", "sigmas" if scatter else "relative difference"]
    rows = [tuple(header)]
    for t, time in enumerate(variable["time"].values):
        mean, exact = float(column["mean"][t]), float(column["exact"][t])
        cells = pair(mean, float(column["lower"][t]), float(column["upper"][t]))
        row = [_number(float(time), 6), *cells[: 2 if scatter else 1]]
        if scatter and column["doubtful"][t] == 1:
            row[-1] += "?"
        if known:
            relative = (mean - exact) / abs(exact) if exact else nan
            last = float(column["sigmas"][t]) if scatter else relative
            row += [_number(exact, 6), _number(last, 2)]
        rows.append(tuple(row))
    return rows


def _sections(summary: xr.Dataset, names: Sequence[str]) -> Iterator[tuple[str, xr.DataArray]]:
    for name in names:
        variable = summary[name]
        title = str(variable.attrs.get("long_name", name))
        others = [str(d) for d in variable.dims if d not in ("time", "statistic")]
        if not others:
            yield title, variable
            continue
        for label in variable[others[0]].values:
            if others[0] == "order" and label == 0 and "number_density" in names:
                continue
            what = f"moment M{label:g}" if others[0] == "order" else f"density of size {label:g}"
            yield what, variable.sel({others[0]: label})


def tables(
    summary: xr.Dataset, variables: Sequence[str] | None = None
) -> list[tuple[str, list[tuple[str, ...]]]]:
    """Turn a summary into tables of texts, for whatever shows them.

    Parameters
    ----------
    summary : xarray.Dataset
        Made by `smolux.summary`.
    variables : sequence of str, optional
        Which of number_density, moment and n; all if left out.

    Returns
    -------
    list of (str, list of tuple of str)
        A title and rows for each quantity; the first row is the header: time, mean, 95 %, exact
        and sigmas. Without any scatter (a solver, a single replica) the columns are time, value,
        exact and relative difference. Without an exact solution the last two are left out.

    Raises
    ------
    InputError
        If there is no such variable.
    """
    require(summary, what="summary", source="smolux.summary")
    if "statistic" not in summary.dims:
        raise InputError("summary: make it with smolux.summary(ds) first")
    known = [str(name) for name in summary.data_vars]
    unknown = [name for name in variables or () if name not in known]
    if unknown:
        raise InputError([f"variables: no {name!r}{did_you_mean(name, known)}" for name in unknown])
    return [(title, _rows(variable)) for title, variable in _sections(summary, variables or known)]


def format_table(summary: xr.Dataset, variables: Sequence[str] | None = None) -> str:
    """Write a summary as tables for the terminal: time, mean, 95 % half width, exact, sigmas.

    Parameters
    ----------
    summary : xarray.Dataset
        Made by `smolux.summary`.
    variables : sequence of str, optional
        Which of number_density, moment and n; all if left out.

    Returns
    -------
    str
        A dash stands for what is not known, a question mark behind an interval for too few
        replicas to promise 95 %. For the columns see `tables`.

    Raises
    ------
    InputError
        If there is no such variable.
    """
    lines: list[str] = []
    for title, rows in tables(summary, variables):
        lines += [title, *aligned(rows), ""]
    words = [summary.attrs.get(name, "") for name in ("notes", "mass")]
    return "\n".join([*lines, *(w for w in words if w)]).rstrip() + "\n"


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Write rows of cells as lines with columns of one width."""
    width = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(c.rjust(w) for c, w in zip(r, width, strict=True)) for r in rows]
