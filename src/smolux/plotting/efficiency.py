"""Efficiencies of methods and weightings."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from smolux.errors import InputError

from .curves import Look
from .style import GREY, Width, new_figure, styled, use_log


@styled
def efficiency(ds: xr.Dataset, time: float | None = None, *, width: Width = "single") -> Figure:
    """Draw efficiencies over that of the first method and weighting, with 95 % intervals.

    Parameters
    ----------
    ds : xarray.Dataset
        Made by `smolux.efficiency`.
    time : float, optional
        One of its times; the last if left out.
    width : {"single", "double"}
        Column width.

    Returns
    -------
    matplotlib.figure.Figure
        A panel for each observable. Filled points are those that no other is more efficient than
        beyond chance.

    Raises
    ------
    InputError
        If the dataset is another one, or the time is not in it.
    """
    if "ratio" not in ds or "scheme" not in ds.dims:
        raise InputError("ds: make it with smolux.efficiency first")
    times = ds["time"].values
    if time is not None and time not in times:
        raise InputError(f"time = {time!r}: not in the result, which has {times.tolist()}")
    here = ds.sel(time=times[-1] if time is None else time)
    schemes, names = here["scheme"].values, here["observable"].values
    weightings = list(dict.fromkeys(here["weighting"].values))
    inches = 0.63 + 0.2 * len(schemes)
    figure = new_figure(width, 1.0)
    figure.set_figheight(len(names) * inches)
    panels = figure.subplots(len(names), sharex=True, squeeze=False)[:, 0]
    for ax, name in zip(panels, names, strict=True):
        ax.axvline(1, color=GREY, lw=0.6, zorder=1)
        for k, scheme in enumerate(schemes):
            at = here.sel(observable=name, scheme=scheme)
            ratio, low, high = (float(at[v]) for v in ("ratio", "ratio_lower", "ratio_upper"))
            look = Look.number(weightings.index(at["weighting"].item()))
            ax.errorbar(
                ratio, -k, xerr=[[ratio - low], [high - ratio]], fmt=look.marker,
                color=look.colour, mfc=look.colour if bool(at["best"]) else "white",
            )  # fmt: skip
        ax.set_yticks(-np.arange(len(schemes)), schemes)
        ax.tick_params(axis="y", which="minor", left=False, right=False)
        ax.set_ylim(0.4 - len(schemes), 0.6)
        ax.set_title(f"{name}, $t = {float(here['time']):.4g}$", loc="left")
        use_log(ax, "x")
    low, high = panels[-1].get_xlim()
    if high < 300 * low:  # too few decades to read from
        panels[-1].xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        panels[-1].xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    panels[-1].set_xlabel("efficiency over that of the first")
    return figure
