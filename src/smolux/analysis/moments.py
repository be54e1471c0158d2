"""Moments from size distributions."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr

from smolux.checks import orders_of_moments
from smolux.results import require


def moments(ds: xr.Dataset, orders: Sequence[float] = (0, 1, 2, 3)) -> xr.Dataset:
    """Moments of any order from the densities of sizes and bins.

    The variable ``moment`` of a result is exact, but only of the orders asked for beforehand. Where
    the sizes of a bin differ, its share can only be bounded: it lies between that of its smallest
    and that of its largest size.

    Parameters
    ----------
    ds : xarray.Dataset
        With n, and n_bin if there is mass above the sizes.
    orders : sequence of float
        The exponents p in ``M_p = sum_k k**p n_k``; any real numbers.

    Returns
    -------
    xarray.Dataset
        The variables moment, lower and upper with the dimensions of n, ``order`` in place of
        ``size``. The estimate puts all clusters of a bin at its geometric centre.
    """
    require(ds, "n", "size")
    powers = orders_of_moments(orders)
    p = xr.DataArray(powers, dims="order", coords={"order": powers})
    exact = (ds["n"] * ds["size"].astype(float) ** p).sum("size", skipna=False)
    parts = [exact, exact, exact]
    if ds.sizes.get("bin", 0):
        for k, at in enumerate((ds["bin"], ds["bin_lower"], ds["bin_upper"] - 1)):
            # an empty bin holds nothing, even if it has no upper end
            terms = xr.where(ds["n_bin"] == 0, 0.0, ds["n_bin"] * at**p)
            parts[k] = exact + terms.sum("bin", skipna=False)
    middle, first, last = (part.transpose(..., "order") for part in parts)
    result = xr.Dataset(
        {
            "moment": middle,
            # for negative orders the smallest size weighs most
            "lower": xr.where(first < last, first, last),
            "upper": xr.where(first < last, last, first),
        }
    )
    for name, text in (("moment", "estimate"), ("lower", "lower bound"), ("upper", "upper bound")):
        result[name].attrs = {"long_name": f"moment of the binned distribution, {text}"}
    return result
