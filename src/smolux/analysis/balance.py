"""Where the mass comes from and goes to, in a sentence."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from smolux.results import require

Float = NDArray[np.float64]

#: what the sums of a run are off by, of the mass
_ROUNDING = 1e-12


def mass_balance(ds: xr.Dataset) -> str:
    """Say whether the mass adds up: what there was, came in and left, and what there is.

    Parameters
    ----------
    ds : xarray.Dataset
        A result of `smolux.simulate` or `smolux.solve`.

    Returns
    -------
    str
        Means over the replicas, per volume; how far off, the worst of all replicas and times. Empty
        if the mass was not observed.
    """
    require(ds, "time")
    columns = _columns(ds)
    if columns is None:
        return ""
    times = ds["time"].values
    mass, come, gone = (c[np.isfinite(columns[0][:, 0])] for c in columns)
    if not mass.size:
        return ""
    come, gone = come - come[:, :1], gone - gone[:, :1]
    there = mass[:, :1] + come
    off = np.divide(mass + gone - there, there, out=np.zeros_like(there), where=there > 0)
    worst = float(np.nanmax(np.abs(off)))
    if "mass_in" not in ds:
        words = "to rounding" if worst < _ROUNDING else f"to {worst:.1e}"
        return f"Mass M1 = {np.nanmean(mass):.6g}, constant {words}."
    last = int(np.flatnonzero(np.isfinite(mass).any(axis=0))[-1])
    left = np.isfinite(mass[:, last])
    start, brought, lost, now = (
        float(column.mean())
        for column in (mass[left, 0], come[left, last], gone[left, last], mass[left, last])
    )
    words = "to rounding" if worst < _ROUNDING else f"but for {worst:.1e} of it"
    return (
        f"Mass M1 = {start:.6g} at t = {times[0]:g}, + {brought:.6g} that came in, "
        f"- {lost:.6g} that left, = {now:.6g} at t = {times[last]:g}; this adds up {words}."
    )


def _columns(ds: xr.Dataset) -> tuple[Float, Float, Float] | None:
    """Return the mass, what came in and what left, per volume, over replicas and times."""
    if "mass_in" in ds:
        volume = ds["volume"].transpose("replica", "time").values
        inside, come, gone = (
            ds[name].transpose("replica", "time").values / volume
            for name in ("mass", "mass_in", "mass_out")
        )
        return inside, come, gone
    if "order" not in ds.dims or 1 not in ds["order"].values:
        return None
    m1 = ds["moment"].sel(order=1).transpose("replica", "time").values
    return m1, np.zeros_like(m1), np.zeros_like(m1)
