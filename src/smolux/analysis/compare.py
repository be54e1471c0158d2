"""Whether two results agree, time by time and as a whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy import stats

from smolux.errors import InputError
from smolux.results import require

from .reference import exact_dataset, is_deterministic
from .select import matches
from .statistics import ROUNDING, deviation, joint_test, over_replicas, welch
from .summary import certain_difference, mass_resolution

Float = NDArray[np.float64]

#: the probability below which two results are said to differ
SIGNIFICANCE = 1e-3
#: the labels of the dimension `statistic`
STATISTICS = ("first", "second", "difference", "relative", "error", "sigmas")
#: particles of one size or bin that a density must rest on, for the normal law to hold
_ENOUGH = 10.0

_TESTED = (
    "sigmas: difference of the means over replicas in standard errors (Welch), turned from "
    "Student's t into the normal deviate of the same probability; an exact solution or a solver "
    "counts as without error. p_value: the sum of the squares of sigmas over all entries "
    "(variable, time, order, size or bin with at least 10 particles) against a chi-square law with "
    "the mean, variance and skewness that this sum has under the correlations seen between the "
    "replicas (Imhof 1961). p_largest: the largest of sigmas by Bonferroni, which holds for any "
    "correlation. The results agree if both are above 0.001. A bias of order 1/N of a finite "
    "population is a difference too."
)


@dataclass
class _Side:
    """One of the two results, and what is needed of it after it has been cut to what is common."""

    ds: xr.Dataset
    deterministic: bool
    resolution: float

    @classmethod
    def of(cls, ds: xr.Dataset) -> _Side:
        return cls(ds, is_deterministic(ds), mass_resolution(ds))

    def take(self, **index: NDArray[np.int_]) -> None:
        self.ds = self.ds.isel({k: v for k, v in index.items() if k in self.ds.dims})

    def values(self, name: str, dims: list[str]) -> Float:
        """Values with the replicas first; an exact solution is one replica."""
        variable = self.ds[name]
        if "replica" not in variable.dims:
            variable = variable.expand_dims("replica")
        values = np.asarray(variable.transpose("replica", *dims).values, float)
        # moments beyond gelation are infinite: there is nothing to compare
        return np.where(np.isfinite(values), values, np.nan)

    def populated(self, mean: Float) -> NDArray[np.bool_]:
        """Whether densities of shape (time, ...) rest on enough particles; a solver's always do."""
        if self.deterministic:
            return np.ones(mean.shape, bool)
        volume = self.ds["volume"].mean("replica").values
        return mean * volume.reshape(-1, *[1] * (mean.ndim - 1)) >= _ENOUGH


def _cut(a: _Side, b: _Side) -> None:
    """Cut both to the times, orders, sizes and bins that they share."""
    for dim in ("time", "order", "size", "bin"):
        if dim in a.ds.dims and dim in b.ds.dims:
            key = "bin_lower" if dim == "bin" else dim
            left, right = matches(*(side.ds[key].values.astype(float) for side in (a, b)))
            a.take(**{dim: left})
            b.take(**{dim: right})
    if "bin" in a.ds.dims and "bin" in b.ds.dims:
        same = np.flatnonzero(a.ds["bin_upper"].values == b.ds["bin_upper"].values)
        a.take(bin=same)
        b.take(bin=same)
    if not a.ds.sizes["time"]:
        raise InputError("compare: the two results have no output time in common")


def _chosen(
    a: _Side, b: _Side, name: str, dims: list[str], means: Sequence[Float]
) -> NDArray[np.bool_]:
    """Which entries go into the joint test: none twice, and none that rests on few particles."""
    chosen = np.ones(means[0].shape, bool)
    if name == "moment" and "number_density" in a.ds and "number_density" in b.ds:
        order = a.ds["order"].values.reshape([-1 if d == "order" else 1 for d in dims])
        chosen &= order != 0
    if name in ("n", "n_bin"):
        chosen &= a.populated(means[0]) & b.populated(means[1])
    return chosen


def _compare_variable(a: _Side, b: _Side, name: str) -> tuple[xr.DataArray, Float, Float]:
    """Compare one variable; also the deviates for the joint test, and their rows."""
    dims = ["time", *(str(d) for d in a.ds[name].dims if d not in ("replica", "time"))]
    values = [side.values(name, dims) for side in (a, b)]
    counts, means, scatter = zip(*map(over_replicas, values), strict=True)
    errors = [
        np.zeros(mean.shape) if side.deterministic else error
        for side, mean, error in zip((a, b), means, scatter, strict=True)
    ]
    difference, error = means[0] - means[1], np.hypot(*errors)
    magnitude = np.fmax(np.abs(means[0]), np.abs(means[1]))
    resolution = max(a.resolution, b.resolution)
    orders = a.ds["order"].values if "order" in a.ds else np.array([])
    certain = certain_difference(name, orders, dims, resolution)
    dof = welch(errors[0], counts[0], errors[1], counts[1])
    z = deviation(difference, error, dof, magnitude, certain)

    rows = []
    for side, table, mean, count in zip((a, b), values, means, counts, strict=True):
        if not side.deterministic:
            with np.errstate(all="ignore"):
                scaled = (table - mean) / (error * np.sqrt(count * (count - 1)))
            # a replica that was not observed adds nothing
            rows.append(np.nan_to_num(scaled, nan=0.0, posinf=0.0, neginf=0.0))
    used = (np.isfinite(z) & (error > ROUNDING * magnitude)) | np.isinf(z)
    used &= _chosen(a, b, name, dims, means)
    residuals = np.concatenate(rows)[:, used] if rows else np.zeros((0, int(used.sum())))

    with np.errstate(all="ignore"):
        relative = difference / magnitude
    columns = np.stack([*means, difference, relative, error, z], axis=-1)
    coordinates = {d: a.ds[d] for d in dims} | {"statistic": list(STATISTICS)}
    attributes = {"long_name": a.ds[name].attrs.get("long_name", name)}
    result = xr.DataArray(columns, coordinates, [*dims, "statistic"], name, attributes)
    return result, np.where(used, z, np.nan), residuals


def _largest(result: xr.Dataset, used: dict[str, Float]) -> tuple[float, str]:
    """Return the largest deviation that was tested, and where it is."""
    best, where = 0.0, ""
    for name, z in used.items():
        if z.size and np.any(~np.isnan(z)) and np.nanmax(np.abs(z)) >= best:
            index = np.unravel_index(int(np.nanargmax(np.abs(z))), z.shape)
            best = float(abs(z[index]))
            places = zip(result[name].dims[:-1], index, strict=True)
            where = ", ".join([name, *(f"{d} {result[d].values[k]:g}" for d, k in places)])
    return best, where


def compare(first: xr.Dataset, second: xr.Dataset | Literal["exact"]) -> xr.Dataset:
    """Differences of two results in standard deviations, and whether chance explains them.

    Parameters
    ----------
    first : xarray.Dataset
        A result of `smolux.simulate` or `smolux.solve`.
    second : xarray.Dataset or "exact"
        Another one, or the exact solution of the model of the first.

    Returns
    -------
    xarray.Dataset
        For number_density, moment, n and n_bin at what both have in common (times, orders, sizes,
        bins), along the dimension ``statistic``: first, second, difference, relative, error and
        sigmas. Attributes: ``p_value`` of the joint test with its ``chi_square`` and
        ``degrees_of_freedom``; ``largest_sigmas``, ``where`` it is and ``p_largest``; ``entries``
        tested; ``agree`` (1 or 0; -1 if nothing could be tested); ``tested``, what all this means.

    Raises
    ------
    InputError
        If the results have no time in common, or no exact solution is known.
    """
    require(first, "time", what="first")
    if not isinstance(second, str):
        require(second, "time", what="second")
    elif second != "exact":
        raise InputError(
            f"second = {second!r}: must be a result or 'exact'; read a file with "
            "smolux.results.load"
        )
    reference = exact_dataset(first) if isinstance(second, str) else second
    if reference is None:
        raise InputError("compare: no exact solution is known for the model of this result")
    a, b = _Side.of(first), _Side.of(reference)
    _cut(a, b)
    parts, used, rows = {}, {}, []
    for name in ("number_density", "moment", "n", "n_bin"):
        if name in a.ds and name in b.ds:
            parts[name], used[name], residuals = _compare_variable(a, b, name)
            rows.append(residuals)
    result = xr.Dataset(parts)
    z = np.concatenate([v[~np.isnan(v)] for v in used.values()])
    largest, where = _largest(result, used)
    p, chi_square, f = joint_test(z, np.concatenate(rows, axis=1)) if z.size else (np.nan,) * 3
    p_largest = min(1.0, float(2 * stats.norm.sf(largest)) * z.size) if z.size else np.nan
    agree = int(min(p, p_largest) > SIGNIFICANCE) if z.size else -1
    result.attrs = {
        "p_value": p,
        "chi_square": chi_square,
        "degrees_of_freedom": f,
        "largest_sigmas": largest if z.size else np.nan,
        "where": where,
        "p_largest": p_largest,
        "entries": int(z.size),
        "agree": agree,
        "tested": _TESTED,
    }
    if not z.size:
        result.attrs["notes"] = (
            "Nothing could be tested: neither result has two or more replicas to take an error "
            "from; see the relative differences."
        )
    return result
