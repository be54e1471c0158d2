"""Discs in their box, and how their number of clusters falls."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from smolux.errors import InputError
from smolux.spatial.results.result import replay, system_of

from .style import GREY, PALETTE, Width, new_figure, styled, use_log

#: discs that touched nothing yet
_ALONE = "0.75"


@styled
def discs(
    result: xr.DataTree,
    time: float | None = None,
    *,
    colour: str = "first_contact",
    width: Width = "single",
) -> Figure:
    """Draw the discs of a spatial run at an instant; spheres as seen along the third axis.

    Parameters
    ----------
    result : xarray.DataTree
        Of `smolux.spatial.simulate`.
    time : float, optional
        Which instant; the end if left out.
    colour : {"first_contact", "cluster"}
        By the time at which a disc first touched another, or a colour for each cluster.
    width : {"single", "double"}
        Column width.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If the time was not reached, or there is no such colour.
    """
    if colour not in ("first_contact", "cluster"):
        raise InputError(f"colour = {colour!r}: must be 'first_contact' or 'cluster'")
    system = system_of(result)
    state = result.to_dataset() if time is None else replay(result, time)
    shown = float(result.attrs["time_reached"]) if time is None else float(time)
    sides = system.box.lengths
    figure = new_figure(width, min(1.0 * sides[1] / sides[0] + 0.02, 1.6))
    ax = figure.subplots()
    born = result["first_contact"].values
    norm = birth_norm(born)
    faces: Any
    if colour == "cluster":
        faces = cluster_colours(state["cluster"].values)
    else:
        faces = birth_colours(born, shown, norm)
    fill(ax, system, state["position"].values, faces)
    if colour == "first_contact" and norm is not None:
        bar = figure.colorbar(ScalarMappable(norm, "viridis"), ax=ax, fraction=0.045, pad=0.02)
        bar.set_label("time of first contact")
    return figure


def birth_norm(born: Any) -> Normalize | None:
    """Return the scale of colours of times of first contact; None if there was none."""
    known = born[np.isfinite(born)]
    if not known.size:
        return None
    low, high = float(np.quantile(known, 0.01)), float(known.max())
    if not 0 < low < high:
        return Normalize(float(known.min()), high if high > known.min() else high + 1)
    return LogNorm(low, high, clip=True)


def birth_colours(born: Any, time: float, norm: Normalize | None) -> Any:
    """Colour discs by the time of their first contact; those still alone are grey."""
    colours = np.full((len(born), 4), float(_ALONE))
    colours[:, 3] = 1
    touched = born <= time
    if norm is not None and touched.any():
        colours[touched] = ScalarMappable(norm, "viridis").to_rgba(born[touched])
    return colours


def cluster_colours(cluster: Any) -> Any:
    """Give each cluster one of the colours of the palette; single discs are grey."""
    _, which, count = np.unique(cluster, return_inverse=True, return_counts=True)
    colours = np.array(PALETTE[:-1], dtype=object)[cluster % (len(PALETTE) - 1)]
    return [_ALONE if count[k] == 1 else c for k, c in zip(which, colours, strict=True)]


def fill(ax: Axes, system: Any, position: Any, faces: Any) -> EllipseCollection:
    """Draw discs to scale into axes that show the box."""
    x = system.box.wrap(position)
    order = np.argsort(x[:, 2]) if x.shape[1] == 3 else np.arange(len(x))
    size = 2 * system.radius[order]
    faces = faces[order] if isinstance(faces, np.ndarray) else [faces[k] for k in order]
    # edges show what lies before what; they would hide small discs
    lines = 0.15 if x.shape[1] == 3 and len(x) < 20_000 else 0.0
    drawn = EllipseCollection(
        size, size, np.zeros(len(size)), units="xy", offsets=x[order, :2],
        offset_transform=ax.transData, facecolors=faces, edgecolors="black", linewidths=lines,
        rasterized=len(size) > 2000,
    )  # fmt: skip
    ax.add_collection(drawn)
    ax.set(xlim=(0, system.box.lengths[0]), ylim=(0, system.box.lengths[1]), aspect="equal")
    ax.set(xticks=[], yticks=[])
    for side, periodic in zip(("bottom", "left"), system.box.periodic[:2][::-1], strict=True):
        for name in (side, {"bottom": "top", "left": "right"}[side]):
            ax.spines[name].set_linestyle((0, (4, 3)) if periodic else "-")
    return drawn


@styled
def coarsening(result: xr.DataTree, *, width: Width = "single") -> Figure:
    """Draw the number of clusters and their mean mass over time.

    Parameters
    ----------
    result : xarray.DataTree
        Of `smolux.spatial.simulate`.
    width : {"single", "double"}
        Column width.

    Returns
    -------
    matplotlib.figure.Figure
        Below, the local exponent ``z = - d ln n / d ln t`` over factors of two in time: kinetic
        theory has a constant one, and a gas on its way to one cluster has not.
    """
    system_of(result)
    events = result["events"].to_dataset()["time"].values
    discs_, end = result.sizes["disc"], float(result.attrs["time_reached"])
    if not (events > 0).any():
        raise InputError("result: no two discs met, there is nothing to draw")
    time = np.geomspace(events[events > 0][0] / 2, end, 400)
    number = discs_ - np.searchsorted(events, time, side="right")
    figure = new_figure(width, 0.95)
    top, bottom = figure.subplots(2, sharex=True, height_ratios=(2.4, 1))
    use_log(top, "x")
    use_log(top, "y")
    top.plot(time, number, color=PALETTE[0], drawstyle="steps-post", label="number")
    top.set_ylabel("clusters $n$")
    mass = top.twinx()
    use_log(mass, "y")
    series = result["series"].to_dataset()
    largest = series["largest"].values
    mass.plot(series["time"].values[1:], largest[1:], color=PALETTE[1], lw=0.8)
    mass.set_ylabel("discs in the largest", color=PALETTE[1])
    early = np.searchsorted(events, time / np.sqrt(2), side="right")
    late = np.searchsorted(events, time * np.sqrt(2), side="right")
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.log((discs_ - early) / (discs_ - late)) / np.log(2)
    good = (late - early >= 10) & (time * np.sqrt(2) <= end) & (discs_ - late >= 10)
    bottom.plot(time[good], slope[good], color=PALETTE[0])
    bottom.axhline(1.0, color=GREY, lw=0.6, ls=":")
    bottom.set(ylabel="exponent $z$", xlabel="time $t$")
    bottom.set_ylim(0, max(2.0, 1.1 * float(slope[good].max()) if good.any() else 2.0))
    return figure
