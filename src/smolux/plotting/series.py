"""Quantities over time: one variable, or the moments."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from smolux.analysis.reference import is_deterministic
from smolux.analysis.select import series
from smolux.analysis.statistics import over_replicas
from smolux.checks import orders_of_moments
from smolux.errors import InputError

from .curves import (
    Look,
    Reference,
    crowded,
    described,
    draw,
    draw_line,
    draw_solver,
    drawn_as,
    fine_times,
    resolve,
    solver_handle,
)
from .style import (
    GREY,
    Width,
    axes_of,
    label_axis,
    legend_above,
    prefers_log,
    root_of,
    styled,
    use_linear,
    use_log,
)

Float = NDArray[np.float64]

SYMBOLS = {
    "number_density": "number density $M_0$",
    "largest": "largest size",
    "particles": "simulated particles",
    "collisions": "collisions",
    "volume": "simulated volume $V$",
    "n_bin": "number density in bin",
}


def name_of(variable: str, order: float = 2.0, size: int = 1, process: str = "") -> str:
    """Return the name of a quantity for an axis."""
    if variable == "moment":
        return f"moment $M_{{{order:g}}}$"
    if variable == "n":
        return f"density $n_{{{size}}}$"
    if variable == "events":
        return f"collisions ({process})"
    return SYMBOLS.get(variable, variable.replace("_", " "))


def set_axes(ax: Axes, ds: xr.Dataset, values: np.ndarray, log: bool | None = None) -> bool:
    """Choose scales for time and values, before anything is drawn; say if time is logarithmic."""
    times = ds["time"].values
    log_time = prefers_log(times)
    for which, chosen in (("x", log_time), ("y", prefers_log(values) if log is None else log)):
        (use_log if chosen else use_linear)(ax, which)  # type: ignore[arg-type]
    return log_time


def label_time(ax: Axes, ds: xr.Dataset) -> None:
    """Label the axis of time, when all is drawn, and say if the start has no place on it."""
    label_axis(ax, "x", "time $t$", ds["time"].attrs.get("units"))
    if ax.get_xscale() == "log" and np.any(ds["time"].values == 0.0):
        ax.set_xlabel(f"{ax.get_xlabel()}, without $t = 0$")


def _exact_values(
    ds: xr.Dataset, solution: Any, times: Float, variable: str, which: dict[str, Any]
) -> Float:
    """Evaluate the exact solution; NaN where it does not know the quantity."""
    if variable == "number_density":
        values = solution.moment(times, 0)
    elif variable == "moment":
        # a simulation counts the infinite cluster, rate equations do not
        values = solution.moment(times, which["order"], gel=not is_deterministic(ds))
    elif variable == "n":
        values = solution.densities(times, np.array([which["size"]]))[:, 0]
    else:
        values = np.full(times.shape, np.nan)
    return np.asarray(values, float)


def draw_reference(
    ax: Axes,
    ds: xr.Dataset,
    reference: Any,
    variable: str,
    log_time: bool,
    colour: str,
    **which: Any,
) -> bool:
    """Draw an exact solution or another result as a line; say whether it was drawn.

    It lies behind points, and dashed in black on a band, which would hide it.
    """
    if reference is None:
        return False
    if isinstance(reference, xr.Dataset):
        times = reference["time"].values
        values = over_replicas(series(reference, variable, **which).values)[1]
    else:
        times = fine_times(ds, log_time)
        values = _exact_values(ds, reference, times, variable, which)
    if isinstance(reference, xr.Dataset) and not crowded(ds, log_time):
        draw_solver(ax, reference, values, colour, zorder=1)
    elif crowded(ds, log_time):
        draw_line(ax, times, values, "black", ls="--", lw=0.8, zorder=4)
    else:
        draw_line(ax, times, values, colour, zorder=1)
    return bool(np.isfinite(values).any())


def reference_handle(
    ds: xr.Dataset, reference: Any, name: str, colour: str, log_time: bool
) -> Artist:
    """Legend entry of the reference, drawn as `draw_reference` does."""
    if crowded(ds, log_time):
        return Line2D([], [], color="black", ls="--", lw=0.8, label=name)
    if isinstance(reference, xr.Dataset):
        return solver_handle(reference, name, colour, log_time)
    return Line2D([], [], color=colour, label=name)


@styled
def time_series(
    ds: xr.Dataset,
    variable: str = "number_density",
    *,
    order: float = 2.0,
    size: int = 1,
    process: str = "aggregation",
    reference: Reference = "exact",
    log: bool | None = None,
    ax: Axes | None = None,
    width: Width = "single",
) -> Figure:
    """One quantity over time.

    Parameters
    ----------
    ds : xarray.Dataset
        A result of simulate (dots with 95 % intervals, or a band where they are many) or of solve
        (a line).
    variable : str
        Name of a variable over replica and time.
    order, size, process
        Which moment, size or kind of event, where the variable has several.
    reference : "exact", Dataset or None
        A line to compare with: the exact solution, where it is known, or another result.
    log : bool, optional
        Whether the values are on a logarithmic axis; as they are spread if left out.
    ax : Axes, optional
        Where to draw; a new figure if left out.
    width : {"single", "double"}
        Column width of a new figure.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If there is no such variable, order, size or process.
    """
    which = {"order": order, "size": size, "process": process}
    curve = series(ds, variable, **which)  # type: ignore[arg-type]
    ax = axes_of(ax, width, 0.75)
    log_time = set_axes(ax, ds, curve.values, log)
    found, name = resolve(ds, reference)
    drawn = draw_reference(ax, ds, found, variable, log_time, "black", **which)
    draw(ax, ds, curve.values, Look.number(0), zorder=3)
    label = name_of(variable, order, size, process)
    label_axis(ax, "y", label, ds[variable].attrs.get("units"))
    label_time(ax, ds)
    handles = [drawn_as(ds, described(ds), Look.number(0), log_time)]
    if drawn:
        handles.append(reference_handle(ds, found, name, "black", log_time))
    legend_above(ax, handles)
    return root_of(ax)


@styled
def moments(
    ds: xr.Dataset,
    orders: Sequence[float] | None = None,
    *,
    reference: Reference = "exact",
    ax: Axes | None = None,
    width: Width = "single",
) -> Figure:
    """Moments of the size distribution over time.

    Parameters
    ----------
    ds : xarray.Dataset
        A result of simulate (dots with 95 % intervals) or of solve (lines).
    orders : sequence of float, optional
        Which; if left out, all of the result but the first, the mass, where it is conserved.
    reference : "exact", Dataset or None
        Lines to compare with.
    ax : Axes, optional
        Where to draw; a new figure if left out.
    width : {"single", "double"}
        Column width of a new figure.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If the result has no moment of such an order.
    """
    if orders is None:
        chosen = [p for p in ds["order"].values if p != 1 or "mass_in" in ds]
    else:
        chosen = orders_of_moments(orders).tolist()
    if not chosen:
        raise InputError("orders: name at least one, such as orders=(0, 2)")
    curves = [series(ds, "moment", order=float(p)) for p in chosen]
    ax = axes_of(ax, width)
    log_time = set_axes(ax, ds, np.concatenate([c.values.ravel() for c in curves]))
    found, name = resolve(ds, reference)
    drawn, handles = False, []
    for k, (p, curve) in enumerate(zip(chosen, curves, strict=True)):
        look = Look.number(k)
        drawn |= draw_reference(ax, ds, found, "moment", log_time, look.colour, order=float(p))
        draw(ax, ds, curve.values, look, zorder=3)
        handles.append(drawn_as(ds, f"$M_{{{p:g}}}$", look, log_time))
    label_axis(ax, "y", "moment $M_p$", ds["moment"].attrs.get("units"))
    label_time(ax, ds)
    if drawn:
        handles.append(reference_handle(ds, found, name, GREY, log_time))
    legend_above(ax, handles)
    return root_of(ax)
