"""What a result is measured against: the exact solution, where one is known."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Literal

import numpy as np
import xarray as xr

from smolux import exact
from smolux.model import Model
from smolux.model_dict import model_from_dict
from smolux.results import require

if TYPE_CHECKING:
    from smolux.exact.base import Solution


def model_of(ds: xr.Dataset) -> Model | None:
    """Rebuild the model of a result; None if it holds none, or a Python function.

    Parameters
    ----------
    ds : xarray.Dataset

    Returns
    -------
    Model or None
    """
    require(ds)
    try:
        return model_from_dict(json.loads(ds.attrs["model"]))
    except (KeyError, TypeError, ValueError):
        return None


def solution_of(ds: xr.Dataset) -> Solution | None:
    """Return the exact solution of the model of a result, None if none is known.

    Parameters
    ----------
    ds : xarray.Dataset

    Returns
    -------
    smolux.exact.Solution or None
    """
    model = model_of(ds)
    # a gel reacts in a simulation; rate equations say what theirs does
    gel: Literal["reacts", "inert"] = "inert" if ds.attrs.get("gel") == "inert" else "reacts"
    return None if model is None else exact.solution(model, gel=gel)


def exact_dataset(ds: xr.Dataset) -> xr.Dataset | None:
    """Return the exact solution at the times, orders and sizes of a result, None if none is known.

    Parameters
    ----------
    ds : xarray.Dataset

    Returns
    -------
    xarray.Dataset or None
        With number_density, moment and n, without the dimension replica.
    """
    require(ds, "time", "order", "size")
    solution = solution_of(ds)
    if solution is None:
        return None
    times, orders, sizes = (ds[name].values for name in ("time", "order", "size"))
    # a simulation counts the infinite cluster, rate equations do not
    infinite = not is_deterministic(ds)
    moments = [solution.moment(times, float(p), gel=infinite) for p in orders]
    return xr.Dataset(
        {
            "number_density": ("time", solution.moment(times, 0)),
            "moment": (("order", "time"), np.reshape(moments, (len(orders), len(times)))),
            "n": (("time", "size"), solution.densities(times, sizes)),
        },
        {"time": times, "order": orders, "size": sizes},
        {"method": "exact", "model": ds.attrs["model"]},
    )


def is_deterministic(ds: xr.Dataset) -> bool:
    """Whether a result comes from rate equations or a formula: it has no simulated particles."""
    return "particles" not in ds or bool(np.all(np.isnan(ds["particles"].values)))
