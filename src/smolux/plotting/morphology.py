"""What clusters in a box look like: the pair distribution, and fits of fractal dimensions."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from smolux.errors import InputError
from smolux.spatial import Dimension

from .style import GREY, PALETTE, Width, axes_of, root_of, styled, use_linear, use_log


@styled
def pair_distribution(
    ds: xr.Dataset, *, ax: Axes | None = None, label: str | None = None, width: Width = "single"
) -> Figure:
    """Draw the pair distribution over the distance in mean diameters.

    Parameters
    ----------
    ds : xarray.Dataset
        Of `smolux.spatial.pair_distribution`.
    ax : Axes, optional
        Where to draw, beside what is there; a new figure if left out.
    label : str, optional
        For a legend of your own.
    width : {"single", "double"}
        Column width of a new figure.

    Returns
    -------
    matplotlib.figure.Figure
        Dotted: 1, of independent discs.
    """
    if "g" not in ds or "diameter" not in ds.attrs:
        raise InputError("ds: must be what smolux.spatial.pair_distribution returned")
    fresh = ax is None
    ax = axes_of(ax, width, 0.75)
    r = ds["r"].values / ds.attrs["diameter"]
    ax.plot(r, ds["g"].values, color=PALETTE[len(ax.lines) % len(PALETTE)], label=label)
    if fresh:
        ax.hlines(1.0, 0, 1, GREY, ":", lw=0.6, transform=ax.get_yaxis_transform(), zorder=0)
        ax.set(xlabel="distance $r$ / diameter", ylabel="pair distribution $g$")
        ax.set_xlim(float(ds["r_lower"][0]) / ds.attrs["diameter"], None)
        ax.set_ylim(0, None)
        use_linear(ax, "x")
        use_linear(ax, "y")
    return root_of(ax)


@styled
def dimension(fit: Dimension, *, ax: Axes | None = None, width: Width = "single") -> Figure:
    """Draw the fit of a fractal dimension: all points, those that were fitted, and the line.

    Parameters
    ----------
    fit : smolux.spatial.Dimension
        Of `smolux.spatial.mass_dimension` or `smolux.spatial.box_dimension`.
    ax : Axes, optional
        Where to draw; a new figure if left out.
    width : {"single", "double"}
        Column width of a new figure.

    Returns
    -------
    matplotlib.figure.Figure
        Points that were not fitted are open. Shaded: the 95 % interval of the slope, about the
        centre of what was fitted.
    """
    if not isinstance(fit, Dimension):
        raise InputError(
            "fit: must be what smolux.spatial.mass_dimension or box_dimension returned"
        )
    ax = axes_of(ax, width)
    use_log(ax, "x")
    use_log(ax, "y")
    boxes = fit.slope < 0
    shown = (fit.x > 0) & (fit.y > 0)
    look: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 2.6, "mew": 0.5}
    ax.plot(fit.x[shown & ~fit.used], fit.y[shown & ~fit.used], mfc="none", color=GREY, **look)
    ax.plot(fit.x[fit.used], fit.y[fit.used], color=PALETTE[0], **look)
    x = np.geomspace(fit.x[fit.used].min(), fit.x[fit.used].max(), 50)
    line = np.exp(fit.intercept + fit.slope * np.log(x))
    centre = np.exp(np.log(fit.x[fit.used]).mean())
    slopes = [-d if boxes else 1 / d for d in (fit.low, fit.high)]
    low, high = (line * (x / centre) ** (s - fit.slope) for s in slopes)
    ax.fill_between(x, low, high, color=PALETTE[1], alpha=0.25, lw=0)
    ax.plot(x, line, color=PALETTE[1])
    ax.text(
        0.95 if boxes else 0.05, 0.93,
        f"$D = {fit.value:.3f}$\n95 %: {fit.low:.3f} to {fit.high:.3f}",
        transform=ax.transAxes, ha="right" if boxes else "left", va="top",
    )  # fmt: skip
    if boxes:
        ax.set(xlabel="side of boxes $l$", ylabel="boxes with a centre $n$")
    else:
        ax.set(xlabel="discs in a cluster $m$", ylabel="radius of gyration $R_g$")
    return root_of(ax)
