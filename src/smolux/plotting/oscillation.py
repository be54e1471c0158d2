"""Oscillations: over time, and as a cycle in the plane of two moments."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from smolux.analysis.oscillations import oscillations as analyse
from smolux.analysis.reference import is_deterministic
from smolux.analysis.select import series

from .curves import described
from .series import label_time, name_of
from .style import PALETTE, Width, label_axis, legend_above, new_figure, styled, use_linear

Float = NDArray[np.float64]

#: replicas drawn one by one; more would only blacken the page
_SHOWN = 8


def _tracks(ax: Axes, x: Float, y: Float, line: bool) -> None:
    """Draw replicas one by one: their mean would decay as they drift out of phase."""
    rows = min(len(y), _SHOWN)
    colour, width, layer = ("black", 0.9, 3) if line else (PALETTE[0], 0.6, 2)
    for r in range(rows):
        x_r = np.broadcast_to(x, y.shape)[r]
        ax.plot(x_r, y[r], color=colour, lw=width, zorder=layer, alpha=0.6 if rows > 1 else 1.0)


@styled
def oscillations(
    ds: xr.Dataset,
    variable: str = "moment",
    *,
    order: float = 2.0,
    size: int = 1,
    against: str = "number_density",
    reference: xr.Dataset | None = None,
    start: float = 0.0,
    width: Width = "double",
) -> Figure:
    """Draw an oscillating quantity over time, and the cycle in the plane with another one.

    Parameters
    ----------
    ds : xarray.Dataset
        A result of simulate (up to eight replicas, one line each) or of solve.
    variable : str
        What oscillates.
    order, size
        Which moment or size, where the variable has several.
    against : str
        The other quantity of the plane.
    reference : Dataset, optional
        A result of solve, drawn in black.
    start : float
        Earlier times are left out of the cycle and of the analysis of extrema.
    width : {"single", "double"}
        With "single", the panels stand one above the other.

    Returns
    -------
    matplotlib.figure.Figure
        Open circles mark the extrema that `smolux.analysis.oscillations` finds; its mean period and
        amplitude stand above.

    Raises
    ------
    InputError
        If there is no such variable, order or size.
    """
    figure = new_figure(width, 0.42 if width == "double" else 1.45)
    shape = (1, 2) if width == "double" else (2, 1)
    ratios = {"width_ratios": (1.7, 1)} if width == "double" else {"height_ratios": (1, 1.2)}
    left, right = figure.subplots(*shape, **ratios)
    found = analyse(ds, variable, order=order, size=size, start=start)
    handles: list[Artist] = []
    for result, line in ((reference, True), (ds, is_deterministic(ds))):
        if result is None:
            continue
        y = series(result, variable, order=order, size=size)
        x = series(result, against, order=order, size=size)
        times = result["time"].values
        late = times >= start
        _tracks(left, times, y.values, line)
        _tracks(right, x.values[:, late], y.values[:, late], line)
        colour = "black" if line else PALETTE[0]
        text = described(result).split(",")[0]
        handles.append(Line2D([], [], color=colour, label=text))
    at, value = found["extremum_time"].values[:_SHOWN], found["extremum_value"].values[:_SHOWN]
    mark: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 2.6, "zorder": 4}
    mark |= {"mfc": "white", "color": PALETTE[1]}
    left.plot(at.ravel(), value.ravel(), **mark)
    for ax in (left, right):
        use_linear(ax, "x")
        use_linear(ax, "y")
        label_axis(ax, "y", name_of(variable, order, size), ds[variable].attrs.get("units"))
    label_time(left, ds)
    label_axis(right, "x", name_of(against, order, size), ds[against].attrs.get("units"))
    if np.isfinite(value).any():
        handles.append(Line2D([], [], label=_caption(found), **mark))
    legend_above(left, handles, spans=True)
    return figure


def _caption(found: xr.Dataset) -> str:
    period = float(found.attrs["period"])
    if not np.isfinite(period):
        return "extrema"
    return f"extrema: period {period:.4g}, amplitude {float(found.attrs['amplitude']):.3g}"
