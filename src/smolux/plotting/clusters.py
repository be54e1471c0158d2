"""The number of clusters, and its deviations from the expectation."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from smolux.analysis.compare import compare
from smolux.analysis.reference import is_deterministic

from .curves import Look, Reference, crowded, described, draw, drawn_as, resolve
from .series import draw_reference, label_time, reference_handle, set_axes
from .style import Width, label_axis, legend_above, new_figure, styled, use_linear, use_log


@styled
def clusters(ds: xr.Dataset, *, reference: Reference = "exact", width: Width = "single") -> Figure:
    """Draw the number of clusters per unit volume over time, and its deviations below.

    Parameters
    ----------
    ds : xarray.Dataset
        A result of simulate or solve.
    reference : "exact", Dataset or None
        What it is compared with. Without any, or without an interval (a single replica), there is
        no panel of deviations.
    width : {"single", "double"}
        Column width.

    Returns
    -------
    matplotlib.figure.Figure
        The lower panel shows the deviation of the mean from the reference in standard deviations of
        the normal law; the shaded band, two of them, holds 95 % of the points if all agrees.
    """
    found, name = resolve(ds, reference)
    sigmas = None
    if found is not None and not is_deterministic(ds):
        table = compare(ds, reference)["number_density"]  # type: ignore[arg-type]
        sigmas = table.sel(statistic="sigmas")
        sigmas = sigmas if np.isfinite(sigmas.values).any() else None
    figure = new_figure(width, 0.75 if sigmas is None else 0.95)
    if sigmas is None:
        top = figure.subplots()
    else:
        top, bottom = figure.subplots(2, sharex=True, height_ratios=(2.6, 1))
    values = ds["number_density"].transpose("replica", "time").values
    log_time = set_axes(top, ds, values)
    drawn = draw_reference(top, ds, found, "number_density", log_time, "black")
    draw(top, ds, values, Look.number(0), zorder=3)
    label_axis(top, "y", "number density $M_0$", ds["number_density"].attrs.get("units"))
    handles = [drawn_as(ds, described(ds), Look.number(0), log_time)]
    if drawn:
        handles.append(reference_handle(ds, found, name, "black", log_time))
    legend_above(top, handles)
    if sigmas is None:
        label_time(top, ds)
    else:
        (use_log if log_time else use_linear)(bottom, "x")
        z = np.clip(sigmas.values, -99, 99)
        bottom.axhspan(-2, 2, color="0.9", lw=0)
        bottom.axhline(0, color="black", lw=0.6)
        look = Look.number(0)
        size = 1.8 if crowded(ds, log_time) else 3.2
        bottom.plot(sigmas["time"].values, z, ls="none", marker="o", ms=size, color=look.colour)
        limit = 1.15 * max(3.0, float(np.nanmax(np.abs(z))))
        bottom.set_ylim(-limit, limit)
        bottom.yaxis.set_major_locator(MaxNLocator(5, integer=True, steps=[1, 2, 5, 10]))
        use_linear(bottom, "y")
        bottom.set_ylabel(r"deviation ($\sigma$)")
        label_time(bottom, ds)
    return figure
