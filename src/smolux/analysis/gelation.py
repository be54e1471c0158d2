"""The largest cluster, and when it takes a finite share of the mass."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy import stats

from smolux.errors import InputError
from smolux.results import require

from .reference import is_deterministic
from .statistics import over_replicas

Float = NDArray[np.float64]

#: clusters that must be left for a peak to be gelation and not the end of a finite system
_ENOUGH = 20


def gel_fraction(ds: xr.Dataset) -> xr.DataArray:
    """Share of the mass that is in the largest cluster, or lost to the gel in rate equations.

    Parameters
    ----------
    ds : xarray.Dataset
        A result of simulate (``largest / (M1 volume)``) or of solve (``1 - M1(t) / M1(0)``).

    Returns
    -------
    xarray.DataArray of shape (replica, time)
    """
    require(ds, "moment", "order", "time", "replica")
    mass = ds["moment"].sel(order=1.0, drop=True).transpose("replica", "time")
    if is_deterministic(ds):
        share = 1 - mass / mass.isel(time=0)
        text = "share of the mass lost to the infinite cluster"
    else:
        share = ds["largest"] / (mass * ds["volume"])
        text = "share of the mass in the largest cluster"
    return share.rename("gel_fraction").assign_attrs(long_name=text, units="1")


def _vertex(t: Float, y: Float, at: int) -> float:
    """Vertex of the parabola through a sample and its neighbours."""
    a, b, c = t[at - 1 : at + 2]
    slope_1, slope_2 = (y[at] - y[at - 1]) / (b - a), (y[at + 1] - y[at]) / (c - b)
    if slope_1 == slope_2:
        return float(b)
    return float((a + b) / 2 + slope_1 * (c - a) / 2 / (slope_1 - slope_2))


def _peak(t: Float, rest: Float, clusters: Float) -> float:
    """Time at which the second moment without the largest cluster peaks; NaN if it does not."""
    seen = np.flatnonzero(np.isfinite(rest))
    if seen.size < 3:
        return np.nan
    at = int(seen[np.argmax(rest[seen])])
    if at in (seen[0], seen[-1]) or clusters[at] < _ENOUGH:
        return np.nan
    return _vertex(t, rest, at)


def _divergence(t: Float, m2: Float) -> float:
    """Time at which the second moment diverges; NaN if it does not.

    For ``M2 ~ (t_gel - t)**-g`` the inverse logarithmic derivative is the straight line
    ``(t_gel - t) / g``, whatever the exponent.
    """
    seen = np.isfinite(m2) & (m2 > 0)
    t, m2 = t[seen], m2[seen]
    # after gelation the moment of the finite clusters falls again
    stop = int(np.argmax(m2)) + 1 if m2.size else 0
    rising = np.flatnonzero(m2[:stop] > 0)
    if rising.size < 4:
        return np.nan
    middle = (t[1:stop] + t[: stop - 1]) / 2
    with np.errstate(divide="ignore"):
        inverse = np.diff(t[:stop]) / np.diff(np.log(m2[:stop]))
    late = slice(-min(6, max(3, len(inverse) // 2)), None)
    x, y = middle[late], inverse[late]
    if len(x) < 3 or not np.all(np.isfinite(y)):
        return np.nan
    line = stats.linregress(x, y)
    zero = -line.intercept / line.slope if line.slope < 0 else np.inf
    # a far extrapolation is no evidence of a divergence
    return float(zero) if t[0] < zero <= t[stop - 1] + (t[stop - 1] - t[0]) else np.nan


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
        ``gel_time`` (replica), NaN where nothing gels. Mean and standard error of the gel time are
        in the attributes.

    Raises
    ------
    InputError
        If a moment is missing.

    References
    ----------
    D. J. Aldous, Bernoulli 5, 3 (1999), doi:10.2307/3318611.
    """
    require(ds, "moment", "order", "time", "replica")
    missing = [p for p in (1.0, 2.0) if p not in ds["order"].values]
    if missing:
        raise InputError(
            f"gelation needs the moments of orders 1 and 2: {missing} not in the result"
        )
    t = ds["time"].values
    m2 = ds["moment"].sel(order=2.0, drop=True).transpose("replica", "time")
    result = xr.Dataset({"gel_fraction": gel_fraction(ds)})
    if is_deterministic(ds):
        found = [_divergence(t, row) for row in m2.values]
    else:
        rest = (m2 - ds["largest"] ** 2 / ds["volume"]).transpose("replica", "time")
        result["second_moment_without_largest"] = rest.assign_attrs(
            long_name="second moment without the largest cluster", units="1"
        )
        clusters = (ds["number_density"] * ds["volume"]).transpose("replica", "time").values
        found = [_peak(t, *rows) for rows in zip(rest.values, clusters, strict=True)]
    result["gel_time"] = ("replica", np.array(found, float))
    result["gel_time"].attrs = {"long_name": "estimated gel time", "units": "1"}
    _, mean, error = over_replicas(found)
    result.attrs = {"gel_time": float(mean), "gel_time_error": float(error)}
    return result
