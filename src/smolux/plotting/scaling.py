"""Self-similar form of size distributions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from smolux.analysis.reference import is_deterministic
from smolux.analysis.scaling import mean_size
from smolux.analysis.statistics import over_replicas
from smolux.errors import InputError

from .curves import Look, described, draw_line, draw_values, handle
from .distribution import Classes, chosen_times
from .style import Width, axes_of, legend_above, root_of, styled, time_label, use_log


def _scaled(ds: xr.Dataset, time: int) -> tuple[np.ndarray, np.ndarray]:
    """Sizes in units of the mean size, and scaled densities of shape (replicas, points)."""
    classes = Classes.of(ds, time)
    s = float(mean_size(ds).values[time])
    mass = float(ds["moment"].sel(order=1.0).isel(time=time).mean("replica"))
    return classes.positions() / s, classes.density * (s**2 / mass)


@styled
def scaling(
    ds: xr.Dataset,
    times: Sequence[float] | None = None,
    *,
    reference: xr.Dataset | None = None,
    decades: float = 7.0,
    ax: Axes | None = None,
    width: Width = "single",
) -> Figure:
    """Draw ``s**2 n_k / M1`` over ``k / s`` with ``s = M2 / M1`` at several times.

    Where growth is self-similar, all fall on one curve.

    Parameters
    ----------
    ds : xarray.Dataset
        A result of simulate (dots with 95 % intervals) or of solve (lines).
    times : sequence of float, optional
        Output times; up to four, spread over the result, if left out.
    reference : Dataset, optional
        Another result, of which the last time is drawn as a line.
    decades : float
        Densities more than this many decades below the largest are not shown.
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
        If a time is not among the output times, or there is nothing to show.
    """
    chosen = chosen_times(ds, times)
    ax = axes_of(ax, width)
    use_log(ax, "x")
    use_log(ax, "y")
    handles, shown = list[Artist](), []
    for k, time in enumerate(chosen):
        look = Look.number(k)
        x, phi = _scaled(ds, time)
        if is_deterministic(ds):
            draw_line(ax, x, phi[0], look.colour)
        else:
            draw_values(ax, x, phi, look, counts=True, line=False, zorder=3)
        mean = over_replicas(phi)[1]
        shown.append(np.stack([x, mean])[:, mean > 0])
        label = time_label(float(ds["time"].values[time]), ds["time"].attrs.get("units"))
        handles.append(handle(ds, label, look, line=False))
    if reference is not None:
        x, phi = _scaled(reference, reference.sizes["time"] - 1)
        draw_line(ax, x, phi[0], "black", zorder=1)
        handles.append(Line2D([], [], color="black", label=described(reference)))
    points = np.concatenate(shown, axis=1)
    if not points.size:
        raise InputError("scaling: the result has no clusters at these times")
    top = float(points[1].max())
    points = points[:, points[1] >= top * 10.0**-decades]
    ax.set_xlim(points[0].min() / 1.5, points[0].max() * 1.5)
    ax.set_ylim(points[1].min() / 3, 3 * top)
    ax.set_xlabel("scaled size $k / s$, $s = M_2 / M_1$")
    ax.set_ylabel("scaled density $s^2 n_k / M_1$")
    legend_above(ax, handles)
    return root_of(ax)
