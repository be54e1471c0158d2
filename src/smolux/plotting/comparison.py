"""The same case by several methods."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from smolux.analysis.reference import is_deterministic, solution_of
from smolux.analysis.select import matches, series
from smolux.analysis.statistics import Sample, mean_interval, over_replicas
from smolux.errors import InputError

from .curves import Look, draw, draw_line, draw_points, drawn_as
from .series import draw_reference, label_time, name_of, set_axes
from .style import Width, label_axis, legend_above, new_figure, styled, use_linear, use_log

Float = NDArray[np.float64]


def _reference(
    results: Mapping[str, xr.Dataset], variable: str, order: float, size: int
) -> tuple[str, Float, Float]:
    """Find what measures the others: a solver, else the exact solution, else the first."""
    for name, ds in results.items():
        if is_deterministic(ds):
            return name, ds["time"].values, series(ds, variable, order=order, size=size).values[0]
    name, ds = next(iter(results.items()))
    times, solution = ds["time"].values, solution_of(ds)
    values = None
    if solution is not None and variable in ("number_density", "moment"):
        values = solution.moment(times, 0 if variable == "number_density" else order, gel=True)
    elif solution is not None and variable == "n":
        values = solution.densities(times, np.array([size]))[:, 0]
    if values is not None and np.isfinite(values).any():
        return "exact", times, np.asarray(values, float)
    mean = over_replicas(series(ds, variable, order=order, size=size).values)[1]
    return name, times, mean


def _deviations(
    ax: Axes,
    ds: xr.Dataset,
    values: Float,
    reference: tuple[Float, Float],
    look: Look,
    shift: float,
) -> None:
    """Draw deviations in per cent at the times that the reference has too.

    `shift` moves the points sideways, in steps of a hundredth of the axis.
    """
    times = ds["time"].values
    here, there = matches(times, reference[0])
    sample = Sample.of(values[:, here])
    known = reference[1][there]
    with np.errstate(all="ignore"):
        percent = 100 * (sample.mean / known - 1)
        bars = np.abs(100 * (np.stack(mean_interval(sample)) - sample.mean) / known)
    low, high = ax.get_xlim()
    if ax.get_xscale() == "log":
        x = times[here] * (high / low) ** (0.01 * shift)
    else:
        x = times[here] + 0.01 * shift * (high - low)
    if is_deterministic(ds):
        draw_line(ax, times[here], percent, look.colour)
    else:
        draw_points(ax, x, percent, bars, look, zorder=3)


@styled
def comparison(
    results: Mapping[str, xr.Dataset],
    variable: str = "number_density",
    *,
    order: float = 2.0,
    size: int = 1,
    width: Width = "single",
) -> Figure:
    """Compare results of the same case: one quantity over time, and relative deviations below.

    Parameters
    ----------
    results : mapping of str to Dataset
        A name for each result.
    variable : str
        Which quantity.
    order, size
        Which moment or size, where the variable has several.
    width : {"single", "double"}
        Column width.

    Returns
    -------
    matplotlib.figure.Figure
        Deviations are measured by a solver among the results, else by the exact solution, else by
        the first result. Bars are 95 % intervals; points at the same time stand side by side.

    Raises
    ------
    InputError
        If there are no results, or one has no such quantity.
    """
    if not isinstance(results, Mapping) or not results:
        raise InputError(
            "results: must be a dictionary of names and results, {'inverse': ds_1, 'solver': ds_2}"
        )
    curves = {k: series(ds, variable, order=order, size=size) for k, ds in results.items()}
    figure = new_figure(width, 1.05 if width == "single" else 0.6)
    top, bottom = figure.subplots(2, sharex=True, height_ratios=(2, 1.2))
    first = next(iter(results.values()))
    log_time = set_axes(top, first, np.concatenate([c.values.ravel() for c in curves.values()]))
    (use_log if log_time else use_linear)(bottom, "x")
    name, times, known = _reference(results, variable, order, size)
    handles = list[Artist]()
    if name == "exact":
        which = {"order": order, "size": size}
        draw_reference(top, first, solution_of(first), variable, log_time, "black", **which)
        handles.append(Line2D([], [], color="black", label="exact"))
    # points lie on top of each other: the earlier ones are larger and open
    simulated = [label for label, ds in results.items() if not is_deterministic(ds)]
    looks = {
        label: replace(Look.number(k), hollow=label in simulated[:-1])
        for k, label in enumerate(results)
    }
    if name in results and is_deterministic(results[name]):
        looks[name] = Look("black", "o")
    for label, ds in results.items():
        layer = 2 if is_deterministic(ds) else 3
        later = len(simulated) - 1 - simulated.index(label) if layer == 3 else 0
        ring = {"ms": 3.2 + 1.8 * later} if later else {}
        draw(top, ds, curves[label].values, looks[label], zorder=layer, **ring)
        handles.append(drawn_as(ds, label, looks[label], log_time))
    others = [label for label in results if label != name]
    for k, label in enumerate(others):
        shift = k - (len(others) - 1) / 2
        values = curves[label].values
        _deviations(bottom, results[label], values, (times, known), looks[label], shift)
    bottom.axhline(0, color="black", lw=0.6, zorder=1)
    use_linear(bottom, "y")
    label = name_of(variable, order, size)
    label_axis(top, "y", label, first[variable].attrs.get("units"))
    label_time(bottom, first)
    label_axis(bottom, "y", "deviation", "%")
    legend_above(top, handles)
    return figure
