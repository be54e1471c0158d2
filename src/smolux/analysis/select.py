"""One time series out of a result."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from smolux.errors import InputError, did_you_mean
from smolux.results import require

Float = NDArray[np.float64]

#: variables of (replica, time) and what the two with a further dimension are chosen by
_FURTHER = {"moment": "order", "n": "size", "n_bin": "bin", "events": "process"}


def series(
    ds: xr.Dataset, variable: str, *, order: float = 2.0, size: int = 1, **labels: object
) -> xr.DataArray:
    """Return one quantity over replica and time.

    Parameters
    ----------
    ds : xarray.Dataset
    variable : str
        Name of a variable of the result.
    order : float
        Which moment, if `variable` is ``moment``.
    size : int
        Which size, if it is ``n``.
    **labels
        Likewise ``process`` for ``events``; ``bin`` for ``n_bin``.

    Returns
    -------
    xarray.DataArray of shape (replica, time)

    Raises
    ------
    InputError
        If there is no such variable, order, size or process.
    """
    require(ds, "time")
    known = [str(name) for name, v in ds.data_vars.items() if "time" in v.dims]
    if variable not in known:
        raise InputError(
            f"variable = {variable!r}: not in the result{did_you_mean(variable, known)}"
        )
    dim = _FURTHER.get(variable)
    values = ds[variable]
    if dim is not None:
        wanted = {"order": order, "size": size, **labels}.get(dim)
        present = ds[dim].values.tolist()
        if wanted not in present:
            shown = present if len(present) <= 12 else f"{present[0]} to {present[-1]}"
            raise InputError(f"{dim} = {wanted!r}: not in the result, which has {shown}")
        values = values.sel({dim: wanted}, drop=True)
    others = [str(d) for d in values.dims if d not in ("replica", "time")]
    if others:
        place = {name: values[name].values[0].item() for name in others}
        raise InputError(f"ds: is a sweep; choose a point, such as ds.sel({place})")
    return values.transpose("replica", "time")


def matches(left: Float, right: Float) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Positions of the numbers that stand in both arrays, up to rounding."""
    if not right.size:
        return np.array([], int), np.array([], int)
    order = np.argsort(right)
    near = np.searchsorted(right[order], left * (1 - 1e-9)).clip(max=right.size - 1)
    same = np.isclose(left, right[order][near], rtol=1e-9, atol=0)
    return np.flatnonzero(same), order[near[same]]
