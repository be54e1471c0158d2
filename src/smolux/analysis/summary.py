"""Means, 95 % intervals and deviations from the exact solution."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from smolux.errors import InputError
from smolux.results import require

from .balance import mass_balance
from .rare import Rare
from .reference import exact_dataset, is_deterministic
from .statistics import ROUNDING, Sample, deviation, mean_interval, vague

Float = NDArray[np.float64]

#: the labels of the dimension `statistic`
STATISTICS = ("mean", "standard_error", "lower", "upper", "exact", "sigmas", "replicas", "doubtful")

_MEANINGS = {
    "mean": "mean over the replicas that reached the time",
    "standard_error": "standard error of the mean; NaN for a single replica",
    "lower, upper": "95 % interval of the mean: Student's t or, if it reaches further, Hall's "
    "transformation of it for skewed laws; of a density that rests on at most 30 clusters in all "
    "replicas, that of a Poisson count",
    "exact": "exact solution in the limit of infinitely many particles, NaN where none is known",
    "sigmas": "(mean - exact) / standard_error, turned from Student's t into the normal deviate of "
    "the same probability, with the same allowance for skewness; NaN where the replicas show no "
    "spread",
    "replicas": "number of replicas in the mean",
    "doubtful": "1 where there are too few replicas to promise 95 %: two or three, a standard "
    "error above a fifth of the mean, or a size of which one or two clusters were seen",
}

_BIAS = (
    "The interval is the scatter of the replicas. The bias of a finite population, of order 1/N "
    "for N simulated particles, is not in it and does not fall with the number of replicas."
)


def mass_resolution(ds: xr.Dataset) -> float:
    """Share of the mass that one particle makes up at the start; 0 if unknown."""
    if is_deterministic(ds) or 1.0 not in ds["order"].values:
        return 0.0
    start = ds.isel(time=0)
    mass = (start["moment"].sel(order=1.0) * start["volume"]).values
    with np.errstate(all="ignore"):
        share = start["largest"].values / mass
    return float(np.nanmax(share)) if np.any(np.isfinite(share)) else 0.0


def certain_difference(name: str, orders: Float, dims: Sequence[str], resolution: float) -> Float:
    """Relative difference that no chance explains even without spread: of the mass only."""
    if name != "moment":
        return np.array(np.inf)
    allowed = np.where(orders == 1, max(1e-6, 2 * resolution), np.inf)
    return allowed.reshape([-1 if d == "order" else 1 for d in dims])


def has_moved(ds: xr.Dataset) -> NDArray[np.bool_]:
    """Say at which times anything has happened in any replica, of whatever kind."""
    events = ds["collisions"].max("replica").values > 0
    if "events" in ds and ds.sizes.get("process", 0):
        events = events | (ds["events"].max(("replica", "process")).values > 0)
    if "mass_in" in ds:
        moved = (ds["mass_in"] > 0) | (ds["mass_out"] > 0)
        events = events | moved.any("replica").values
    return np.asarray(events | np.isnan(ds["volume"].values).all(axis=0))


def _of_variable(ds: xr.Dataset, exact: xr.Dataset | None, name: str) -> xr.DataArray:
    variable = ds[name].transpose("replica", ...)
    dims = [str(d) for d in variable.dims[1:]]
    sample = Sample.of(variable.values)
    count, mean = sample.count, sample.mean
    # a spread of the last digits is none
    error = np.where(sample.error <= ROUNDING * np.abs(mean), 0.0, sample.error)
    lower, upper = (np.where(error == 0, mean, end) for end in mean_interval(sample))
    doubtful = vague(sample) & (error > 0)
    known = np.full(mean.shape, np.nan)
    if exact is not None:
        known = exact[name].transpose(*dims).values
    # moments beyond gelation are infinite: there is nothing to compare
    finite = np.where(np.isfinite(known), known, np.nan)
    magnitude = np.fmax(np.abs(mean), np.abs(finite))
    certain = certain_difference(name, ds["order"].values, dims, mass_resolution(ds))
    if name == "n":
        # the same count in every replica, above all zero, is luck and no proof of certainty, unless
        # nothing has happened yet
        luck = (error == 0) & has_moved(ds)[:, None]
        error, lower, upper = (np.where(luck, np.nan, x) for x in (error, lower, upper))
    sigmas = deviation(mean - finite, error, count - 1, magnitude, certain, sample)
    rare = Rare.of(ds, variable.values) if name == "n" and ds.sizes["replica"] > 1 else None
    if rare is not None:
        few = rare.few & has_moved(ds)[:, None]
        ends = (error, rare.error()), *zip((lower, upper), rare.interval(), strict=True)
        error, lower, upper = (np.where(few, b, a) for a, b in ends)
        sigmas = np.where(few, rare.sigmas(finite), sigmas)
        doubtful = np.where(few, rare.doubtful, doubtful)
    values = np.stack([mean, error, lower, upper, known, sigmas, count, doubtful], axis=-1)
    coordinates = {d: ds[d] for d in dims} | {"statistic": list(STATISTICS)}
    return xr.DataArray(values, coordinates, [*dims, "statistic"], attrs=dict(ds[name].attrs))


def _notes(ds: xr.Dataset, result: xr.Dataset, exact: xr.Dataset | None) -> list[str]:
    count = result["number_density"].sel(statistic="replicas").values
    replicas = ds.sizes["replica"]
    notes = []
    if is_deterministic(ds):
        notes.append("Deterministic: there is no scatter and no interval.")
    else:
        notes.append(_BIAS)
        if replicas == 1:
            notes.append("One replica tells nothing of its scatter: no interval; use 8 or more.")
        if any(bool((v.sel(statistic="doubtful") == 1).any()) for v in result.values()):
            notes.append(
                "Too few replicas to promise 95 % where an interval has a question mark (statistic "
                "doubtful): use 8 or more, or more particles."
            )
    if np.any(count < replicas):
        since = ds["time"].values[np.argmax(count < replicas)]
        notes.append(
            f"The run was not finished: from t = {since:g} on, fewer than {replicas} replicas are "
            "in the mean."
        )
    extinct = int(np.isfinite(ds["extinction_time"].values).sum()) if "extinction_time" in ds else 0
    if extinct:
        notes.append(
            f"In {extinct} of {replicas} replicas one cluster was left, or none; they stay in the "
            "means."
        )
    if exact is None:
        notes.append("No exact solution is known for this model.")
    return notes


def summary(ds: xr.Dataset, sizes: Sequence[int] = (1, 2, 5, 10, 20, 50, 100)) -> xr.Dataset:
    """Mean and 95 % interval over replicas, beside the exact solution where one is known.

    Parameters
    ----------
    ds : xarray.Dataset
        A result of `smolux.simulate` or `smolux.solve`.
    sizes : sequence of int
        The sizes whose number densities are wanted; those beyond the result are left out.

    Returns
    -------
    xarray.Dataset
        The variables number_density, moment and n with a dimension ``statistic``, whose labels are
        mean, standard_error, lower, upper, exact, sigmas and replicas; the attributes say what they
        mean, ``notes`` what should be known of this result, and ``mass`` whether the mass adds up,
        see `mass_balance`. `format_table` makes text of it.

    Raises
    ------
    InputError
        If `ds` is no result.

    Examples
    --------
    >>> smolux.summary(ds)["moment"].sel(order=2, statistic="mean")  # doctest: +SKIP
    """
    require(ds, "number_density", "moment", "n", "replica")
    if "sweep" in ds.attrs and "point_status" in ds and ds["point_status"].dims:
        place = {str(d): ds[d].values[0].item() for d in ds["point_status"].dims}
        raise InputError(f"ds: is a sweep; choose a point, such as ds.sel({place})")
    ds = ds.sel(size=[s for s in sizes if s in ds["size"].values])
    exact = exact_dataset(ds)
    result = xr.Dataset(
        {name: _of_variable(ds, exact, name) for name in ("number_density", "moment", "n")}
    )
    kept = ("Conventions", "source", "smolux_schema", "model", "method", "seed", "created")
    result.attrs = {key: ds.attrs[key] for key in kept if key in ds.attrs}
    result.attrs["statistics"] = "; ".join(f"{k}: {v}" for k, v in _MEANINGS.items())
    result.attrs["notes"] = " ".join(_notes(ds, result, exact))
    result.attrs["mass"] = mass_balance(ds)
    return result
