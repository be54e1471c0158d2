"""Whether two results agree, time by time and as a whole."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy import optimize, stats

from smolux.errors import InputError
from smolux.results import require

from .joint import Rows, score_test, total_test
from .reference import exact_dataset, is_deterministic
from .select import matches
from .statistics import ROUNDING, Sample, deviation, welch
from .summary import certain_difference, mass_resolution

Float = NDArray[np.float64]

#: the probability with which equal results are said to differ, and the share of each test in it
SIGNIFICANCE = 0.01
_SHARES = {"p_value": 0.5, "p_total": 0.1, "p_largest": 0.4}
#: the labels of the dimension `statistic`
STATISTICS = ("first", "second", "difference", "relative", "error", "sigmas")
#: particles of one size or bin that a density must rest on, for the normal law to hold
_ENOUGH = 10.0
#: standard errors that one number must differ by to be found, beyond which replicas are too few
_BLUNT = 12.0
#: chance of finding what `found_beyond` says
_POWER = 0.9
#: the words for `agree`
VERDICTS = {1: "agrees", 0: "differs", -1: "untested"}
TOO_FEW = "too few replicas to tell"

_TESTED = (
    "sigmas: difference of the means over replicas in standard errors (Welch), turned from "
    "Student's t into the normal deviate of the same probability, with an allowance for skewness "
    "(Hall 1992) beside an exact solution or a solver, which count as without error. Entries are "
    "variable, time, order, size or bin with at least 10 particles. p_value: Student's test of one "
    "score of all entries, their first principal component (Laeuter 1996), uniform if nothing "
    "differs. p_total: the sum of squares of all differences over that of the scatter (Dempster "
    "1958), careful. p_largest: the largest of sigmas by Bonferroni, which holds for any "
    "correlation. The results differ if p_value is below 0.005, p_total below 0.001 or p_largest "
    "below 0.004; equal ones do so in about 1 of 100 cases. If not, they agree, unless a single "
    "number had to be off by more than 12 standard errors to be found (found_beyond, with a chance "
    "of 90 %): then there are too few replicas to tell. A bias of order 1/N of a finite population "
    "is a difference too."
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

    def volumes(self) -> Float:
        """Volume of each replica when it was drawn: what has been doubled has kept its noise."""
        volume = self.ds["volume"].transpose("replica", "time").values
        return np.asarray(np.fmin.reduce(volume, axis=1), float)

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


@dataclass
class _Variable:
    """One variable compared.

    Attributes
    ----------
    result : DataArray
    z : ndarray
        Deviates of the entries that are tested, NaN for others.
    values : tuple of ndarray
        Of both sides, with the replicas first.
    scale : ndarray
        What the entries may scatter by, see `_scale`.
    """

    result: xr.DataArray
    z: Float
    values: tuple[Float, Float]
    scale: Float

    def rows(self) -> tuple[Float, Float, Float]:
        """Return the entries tested: both sides of shape (R, m), and their scale.

        What some replica has not reached is left out, and what no replica scatters in.
        """
        kept = np.isfinite(self.z) & (self.scale > 0)
        kept &= np.all([np.isfinite(v).all(axis=0) for v in self.values], axis=0)
        return self.values[0][:, kept], self.values[1][:, kept], self.scale[kept]


def _compare_variable(a: _Side, b: _Side, name: str) -> _Variable:
    dims = ["time", *(str(d) for d in a.ds[name].dims if d not in ("replica", "time"))]
    values = a.values(name, dims), b.values(name, dims)
    samples = [Sample.of(each) for each in values]
    counts, means = [each.count for each in samples], [each.mean for each in samples]
    errors = [
        np.zeros(each.mean.shape) if side.deterministic else each.error
        for side, each in zip((a, b), samples, strict=True)
    ]
    difference, error = means[0] - means[1], np.hypot(*errors)
    magnitude = np.fmax(np.abs(means[0]), np.abs(means[1]))
    resolution = max(a.resolution, b.resolution)
    orders = a.ds["order"].values if "order" in a.ds else np.array([])
    certain = certain_difference(name, orders, dims, resolution)
    dof = welch(errors[0], counts[0], errors[1], counts[1])
    z = deviation(difference, error, dof, magnitude, certain, _alone(a, b, samples))
    used = (np.isfinite(z) & (error > ROUNDING * magnitude)) | np.isinf(z)
    used &= _chosen(a, b, name, dims, means)
    with np.errstate(all="ignore"):
        relative = difference / magnitude
    columns = np.stack([*means, difference, relative, error, z], axis=-1)
    coordinates = {d: a.ds[d] for d in dims} | {"statistic": list(STATISTICS)}
    attributes = {"long_name": a.ds[name].attrs.get("long_name", name)}
    result = xr.DataArray(columns, coordinates, [*dims, "statistic"], name, attributes)
    scale = _scale(b if a.deterministic else a, name, dims)
    return _Variable(result, np.where(used, z, np.nan), values, scale)


def _alone(a: _Side, b: _Side, samples: Sequence[Sample]) -> Sample | None:
    """Return the replicas if only one side has any: then their skewness counts."""
    if a.deterministic == b.deterministic:
        return None
    (sample,) = (s for side, s in zip((a, b), samples, strict=True) if not side.deterministic)
    if a.deterministic:  # the difference is that of the other side, turned round
        return replace(sample, skewness=-sample.skewness)
    return sample


def _scale(side: _Side, name: str, dims: list[str]) -> Float:
    """Return the standard deviation that independent clusters in that volume would have.

    The square is ``sum_k k**(2 p) n_k / V`` for the moment of order p. It is no more than a measure
    by which entries of all kinds can be put together, and depends on means only.
    """
    ds = side.ds
    volume = ds["volume"].mean("replica").values if "volume" in ds else np.ones(ds.sizes["time"])
    volume = volume.reshape(-1, *[1] * (len(dims) - 1))
    mean = Sample.of(side.values(name, dims)).mean
    if name != "moment" or "n" not in ds:
        return np.asarray(np.sqrt(np.abs(mean) / volume), float)
    p = 2.0 * ds["order"]
    square = (ds["n"] * ds["size"].astype(float) ** p).sum("size")
    if ds.sizes.get("bin", 0):
        square = square + xr.where(ds["n_bin"] == 0, 0.0, ds["n_bin"] * ds["bin"] ** p).sum("bin")
    square = square.mean("replica") if "replica" in square.dims else square
    return np.asarray(np.sqrt(square.transpose(*dims).values / volume))


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
        sigmas. Attributes: ``p_value`` of a joint test; ``p_total`` of another with its
        ``chi_square`` and ``degrees_of_freedom``; ``largest_sigmas``, ``where`` it is and
        ``p_largest``; ``entries`` tested; ``agree`` (1 or 0; -1 if that cannot be told) and the
        same as ``verdict`` in words: agrees, differs, too few replicas to tell, untested;
        ``found_beyond``, how many standard errors a single number had to be off by to be found with
        a chance of 90 %; ``tested``, what all this means.

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
    names = [n for n in ("number_density", "moment", "n", "n_bin") if n in a.ds and n in b.ds]
    parts = {name: _compare_variable(a, b, name) for name in names}
    result = xr.Dataset({name: part.result for name, part in parts.items()})
    z = np.concatenate([part.z[~np.isnan(part.z)] for part in parts.values()])
    largest, where = _largest(result, {name: part.z for name, part in parts.items()})
    p_largest = min(1.0, float(2 * stats.norm.sf(largest)) * z.size) if z.size else np.nan
    p, total, freedom = _together(a, b, list(parts.values()))
    beyond = _found_beyond(freedom)
    result.attrs = {
        "p_value": p,
        "p_total": total[0],
        "chi_square": total[1],
        "degrees_of_freedom": total[2],
        "largest_sigmas": largest if z.size else np.nan,
        "where": where,
        "p_largest": p_largest,
        "entries": int(z.size),
        "found_beyond": beyond,
        "tested": _TESTED,
    }
    result.attrs["agree"], result.attrs["verdict"] = verdict(result.attrs)
    if result.attrs["verdict"] == TOO_FEW:
        result.attrs["notes"] = (
            f"Too few replicas to tell: a single number had to be off by {beyond:.2g} standard "
            "errors to be found with a chance of 90 %; use 8 replicas or more."
        )
    elif not z.size:
        result.attrs["notes"] = (
            "Nothing could be tested: neither result has two or more replicas to take an error "
            "from; see the relative differences."
        )
    return result


def _together(
    a: _Side, b: _Side, parts: Sequence[_Variable]
) -> tuple[float, tuple[float, float, float], int]:
    """Make both tests of all entries at once, NaN for none; also the freedom of the scatter."""
    first, second, scale = (
        np.concatenate(arrays, axis=-1)
        for arrays in zip(*(part.rows() for part in parts), strict=True)
    )
    noisy = [v for v, side in ((first, a), (second, b)) if not side.deterministic]
    freedom = sum(map(len, noisy)) - max(len(noisy), 1)
    if not scale.size or freedom < 1:
        return np.nan, (np.nan,) * 3, 0
    if len(noisy) == 2:
        rows = Rows.of_two(first, second, (a.volumes(), b.volumes()))
    else:
        side, values, known = (b, second, first[0]) if a.deterministic else (a, first, second[0])
        rows = Rows.of_one(values, known, side.volumes())
    return score_test(rows, scale), total_test(rows, scale), freedom


def verdict(found: Mapping[str, Any], comparisons: int = 1) -> tuple[int, str]:
    """Say whether results differ, agree, or whether that cannot be told.

    Parameters
    ----------
    found : mapping
        Attributes of what `compare` returned.
    comparisons : int
        How many are made of which none should differ by chance.

    Returns
    -------
    agree : int
        0, 1 or -1.
    words : str

    Raises
    ------
    InputError
        If it is not of a comparison.
    """
    if not (isinstance(found, Mapping) and {*_SHARES, "found_beyond"} <= set(found)):
        raise InputError(
            f"found = {found!r:.60}: must be the attributes of what analysis.compare returned"
        )
    p = {name: found[name] * comparisons / share for name, share in _SHARES.items()}
    tested = [each for each in p.values() if each == each]
    if not tested:
        return -1, VERDICTS[-1]
    if min(tested) < SIGNIFICANCE:
        return 0, VERDICTS[0]
    return (-1, TOO_FEW) if found["found_beyond"] > _BLUNT else (1, VERDICTS[1])


def _found_beyond(freedom: int) -> float:
    """Return the standard errors that one number must be off by, to be found nearly always."""
    if not freedom:
        return np.nan
    quantile = float(stats.t.isf(SIGNIFICANCE * _SHARES["p_largest"] / 2, freedom))

    def missed(shift: float) -> float:
        return float(stats.nct.cdf(quantile, freedom, shift)) - (1.0 - _POWER)

    return float(optimize.brentq(missed, quantile, 2.0 * quantile))
