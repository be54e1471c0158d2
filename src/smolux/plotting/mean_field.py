"""Discs in a box beside the well-mixed population with the same kernel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from smolux.errors import InputError
from smolux.spatial.results.result import system_of

from .style import PALETTE, Width, legend_above, new_figure, styled, use_log


@styled
def mean_field(
    pairs: Sequence[tuple[xr.DataTree, xr.Dataset]], *, width: Width = "double"
) -> Figure:
    """Draw spatial runs and their mean fields: numbers of clusters, and sizes at the end.

    Parameters
    ----------
    pairs : sequence of (DataTree, Dataset)
        Results of `smolux.spatial.simulate`, each with that of `smolux.simulate` or
        `smolux.solve` for the `smolux.spatial.mean_field_model` of its kernel, at output times of
        the run.
    width : {"single", "double"}
        Column width.

    Returns
    -------
    matplotlib.figure.Figure
        One column for each pair. Sizes are compared at the last time that both have, by the share
        of all clusters in bins, for each size in a bin.
    """
    if not pairs:
        raise InputError("pairs: give at least one spatial run with its mean field")
    figure = new_figure(width, 0.62 if width == "double" else 1.1)
    axes = figure.subplots(2, len(pairs), squeeze=False, sharey="row")
    for column, (tree, mixed) in enumerate(pairs):
        system = system_of(tree)
        series = tree["series"].to_dataset()
        top, bottom = axes[:, column]
        handles = _numbers(top, series, mixed, system.box.volume)
        _sizes(bottom, series, mixed)
        top.set(xlabel="time $t$", title=f"volume fraction {system.volume_fraction:.3g}")
        bottom.set_xlabel("discs in a cluster")
    axes[0, 0].set_ylabel("clusters $n$")
    axes[1, 0].set_ylabel("share of clusters")
    legend_above(axes[0, 0], handles, spans=True)
    return figure


def _numbers(ax: Axes, series: xr.Dataset, mixed: xr.Dataset, volume: float) -> list[Artist]:
    use_log(ax, "x")
    use_log(ax, "y")
    points = ax.plot(
        series["time"], series["clusters"], "o", label="discs in a box",
        ms=2.2, mfc="none", mew=0.6, color=PALETTE[0],
    )  # fmt: skip
    number = mixed["number_density"].mean("replica") * volume
    line = ax.plot(mixed["time"], number, color="black", lw=0.9, label="well mixed")
    return [*points, *line]


def _sizes(ax: Axes, series: xr.Dataset, mixed: xr.Dataset) -> None:
    use_log(ax, "x")
    use_log(ax, "y")
    time = min(float(series["time"][-1]), float(mixed["time"][-1]))
    found = series.sel(time=time, method="nearest")
    lower, upper = (found[name].values for name in ("bin_lower", "bin_upper"))
    width, total = upper - lower, float(found["n_bin"].sum())
    count = found["n_bin"].values
    there = count > 0
    share = count / width / total
    ax.errorbar(
        found["bin"].values[there], share[there], (np.sqrt(count) / width / total)[there],
        fmt="o", ms=2.2, mfc="none", color=PALETTE[0], lw=0.6, mew=0.6,
    )  # fmt: skip
    now = mixed.sel(time=time, method="nearest").mean("replica")
    below = np.concatenate([[0.0], np.cumsum(now["n"].values)])
    known = upper - 1 < len(below)
    part = (below[upper[known] - 1] - below[lower[known] - 1]) / width[known]
    part /= float(now["number_density"])
    shown = part > 0
    ax.plot(found["bin"].values[known][shown], part[shown], color="black", lw=0.9)
    ax.set_title(f"$t = {time:.3g}$, {total:.0f} clusters", fontsize=7)
