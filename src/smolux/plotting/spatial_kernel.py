"""The collision kernel of a spatial run beside that of the mean field."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from smolux.errors import InputError

from .style import PALETTE, Width, legend_above, new_figure, styled, use_log

#: partners whose sizes are this many bins apart
_APART = (0, 2, 4, 6)


@styled
def spatial_kernel(kernel: xr.Dataset, *, width: Width = "single") -> Figure:
    """Draw a measured kernel, and its ratio to the mean field that fits best.

    Parameters
    ----------
    kernel : xarray.Dataset
        Of `smolux.spatial.measured_kernel`.
    width : {"single", "double"}
        Column width.

    Returns
    -------
    matplotlib.figure.Figure
        Above, the kernel over the size of the larger cluster, for partners of similar and of
        smaller sizes, with standard errors; lines are the mean field. Below, the ratio of both.
    """
    if "mean_field" not in kernel:
        raise InputError("kernel: must be what smolux.spatial.measured_kernel returned")
    size = kernel["size_i"].values
    value, error, field = (kernel[n].values for n in ("kernel", "error", "mean_field"))
    figure = new_figure(width, 1.05)
    top, bottom = figure.subplots(2, sharex=True, height_ratios=(2, 1))
    for ax in (top, bottom):
        use_log(ax, "x")
    use_log(top, "y")
    handles = []
    for number, apart in enumerate(_APART):
        rows = np.arange(apart, len(size))
        y, dy, law = (a[rows, rows - apart] for a in (value, error, field))
        good = (dy > 0) & (dy < 0.5 * y)
        if not good.any():
            continue
        colour = PALETTE[number]
        x = size[rows]
        ratio = float(np.median(x / size[rows - apart]))
        top.plot(x, law, color=colour, lw=0.8)
        label = "equal sizes" if apart == 0 else f"1 : {ratio:.0f}"
        shown = top.errorbar(
            x[good], y[good], dy[good], fmt="o", ms=2.6, color=colour, label=label, lw=0.7
        )
        handles.append(shown)
        bottom.errorbar(
            x[good], (y / law)[good], (dy / law)[good], fmt="o", ms=2.6, color=colour, lw=0.7
        )
    bottom.axhline(1.0, color="black", lw=0.6)
    bottom.set(xlabel="discs in the larger cluster", ylabel="measured / mean field")
    top.set_ylabel("kernel $K(i, j)$")
    bottom.set_ylim(0, 2)
    legend_above(top, handles)
    return figure
