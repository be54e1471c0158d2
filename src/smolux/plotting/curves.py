"""How simulated and deterministic results are drawn: dots and bands, and lines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from smolux.analysis.reference import is_deterministic, solution_of
from smolux.analysis.statistics import Sample, mean_interval
from smolux.errors import InputError

from .style import MARKERS, PALETTE

Float = NDArray[np.float64]
Reference = xr.Dataset | Literal["exact"] | None

#: more points than this are drawn as a line with a shaded band
_CROWDED = 40
#: fewer points of a solver than this make no smooth line
_FEW = 25


@dataclass(frozen=True)
class Look:
    """Colour and marker of one curve; markers are open if `hollow`."""

    colour: str
    marker: str
    hollow: bool = False

    @classmethod
    def number(cls, k: int) -> Look:
        """Give the k-th curve of a figure its look."""
        return cls(PALETTE[k % len(PALETTE)], MARKERS[k % len(MARKERS)])


def draw_values(
    ax: Axes,
    x: Float,
    values: Float,
    look: Look,
    *,
    counts: bool = False,
    line: bool | None = None,
    **options: Any,
) -> None:
    """Draw the mean of simulated replicas with their 95 % intervals.

    Parameters
    ----------
    ax : Axes
    x : ndarray of shape (P,)
    values : ndarray of shape (R, P)
        NaN where a replica was not observed. Points whose mean is zero have no place on a
        logarithmic axis and are left out there; a bar that reaches the lower edge of such an axis
        stands for an interval that contains zero. Without any scatter the marker is open.
    look : Look
    counts : bool
        Whether the values are counts: if all replicas have the same, that is luck, not certainty.
    line : bool, optional
        Whether it is a line with a band instead of dots; by the number of points if left out.
    **options
        For the markers, such as ``zorder``.
    """
    sample = Sample.of(values)
    bars = np.stack(mean_interval(sample)) - sample.mean
    bars = np.abs(np.where(sample.error == 0, np.nan if counts else 0.0, bars))
    draw_points(ax, x, sample.mean, bars, look, line=line, **options)


def draw_points(
    ax: Axes,
    x: Float,
    mean: Float,
    bars: Float,
    look: Look,
    *,
    line: bool | None = None,
    **options: Any,
) -> None:
    """Draw points with the lengths of their bars, below and above; NaN where not known."""
    shown = np.isfinite(mean) & np.isfinite(x)
    if ax.get_yscale() == "log":
        shown &= mean > 0
    if ax.get_xscale() == "log":
        shown &= x > 0
    x, mean, bars = x[shown], mean[shown], bars[:, shown]
    if len(x) > _CROWDED if line is None else line:
        ax.plot(x, mean, color=look.colour, lw=0.8, **options)
        ax.fill_between(x, mean - bars[0], mean + bars[1], color=look.colour, alpha=0.25, lw=0)
        return
    known = np.isfinite(bars).all(axis=0)
    style = {"ls": "none", "color": look.colour, "marker": look.marker, **options}
    if known.any():
        fill = "none" if look.hollow else look.colour
        ax.errorbar(x[known], mean[known], yerr=bars[:, known], elinewidth=0.8, mfc=fill, **style)
    if not known.all():
        ax.plot(x[~known], mean[~known], mfc="white", **style)


def draw_line(ax: Axes, x: Float, y: Float, colour: str, **options: Any) -> None:
    """Draw a deterministic result as a line, where it is finite."""
    shown = np.isfinite(y) & np.isfinite(x)
    shown &= (y > 0) if ax.get_yscale() == "log" else True
    shown &= (x > 0) if ax.get_xscale() == "log" else True
    ax.plot(np.where(shown, x, np.nan), np.where(shown, y, np.nan), color=colour, **options)


def _solver_style(ds: xr.Dataset, log: bool) -> dict[str, Any]:
    """Return how a solver's time series looks: a line, with its points where they are few."""
    few = _drawn(ds, log) < _FEW
    return {"ls": "-", "marker": "." if few else "", "ms": 3.0, "lw": 0.7 if few else 1.0}


def solver_handle(ds: xr.Dataset, label: str, colour: str, log: bool) -> Artist:
    """Legend entry of what `draw_solver` draws."""
    return Line2D([], [], color=colour, label=label, **_solver_style(ds, log))


def draw_solver(ax: Axes, ds: xr.Dataset, y: Float, colour: str, **options: Any) -> None:
    """Draw a solver's time series."""
    style = _solver_style(ds, ax.get_xscale() == "log")
    draw_line(ax, ds["time"].values, y, colour, **style | options)


def draw(ax: Axes, ds: xr.Dataset, values: Float, look: Look, **options: Any) -> None:
    """Draw a time series of shape (R, T) of a result, simulated or solved; see `drawn_as`."""
    if is_deterministic(ds):
        draw_solver(ax, ds, values[0], look.colour, **options)
    else:
        line = crowded(ds, ax.get_xscale() == "log")
        draw_values(ax, ds["time"].values, values, look, line=line, **options)


def drawn_as(ds: xr.Dataset, label: str, look: Look, log: bool) -> Artist:
    """Legend entry of a time series that `draw` draws, on an axis of time that may be logarithmic.

    Simulated results are dots, or a line with a band where they are many; solved ones a line.
    """
    if is_deterministic(ds):
        return solver_handle(ds, label, look.colour, log)
    return handle(ds, label, look, line=crowded(ds, log))


def handle(ds: xr.Dataset, label: str, look: Look, *, line: bool) -> Artist:
    """Legend entry of a result that is drawn as a line or, if it is simulated, as dots."""
    if is_deterministic(ds) or line:
        return Line2D([], [], color=look.colour, label=label)
    fill = "none" if look.hollow or ds.sizes["replica"] == 1 else look.colour
    return Line2D([], [], color=look.colour, marker=look.marker, mfc=fill, ls="none", label=label)


def _drawn(ds: xr.Dataset, log: bool) -> int:
    """How many times of a result have a place on an axis."""
    shown = ds["number_density"].notnull().any("replica").values
    return int(np.sum(shown & (ds["time"].values > 0.0) if log else shown))


def crowded(ds: xr.Dataset, log: bool) -> bool:
    """Whether the times of a simulation are so many that it is drawn as a line with a band."""
    return not is_deterministic(ds) and _drawn(ds, log) > _CROWDED


def described(ds: xr.Dataset) -> str:
    """Say in a word or two where the points come from."""
    if is_deterministic(ds):
        return "rate equations"
    replicas = ds.sizes["replica"]
    return f"Monte Carlo, {replicas} replicas, 95 %" if replicas > 1 else "Monte Carlo, 1 replica"


def fine_times(ds: xr.Dataset, log: bool) -> Float:
    """Spread times for a smooth line over the range of a result."""
    t = ds["time"].values
    positive = t[t > 0]
    if log and positive.size:
        return np.geomspace(positive.min(), t.max(), 200)
    return np.linspace(t.min(), t.max(), 200)


def resolve(ds: xr.Dataset, reference: Reference) -> tuple[Any, str]:
    """Find what to draw as the reference and what to call it; (None, "") if nothing.

    Parameters
    ----------
    ds : xarray.Dataset
    reference : Dataset, "exact" or None

    Returns
    -------
    reference : Dataset, exact solution or None
    name : str
    """
    if reference is None or isinstance(reference, xr.Dataset):
        name = "" if reference is None else described(reference)
        return reference, name
    if reference != "exact":
        raise InputError(
            f"reference = {reference!r}: must be a result, 'exact' or None; load a file with "
            "smolux.results.load"
        )
    found = solution_of(ds)
    return found, "exact" if found is not None else ""
