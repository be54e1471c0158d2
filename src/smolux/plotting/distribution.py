"""Size distributions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from smolux.analysis.reference import is_deterministic
from smolux.analysis.statistics import over_replicas
from smolux.checks import numbers
from smolux.errors import InputError

from .curves import Look, Reference, draw_line, draw_values, handle, resolve
from .style import (
    GREY,
    Width,
    axes_of,
    legend_above,
    quantity,
    root_of,
    styled,
    time_label,
    use_log,
)

Float = NDArray[np.float64]

#: classes to a factor of two in which exact sizes are drawn together where they crowd
_PER_OCTAVE = 4


@dataclass(frozen=True)
class Classes:
    """Classes of sizes ``lower <= k < upper`` and the densities per size in them.

    Attributes
    ----------
    lower, upper : ndarray of shape (P,)
    density : ndarray of shape (R, P)
    """

    lower: Float
    upper: Float
    density: Float

    @classmethod
    def of(cls, ds: xr.Dataset, time: int) -> Classes:
        """Exact sizes, together where they crowd on a logarithmic axis, then the bins."""
        n = ds["n"].transpose("replica", "time", "size").values[:, time]
        count = n.shape[1]
        powers = np.ceil(2.0 ** (np.arange(200) / _PER_OCTAVE))
        # no class of a single size next to wide ones at the end
        edges = np.unique(np.append(powers[powers <= 0.9 * (count + 1)], count + 1.0))
        sums = (
            np.add.reduceat(n, edges[:-1].astype(int) - 1, axis=1)
            if count
            else np.empty((n.shape[0], 0))
        )
        lower, upper = edges[:-1] if count else edges[:0], edges[1:] if count else edges[:0]
        binned = ds["n_bin"].transpose("replica", "time", "bin").values[:, time]
        lower = np.concatenate([lower, ds["bin_lower"].values])
        upper = np.concatenate([upper, ds["bin_upper"].values])
        with np.errstate(invalid="ignore", divide="ignore"):
            return cls(lower, upper, np.concatenate([sums, binned], axis=1) / (upper - lower))

    def positions(self) -> Float:
        """Where the mean density of a class is that of a size in it.

        Within a class the density is taken to fall as an exponential, with the slope between the
        neighbours. Drawn at the centre, the points of wide classes would lie above the curve.

        References
        ----------
        G. D. Lafferty and T. R. Wyatt, Nucl. Instrum. Meth. A 355, 541 (1995),
        doi:10.1016/0168-9002(94)01112-5.
        """
        first, last = self.lower, self.upper - 1
        middle = (first + last) / 2
        _, mean, _ = over_replicas(self.density)
        used = np.flatnonzero((mean > 0) & np.isfinite(last))
        position = np.sqrt(first * last)
        if used.size < 3:
            return position
        # the slope between neighbours as a parabola sees it
        slope = np.gradient(np.log(mean[used]), middle[used])
        a, width = -slope, (last - first)[used]
        # sum of exp(-a k) over the class, relative to its middle: sinh(a m / 2) / (m sinh(a / 2))
        m = width + 1
        with np.errstate(all="ignore"):
            ratio = np.log(np.sinh(a * m / 2) / (m * np.sinh(a / 2)))
            shift = -ratio / a
        shift = np.where(np.isfinite(shift) & (np.abs(a * m) > 1e-6), shift, 0.0)
        position[used] = np.clip(middle[used] + shift, first[used], last[used])
        return position


def chosen_times(ds: xr.Dataset, times: Sequence[float] | None) -> list[int]:
    """Find the output times asked for, or up to four spread over all; return their indices."""
    present = ds["time"].values
    number = ds["number_density"].transpose("replica", "time").values
    reached = np.isfinite(number).any(axis=0)
    if times is None:
        shown = np.flatnonzero(reached & (present > 0))
        if not shown.size:
            return np.flatnonzero(reached).tolist()
        spread = np.linspace(0, shown.size - 1, 4).round().astype(int)
        return np.unique(shown[spread]).tolist()
    problems, found = [], []
    for t in np.atleast_1d(numbers("times", times)):
        near = int(np.abs(present - t).argmin())
        if not np.isclose(present[near], t, rtol=1e-9, atol=0):
            problems.append(f"times: no output at t = {t:g}; the nearest is {present[near]:g}")
        elif not reached[near]:
            problems.append(f"times: no replica reached t = {t:g}")
        found.append(near)
    if problems:
        raise InputError(problems)
    return found


def _smooth_sizes(largest: float) -> NDArray[np.int64]:
    return np.unique(np.geomspace(1, max(largest, 2.0), 160).round().astype(np.int64))


def _line(ax: Axes, ds: xr.Dataset, time: int, colour: str, **options: Any) -> None:
    """Draw a deterministic distribution: a line through exact sizes and classes."""
    classes = Classes.of(ds, time)
    draw_line(ax, classes.positions(), np.nanmean(classes.density, axis=0), colour, **options)


def _reference(
    ax: Axes, ds: xr.Dataset, found: Any, time: int, largest: float, colour: str
) -> bool:
    """Draw the reference at one time; say whether there was one."""
    t = float(ds["time"].values[time])
    if found is None:
        return False
    if isinstance(found, xr.Dataset):
        near = int(np.abs(found["time"].values - t).argmin())
        if not np.isclose(found["time"].values[near], t, rtol=1e-9, atol=0):
            return False
        _line(ax, found, near, colour, zorder=1)
        return True
    sizes = _smooth_sizes(largest)
    values = np.asarray(found.densities(t, sizes), float)
    draw_line(ax, sizes.astype(float), values, colour, zorder=1)
    return bool(np.isfinite(values).any())


@styled
def size_distribution(
    ds: xr.Dataset,
    times: Sequence[float] | None = None,
    *,
    reference: Reference = "exact",
    decades: float = 10.0,
    ax: Axes | None = None,
    width: Width = "single",
) -> Figure:
    """Draw number densities over sizes at several times, on logarithmic axes.

    Parameters
    ----------
    ds : xarray.Dataset
        A result of simulate (dots with 95 % intervals) or of solve (lines).
    times : sequence of float, optional
        Output times; up to four, spread over the result, if left out.
    reference : "exact", Dataset or None
        Lines to compare with.
    decades : float
        Densities more than this many decades below the largest are not shown.
    ax : Axes, optional
        Where to draw; a new figure if left out.
    width : {"single", "double"}
        Column width of a new figure.

    Returns
    -------
    matplotlib.figure.Figure
        Small sizes one by one; larger ones in classes, as the mean density of a single size in the
        class. Classes in which no replica has a cluster are left out.

    Raises
    ------
    InputError
        If a time is not among the output times.
    """
    chosen = chosen_times(ds, times)
    ax = axes_of(ax, width)
    use_log(ax, "x")
    use_log(ax, "y")
    found, name = resolve(ds, reference)
    tables = [Classes.of(ds, k) for k in chosen]
    means = [over_replicas(table.density)[1] for table in tables]
    positive = np.concatenate([m[np.isfinite(m) & (m > 0)] for m in means])
    if not positive.size:
        raise InputError("size_distribution: the result has no clusters at these times")
    top = float(positive.max())
    least = min(float(np.nanmax(m)) for m in means if np.any(m > 0))  # each time is to be seen
    bottom = max(float(positive.min()), min(top * 10.0**-decades, least / 10))
    largest = max(
        float(np.max(t.upper[np.isfinite(t.upper) & (m >= bottom)], initial=1.0))
        for t, m in zip(tables, means, strict=True)
    )
    drawn, handles = False, list[Artist]()
    for k, (time, table, mean) in enumerate(zip(chosen, tables, means, strict=True)):
        if not np.any(mean > 0):
            continue  # nothing is there any more
        look = Look.number(k)
        drawn |= _reference(ax, ds, found, time, 2 * largest, look.colour)
        if is_deterministic(ds):
            _line(ax, ds, time, look.colour)
        else:
            # dots at every time, however many classes it has
            draw_values(
                ax, table.positions(), table.density, look, counts=True, line=False, zorder=3
            )
        label = time_label(float(ds["time"].values[time]), ds["time"].attrs.get("units"))
        handles.append(handle(ds, label, look, line=False))
    ax.set_xlim(0.8, 1.3 * largest)
    ax.set_ylim(bottom / 3, 3 * top)
    ax.set_xlabel("cluster size $k$")
    ax.set_ylabel(quantity("number density $n_k$", ds["n"].attrs.get("units")))
    if drawn:
        handles.append(Line2D([], [], color=GREY, label=name))
    legend_above(ax, handles)
    return root_of(ax)
