"""Densities from the rates at which sizes appear, not from counts.

A size k is seen only where a cluster of that size happens to be. But the simulated sizes below it
say at each time how often clusters of the size k appear, ``sum_{i+j=k} K n_i n_j / 2``, and how
long they last. For rare sizes this rests on far more particles than the count of those of size k.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from smolux.checks import numbers, whole
from smolux.errors import InputError, warn
from smolux.kernels.base import Kernel
from smolux.model import Model
from smolux.results import require
from smolux.weighting import MassFlow, Number, WeightFunction
from smolux.weighting.base import Weighting

from .reference import model_of
from .statistics import over_replicas

Float = NDArray[np.float64]

_LONG_NAMES = {
    "n": "number density of clusters of one size, by the rate at which they appear",
    "mean": "mean over the replicas",
    "standard_error": "standard error of the mean",
    "quadrature_error": "change of the mean if every other time is left out",
}


def densities_by_rates(ds: xr.Dataset, sizes: ArrayLike, model: Model | None = None) -> xr.Dataset:
    """Estimate densities of sizes from the rates at which they appear and vanish.

    For aggregation, with ``g = sum_{i+j=k} K n_i n_j / 2``, ``l = sum_j K(k, j) n_j`` and any
    function L of time,

    ``n_k(t) = n_k(0) e(0, t) + int_0^t e(s, t) (g - (l - L) n_k) ds``, ``e = exp(-int_s^t L)``,

    holds for the means. It is taken for each replica, with the mean of l over the replicas as L and
    without pairs of a particle with itself, which do not meet. So the estimate has the mean that
    the count has, the bias of a finite population included, and less scatter where k is rare.

    Parameters
    ----------
    ds : xarray.Dataset
        A result of `simulate`: aggregation alone, at three output times or more, counted one by one
        up to the largest of the sizes. Densities at the first time are taken as they are; what
        counts is the time before the wanted one in which most clusters of such a size meet another.
    sizes : array_like of int
        The sizes that are wanted.
    model : Model, optional
        Needed only if the kernel is a Python function.

    Returns
    -------
    xarray.Dataset
        ``n`` over replica, time and size; ``mean`` and ``standard_error`` over the replicas;
        ``quadrature_error``, the change of the mean if every other output time is left out: the
        error of Simpson's rule is some 15 times smaller. If at the last time it exceeds the
        standard error, there is a warning.

    Raises
    ------
    InputError
        If the result is another one, or the sizes are not counted one by one.

    Examples
    --------
    >>> import numpy as np
    >>> import smolux as sx
    >>> ds = sx.simulate(
    ...     sx.Model(sx.kernels.Constant()),
    ...     np.linspace(0, 20, 41),
    ...     particles=10_000,
    ...     replicas=8,
    ...     seed=1,
    ... )
    >>> better = sx.analysis.densities_by_rates(ds, [50]).n.sel(time=20, size=50)
    >>> bool(better.std() < ds.n.sel(time=20, size=50).std() / 3)
    True
    """
    require(ds, "time", "n", "volume", source="simulate")
    wanted, found, weighting = _checked(ds, sizes, model)
    times = ds["time"].values
    n, volume = ds["n"].transpose("replica", "time", "size").values, ds["volume"].values
    one = 1.0 / volume  # the density of a simulated particle, for a weight of one
    values, errors = [], []
    for k in wanted:
        loss = _loss(ds, found.kernel, k) - _itself(found.kernel, weighting, k) * one
        gain = _gain(n, found.kernel, weighting, k, one)
        mean = np.nanmean(loss, axis=0)
        change = gain - (loss - mean) * n[:, :, k - 1]
        fine, coarse = (_integrated(times, n[:, 0, k - 1], change, mean, step) for step in (1, 2))
        values.append(fine)
        errors.append(np.abs(np.nanmean(fine - coarse, axis=0)))
    return _dataset(ds, wanted, np.stack(values, axis=-1), np.stack(errors, axis=-1))


def _checked(ds: xr.Dataset, sizes: ArrayLike, model: Model | None) -> tuple[Any, ...]:
    """Return the sizes, the model and the weighting."""
    problems = []
    wanted = [whole(k) for k in np.atleast_1d(numbers("sizes", sizes)).ravel().tolist()]
    most = int(ds.sizes.get("size", 0))
    if not wanted or None in wanted or min(wanted) < 1 or max(wanted) > most:  # type: ignore[type-var, operator]
        problems.append(
            f"sizes = {sizes!r}: must be whole numbers from 1 to {most}, up to which sizes are "
            "counted one by one: simulate with a larger sizes="
        )
    if ds.sizes.get("time", 0) < 3:
        problems.append(
            f"times: the result has {ds.sizes.get('time', 0)}, and an integral over time needs "
            "three or more: simulate with np.linspace(0, end, 41)"
        )
    if "weighting" not in ds.attrs:
        problems.append("ds: must be a result of smolux.simulate")
    found = model if model is not None else model_of(ds)
    if found is None:
        problems.append(
            "model = None: the result does not hold its kernel, a Python function; give the model"
        )
    elif not found.reduced.plain_aggregation:
        names = ", ".join(p.called for p in found.processes)
        problems.append(
            f"ds: has the processes {names}; only aggregation alone is supported, at the rate of "
            "the kernel"
        )
    if problems or found is None:
        raise InputError(problems)
    settings = json.loads(ds.attrs.get("weighting_settings", "{}"))
    weightings = {w.name: w for w in (Number, MassFlow, WeightFunction)}
    return wanted, found.reduced, weightings[ds.attrs["weighting"]](**settings)


def _weight(weighting: Weighting, size: int) -> float:
    return float(weighting.weights(np.array([float(size)]))[0])


def _rates(kernel: Kernel, i: ArrayLike, j: Float) -> Float:
    return np.asarray(np.broadcast_to(kernel(np.asarray(i, float), j), j.shape), float)


def _itself(kernel: Kernel, weighting: Weighting, k: int) -> float:
    """Rate at which a particle of size k would meet itself, for a volume of one."""
    return float(_rates(kernel, k, np.array([float(k)]))[0]) / _weight(weighting, k)


def _loss(ds: xr.Dataset, kernel: Kernel, k: int) -> Float:
    """Return ``sum_j K(k, j) n_j``, of shape (replicas, times).

    Sizes in bins are put at their centres, all moved by one factor, so that the mass is exact.
    """
    n = ds["n"].transpose("replica", "time", "size").values
    counted = np.arange(1.0, n.shape[2] + 1.0)
    rate = n @ _rates(kernel, k, counted)
    if not ds.sizes.get("bin", 0):
        return rate
    bins, centre = ds["n_bin"].transpose("replica", "time", "bin").values, ds["bin"].values
    inside = bins @ centre
    shift = np.ones_like(inside)
    if 1.0 in ds["order"].values:
        mass = ds["moment"].sel(order=1.0).values - n @ counted
        shift = np.divide(mass, inside, out=shift, where=inside > 0.0)
    return rate + (bins * _rates(kernel, k, shift[..., None] * centre)).sum(axis=-1)


def _gain(n: Float, kernel: Kernel, weighting: Weighting, k: int, one: Float) -> Float:
    """Return ``sum_{i+j=k} K(i, j) n_i n_j / 2``, of shape (replicas, times)."""
    if k == 1:
        return np.zeros(n.shape[:2])
    i = np.arange(1.0, k)
    pairs = n[:, :, : k - 1] * n[:, :, k - 2 :: -1]
    if k % 2 == 0:
        half = k // 2
        pairs[:, :, half - 1] -= n[:, :, half - 1] * one / _weight(weighting, half)
    return np.asarray(0.5 * pairs @ _rates(kernel, i, k - i), float)


def _integrated(times: Float, first: Float, change: Float, loss: Float, step: int) -> Float:
    """Solve ``dn/dt = change - loss n`` from `first` on, by every `step`-th time from each back."""
    # here, as to load it takes longer than the rest
    from scipy.integrate import cumulative_simpson, simpson

    exponent = cumulative_simpson(loss, x=times, initial=0.0)
    found = [first]
    for m in range(1, len(times)):
        used = np.union1d(0, np.arange(m, -1, -step))
        left = np.exp(exponent[used] - exponent[m])
        found.append(first * left[0] + simpson(change[:, used] * left, x=times[used]))
    return np.stack(found, axis=1)


def _dataset(ds: xr.Dataset, sizes: Any, values: Float, errors: Float) -> xr.Dataset:
    _, mean, error = over_replicas(values)
    dims = ("time", "size")
    result = xr.Dataset(
        {
            "n": (("replica", *dims), values),
            "mean": (dims, mean),
            "standard_error": (dims, error),
            "quadrature_error": (dims, errors),
        },
        {"replica": ds["replica"], "time": ds["time"], "size": list(sizes)},
    )
    for name, text in _LONG_NAMES.items():
        result[name].attrs = {"long_name": text, "units": ds["n"].attrs.get("units", "1")}
    off = errors[-1] > error[-1]
    if off.any():
        worst = int(np.argmax(np.where(off, errors[-1] / error[-1], 0.0)))
        text = (
            f"the density of size {sizes[worst]} at the last time changes by "
            f"{errors[-1, worst]:.2g} if every other output time is left out, its standard error "
            f"is {error[-1, worst]:.2g}: use more output times"
        )
        warn([text], level=2)
    return result
