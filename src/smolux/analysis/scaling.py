"""Self-similar scaling of size distributions."""

from __future__ import annotations

import numpy as np
import xarray as xr

from smolux.results import require

from .statistics import over_replicas


def mean_size(ds: xr.Dataset) -> xr.DataArray:
    """Return the mean size ``s = M2 / M1``, mean over the replicas.

    Parameters
    ----------
    ds : xarray.Dataset
        With moments of the orders 1 and 2.

    Returns
    -------
    xarray.DataArray over time
    """
    require(ds, "moment", "order", orders=(1.0, 2.0))
    moment = ds["moment"].mean("replica") if "replica" in ds["moment"].dims else ds["moment"]
    s = moment.sel(order=2.0, drop=True) / moment.sel(order=1.0, drop=True)
    return s.rename("mean_size").assign_attrs(long_name="mean size M2/M1", units="1")


def scaling(ds: xr.Dataset) -> xr.Dataset:
    """Bring the size distributions of all times to one form.

    The form is ``phi(x) = s**2 n_k / M1`` with ``x = k / s`` and the mean size ``s = M2 / M1``, so
    that ``int x phi dx`` and ``int x**2 phi dx`` are one. Far from the start, and if the kernel is
    homogeneous and does not gel, it no longer depends on time.

    Parameters
    ----------
    ds : xarray.Dataset
        A result of simulate or solve.

    Returns
    -------
    xarray.Dataset
        ``x``, ``phi`` and ``phi_error`` (standard error over replicas) with the dimensions time
        and ``point``: first the exact sizes, then the bins, whose densities are divided by the
        number of sizes in them. Empty points are NaN. ``mean_size`` over time.

    References
    ----------
    S. K. Friedlander and C. S. Wang, J. Colloid Interface Sci. 22, 126 (1966),
    doi:10.1016/0021-9797(66)90073-7.
    """
    require(ds, "n", "n_bin", "moment", "order", "time")
    n = ds["n"].transpose("replica", "time", "size").values
    width = ds["bin_width"].values
    with np.errstate(invalid="ignore", divide="ignore"):
        binned = ds["n_bin"].transpose("replica", "time", "bin").values / width
    at = np.concatenate([ds["size"].values.astype(float), ds["bin"].values])
    _, density, error = over_replicas(np.concatenate([n, binned], axis=2))
    s = mean_size(ds)
    _, mass, _ = over_replicas(ds["moment"].sel(order=1.0).transpose("replica", "time").values)
    factor = (s.values**2 / mass)[:, None]
    empty = ~(density > 0)
    result = xr.Dataset(
        {
            "x": (("time", "point"), at / s.values[:, None]),
            "phi": (("time", "point"), np.where(empty, np.nan, factor * density)),
            "phi_error": (("time", "point"), np.where(empty, np.nan, factor * error)),
            "mean_size": s,
        }
    )
    result["x"].attrs = {"long_name": "size in units of the mean size M2/M1", "units": "1"}
    result["phi"].attrs = {"long_name": "scaled size distribution", "units": "1"}
    return result
