"""The largest cluster, and when it takes a finite share of the mass."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy import optimize

from smolux.initial.base import Initial
from smolux.results import require

from .reference import is_deterministic, model_of
from .statistics import over_replicas

Float = NDArray[np.float64]

#: clusters that must be left for a peak to be gelation and not the end of a finite system, and
#: their share of the most there were: of an additive kernel N**(-1/2) are left at its peak
_ENOUGH, _SHARE = 20, 0.1
#: share of the mass in the gel from which moments are no longer those of all clusters
_LOST = 1e-7


def gel_fraction(ds: xr.Dataset) -> xr.DataArray:
    """Share of the mass that is in the largest cluster, or lost to the gel in rate equations.

    Parameters
    ----------
    ds : xarray.Dataset
        A result of simulate, ``largest / (M1 volume)``, or of solve, ``1 - M1(t) / M(t)`` with all
        the mass that there is: M is that at the start and what came in, without what was removed.

    Returns
    -------
    xarray.DataArray of shape (replica, time)
    """
    require(ds, "moment", "order", "time", "replica", orders=(1.0,))
    mass = ds["moment"].sel(order=1.0, drop=True).transpose("replica", "time")
    if is_deterministic(ds):
        share = 1 - mass / _all_mass(ds, mass)
        text = "share of the mass lost to the infinite cluster"
    else:
        share = ds["largest"] / (mass * ds["volume"])
        text = "share of the mass in the largest cluster"
    return share.rename("gel_fraction").assign_attrs(long_name=text, units="1")


def _mass_of(initial: Initial) -> float:
    """Mass per volume of an initial condition."""
    if not initial.total:
        return 0.0
    return float(initial.densities(initial.largest) @ np.arange(1.0, initial.largest + 1.0))


def _all_mass(ds: xr.Dataset, mass: xr.DataArray) -> xr.DataArray:
    """Mass per volume that is in clusters and gel together."""
    model = model_of(ds)
    # the first output time may be later than the start, and the gel already there
    start = mass.isel(time=0, drop=True) if model is None else _mass_of(model.initial)
    if "mass_in" in ds:
        gained = (ds["mass_in"] - ds["mass_out"]) / ds["volume"]
        start = start if model is not None else start - gained.isel(time=0, drop=True)
        return start + gained
    return start + 0.0 * mass


def _vertex(t: Float, y: Float, at: int) -> float:
    """Vertex of the parabola through a sample and its neighbours."""
    a, b, c = t[at - 1 : at + 2]
    slope_1, slope_2 = (y[at] - y[at - 1]) / (b - a), (y[at + 1] - y[at]) / (c - b)
    if slope_1 == slope_2:
        return float(b)
    return float((a + b) / 2 + slope_1 * (c - a) / 2 / (slope_1 - slope_2))


def _peak(t: Float, rest: Float, clusters: Float) -> tuple[float, float]:
    """Time at which the second moment without the largest cluster peaks, and the step of time.

    NaN if it does not.
    """
    seen = np.flatnonzero(np.isfinite(rest))
    if seen.size < 3:
        return np.nan, np.nan
    at = int(seen[np.argmax(rest[seen])])
    least = max(_ENOUGH, _SHARE * float(np.nanmax(clusters)))
    if at in (seen[0], seen[-1]) or clusters[at] < least:
        return np.nan, np.nan
    return _vertex(t, rest, at), float(t[at + 1] - t[at - 1]) / 2


def _finite_size(ds: xr.Dataset) -> float:
    """Width of the critical window over the gel time, by which a peak of N clusters is shifted."""
    start = ds.isel(time=0)
    volume = float(start["volume"].mean())
    orders = ds["order"].values
    if 3.0 in orders and 2.0 in orders:
        two, three = (volume * float(start["moment"].sel(order=p).mean()) for p in (2.0, 3.0))
        if two > 0:
            return three ** (2 / 3) / two
    clusters = float((ds["number_density"] * ds["volume"]).mean("replica").max())
    return clusters ** (-1 / 3)


def _power_law(t: Float, y: Float) -> float:
    """Return T of ``log y = a - g log(T - t)`` through three points; NaN if there is none near."""

    def bend(end: float) -> float:
        slopes = np.diff(y) / np.diff(np.log(end - t))
        return float(slopes[1] - slopes[0])

    near, far = t[2] + 1e-9 * (t[2] - t[0]), t[2] + 10.0 * (t[2] - t[0])
    if not bend(near) * bend(far) < 0:
        return np.nan
    return float(optimize.brentq(bend, near, far))


def _divergence(t: Float, m2: Float, lost: Float) -> tuple[float, float]:
    """Time at which the second moment diverges, and by how much it is off; NaN if it does not.

    ``M2 ~ (t_gel - t)**-g`` is put through the last three times before any mass is lost, whatever
    the exponent; the error is the difference from the same with the three before.
    """
    seen = np.isfinite(m2) & (m2 > 0) & ~(lost > _LOST)
    t, m2 = t[seen], m2[seen]
    stop = int(np.argmax(m2)) + 1 if m2.size else 0
    if stop < 4:
        return np.nan, np.nan
    t, y = t[:stop], np.log(m2[:stop])
    last, before = _power_law(t[-3:], y[-3:]), _power_law(t[-4:-1], y[-4:-1])
    # a far extrapolation is no evidence of a divergence
    if not last <= t[-1] + (t[-1] - t[0]):
        return np.nan, np.nan
    return last, abs(last - before)


def gelation(ds: xr.Dataset) -> xr.Dataset:
    """Share of the mass in the gel over time, and an estimate of the gel time.

    In a simulation, the second moment without the largest cluster,
    ``M2 - largest**2 / volume``, peaks when the gel appears, as the susceptibility does at a
    percolation threshold. In N particles the peak is shifted and widened by a share of order
    ``N**(-1/3)``. From rate equations, the gel time is where M2 diverges, extrapolated.

    Parameters
    ----------
    ds : xarray.Dataset
        A result of simulate or solve with moments of the orders 1 and 2. Simulate gelation at fixed
        volume: doubling would double the gel.

    Returns
    -------
    xarray.Dataset
        ``gel_fraction`` and, from a simulation, ``second_moment_without_largest`` (replica, time);
        ``gel_time`` (replica), NaN where nothing gels. In the attributes: ``gel_time``, the mean,
        and ``gel_time_error``, its standard error, which is made of ``gel_time_scatter`` over the
        replicas, ``gel_time_grid``, the step of the output times over the root of 12, and
        ``gel_time_finite``, the width of the critical window of so many particles,
        ``t (N M3)**(2/3) / (N M2)`` with the moments at the start, which is ``t N**(-1/3)`` for
        equal particles. From rate equations it is how far the last times extrapolate otherwise than
        those before.

    Raises
    ------
    InputError
        If a moment is missing.

    References
    ----------
    D. J. Aldous, Bernoulli 5, 3 (1999), doi:10.2307/3318611; Ann. Probab. 25, 812 (1997),
    doi:10.1214/aop/1024404421, for the critical window.
    """
    require(ds, "moment", "order", "time", "replica", orders=(1.0, 2.0))
    t = ds["time"].values
    m2 = ds["moment"].sel(order=2.0, drop=True).transpose("replica", "time")
    result = xr.Dataset({"gel_fraction": gel_fraction(ds)})
    if is_deterministic(ds):
        lost = result["gel_fraction"].transpose("replica", "time").values
        found = [_divergence(t, *rows) for rows in zip(m2.values, lost, strict=True)]
    else:
        rest = (m2 - ds["largest"] ** 2 / ds["volume"]).transpose("replica", "time")
        result["second_moment_without_largest"] = rest.assign_attrs(
            long_name="second moment without the largest cluster", units="1"
        )
        clusters = (ds["number_density"] * ds["volume"]).transpose("replica", "time").values
        model = model_of(ds)
        never = model is not None and model.reduced.kernel.gels is False
        found = [
            (np.nan, np.nan) if never else _peak(t, *rows)
            for rows in zip(rest.values, clusters, strict=True)
        ]
    times, errors = np.array(found, float).T
    result["gel_time"] = ("replica", times)
    result["gel_time"].attrs = {"long_name": "estimated gel time", "units": "1"}
    result.attrs = _estimate(ds, times, errors)
    return result


def _estimate(ds: xr.Dataset, times: Float, errors: Float) -> dict[str, float]:
    """Return the mean gel time, its error, and the parts of it."""
    _, mean, scatter = over_replicas(times)
    known = np.isfinite(times)
    if is_deterministic(ds) or not known.any():
        error = float(errors[known].max()) if known.any() else np.nan
        return {"gel_time": float(mean), "gel_time_error": error}
    grid = float(np.mean(errors[known]) / np.sqrt(12.0))
    finite = float(mean) * _finite_size(ds)
    # a single replica has no scatter, and that is the less
    parts = {"scatter": float(scatter), "grid": grid, "finite": finite}
    error = float(np.sqrt(np.nansum(np.square(list(parts.values())))))
    named = {f"gel_time_{name}": value for name, value in parts.items()}
    return {"gel_time": float(mean), "gel_time_error": error, **named}
