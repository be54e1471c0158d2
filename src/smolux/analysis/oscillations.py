"""Extrema, period and amplitude of oscillations, and whether they last."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy import signal

from smolux.checks import numbers
from smolux.errors import InputError

from .periodicity import chance_of_noise
from .reference import is_deterministic
from .select import series
from .statistics import over_replicas

Float = NDArray[np.float64]

#: swings needed before a limit of their amplitudes is estimated
_ENOUGH = 4
#: share of the last swing that must remain in the limit for oscillations to be called lasting
_LASTING = 0.3
#: share of the swings that must remain over the whole series for them to count as level
_LEVEL = 0.9
#: probability that noise has such a spectrum above which oscillations are taken for noise
_NOISE = 1e-3
#: value of F from which on a limit above zero is called for
_CLEAR = 10.0


def _noise(t: Float, y: Float) -> float:
    """Estimate white noise: how far points lie from the cubic through four neighbours."""
    if len(t) < 8:
        return 0.0
    around = np.array([-2, -1, 1, 2])
    middle = np.arange(2, len(t) - 2)
    nodes, values = t[middle[:, None] + around], y[middle[:, None] + around]
    weight = np.ones(nodes.shape)
    for k in range(4):
        for m in range(4):
            if m != k:
                weight[:, k] *= (t[middle] - nodes[:, m]) / (nodes[:, k] - nodes[:, m])
    error = y[middle] - np.sum(weight * values, axis=1)
    # the median of absolute values, so that a steep start does not count as noise
    return float(np.median(np.abs(error) / np.sqrt(1 + np.sum(weight**2, axis=1))) / 0.6745)


def _refine(t: Float, y: Float, at: int, half_width: float, kind: int) -> tuple[float, float]:
    """Vertex of the quartic fitted around a sample; the sample itself if it has none."""
    near = np.flatnonzero(np.abs(t - t[at]) <= half_width)
    low, high = max(min(near[0], at - 2), 0), min(max(near[-1], at + 2), len(t) - 1)
    if high - low < 4:
        return float(t[at]), float(y[at])
    window = slice(low, high + 1)
    fit = Polynomial.fit(t[window], y[window], 4)
    slope, curvature = fit.deriv(), fit.deriv(2)
    roots = slope.roots()
    roots = roots[np.abs(roots.imag) < 1e-9 * (t[high] - t[low])].real
    roots = roots[(roots >= t[low]) & (roots <= t[high])]
    roots = roots[kind * curvature(roots) < 0]
    if not roots.size:
        return float(t[at]), float(y[at])
    best = roots[np.argmin(np.abs(roots - t[at]))]
    return float(best), float(fit(best))


def extrema(
    times: Float, values: Float, *, prominence: float = 0.02
) -> tuple[Float, Float, NDArray[np.int_]]:
    """Maxima and minima of a sampled curve, located between the samples.

    Parameters
    ----------
    times, values : ndarray of shape (T,)
        Increasing times; what follows the first NaN is left out.
    prominence : float
        Least height of an extremum above its surroundings as a share of the range of the values.
        Extrema less than eight standard deviations of the noise high do not count either.

    Returns
    -------
    times, values : ndarray of shape (E,)
    kinds : ndarray of int, shape (E,)
        +1 for a maximum, -1 for a minimum; they alternate.
    """
    t, y = numbers("times", times), numbers("values", values)
    seen = np.isfinite(y)
    stop = len(y) if seen.all() else int(np.argmin(seen))
    t, y = t[:stop], y[:stop]
    if stop < 5:
        return np.array([]), np.array([]), np.array([], int)
    noise = _noise(t, y)
    least = max(prominence * float(np.ptp(y)), 8 * noise, np.finfo(float).tiny)
    found = [
        (int(k), kind) for kind in (1, -1) for k in signal.find_peaks(kind * y, prominence=least)[0]
    ]
    alternating: list[tuple[int, int]] = []
    for k, kind in sorted(found):
        if alternating and alternating[-1][1] == kind:
            if kind * y[k] > kind * y[alternating[-1][0]]:
                alternating[-1] = (k, kind)
        else:
            alternating.append((k, kind))
    at = np.array([k for k, _ in alternating], int)
    # with noise, fit over a good part of the swing; without, the nearest samples are better
    swing = np.diff(t[at])
    wide = 0.35 * float(np.median(swing)) if swing.size and noise > 0.01 * least else 0.0
    points = [_refine(t, y, k, wide, kind) for k, kind in alternating]
    kinds = np.array([kind for _, kind in alternating], int)
    return np.array([p[0] for p in points]), np.array([p[1] for p in points]), kinds


def _decay(swings: Float, free: bool) -> tuple[float, float, float]:
    """Fit ``limit + c ratio**k``, limit zero if not `free`: sum of squares, limit, ratio."""
    k = np.arange(len(swings))
    best = (np.inf, np.nan, np.nan)
    for ratio in np.linspace(0.02, 1.0, 197):
        shape = ratio**k
        level = -1.0
        if free and ratio < 1:
            design = np.stack([np.ones(len(k)), shape], axis=1)
            level, c = np.linalg.lstsq(design, swings, rcond=None)[0]
        if level < 0:
            level, c = 0.0, float(swings @ shape / (shape @ shape))
        error = float(np.sum((swings - level - c * shape) ** 2))
        if error < best[0]:
            best = (error, float(level), float(ratio))
    return best


def _limit(swings: Float) -> tuple[float, float, str]:
    """Limit of the swings, ratio of their approach to it, and whether they last."""
    if len(swings) < _ENOUGH:
        return np.nan, np.nan, "undecided"
    # the first ones are too large to approach the limit geometrically
    swings = swings[len(swings) // 3 :] if len(swings) >= 3 * _ENOUGH else swings
    n = len(swings)
    error_0, _, ratio_0 = _decay(swings, False)
    error, limit, ratio = _decay(swings, True)
    # a limit above zero counts only if the swings ask for it: an F test of the third parameter
    floor = n * (1e-4 * float(np.mean(swings))) ** 2
    needed = (error_0 - error) * max(n - 3, 1) / max(error, floor) > _CLEAR
    if ratio_0**n > _LEVEL:
        return limit if needed else float(np.mean(swings)), ratio, "persistent"
    if not needed:
        return 0.0, ratio_0, "decaying"
    return limit, ratio, "persistent" if limit > _LASTING * swings[-1] else "decaying"


@dataclass
class _Found:
    """What oscillates in one series."""

    at: Float
    value: Float
    kind: Float
    period: float
    amplitude: float
    limit: float
    contraction: float
    chance: float
    verdict: str


def _find(t: Float, y: Float, prominence: float, noisy: bool) -> _Found:
    at, value, kind = extrema(t, y, prominence=prominence)
    finite = t[np.isfinite(y)]
    end = float(finite[-1]) if finite.size else np.nan
    swings = np.abs(np.diff(value))
    # the later half is nearer to the limit cycle; a period spans two swings
    late = slice(min(len(at) // 2, max(len(at) - 3, 0)), None)
    periods = at[late][2:] - at[late][:-2]
    limit, ratio, verdict = _limit(swings)
    if len(at) < 2:
        verdict = "none"
    elif end - at[-1] > 2.5 * float(np.median(np.diff(at))):
        verdict = "decaying"  # nothing has been seen for more than a period
    seen = np.isfinite(y)
    chance = chance_of_noise(t[seen], y[seen]) if noisy else np.nan
    if chance > _NOISE and verdict in ("persistent", "decaying"):
        verdict = "noise"
    return _Found(
        at=at,
        value=value,
        kind=kind.astype(float),
        period=float(np.mean(periods)) if periods.size else np.nan,
        amplitude=float(np.mean(swings[late])) / 2 if swings[late].size else np.nan,
        limit=limit / 2,
        contraction=ratio**2,
        chance=chance,
        verdict=verdict,
    )


_LONG_NAMES = {
    "extremum_time": "time of an extremum",
    "extremum_value": "value at an extremum",
    "extremum_kind": "+1 for a maximum, -1 for a minimum",
    "period": "period, mean over the later half",
    "amplitude": "amplitude (half of maximum less minimum), mean over the later half",
    "amplitude_limit": "amplitude to which the swings tend",
    "contraction": "factor by which the distance from that limit shrinks in a period",
    "chance": "probability that noise without a period has such a spectrum, NaN for a solver",
    "verdict": "persistent, decaying, noise, undecided (too few swings) or none",
}


def oscillations(
    ds: xr.Dataset,
    variable: str = "moment",
    *,
    order: float = 2.0,
    size: int = 1,
    start: float = 0.0,
    prominence: float = 0.02,
) -> xr.Dataset:
    """Period and amplitude of oscillations in every replica, and whether they last or are noise.

    Replicas drift out of phase, so each is analysed by itself; the mean over replicas would decay
    where none of them does.

    Parameters
    ----------
    ds : xarray.Dataset
        A result of simulate or solve, with about 20 or more output times to a period.
    variable : str
        What oscillates: ``moment`` (of `order`), ``n`` (of `size`), ``number_density``, ...
    order : float
        Order of the moment.
    size : int
        Cluster size.
    start : float
        Earlier times are left out.
    prominence : float
        See `extrema`.

    Returns
    -------
    xarray.Dataset
        ``extremum_time``, ``extremum_value``, ``extremum_kind`` (replica, extremum), NaN beyond the
        last; ``period``, ``amplitude``, ``amplitude_limit``, ``contraction``, ``chance`` and
        ``verdict`` (replica). The swings of a simulation are called noise if its spectrum is, by a
        chance above 0.001, that of noise without a period; see
        `smolux.analysis.periodicity.chance_of_noise`. Means over the replicas, with standard
        errors, are in the attributes.

    Raises
    ------
    InputError
        If there is no such variable, order or size.
    """
    curve = series(ds, variable, order=order, size=size)
    curve = curve.isel(time=curve["time"].values >= start)
    if curve.sizes["time"] < 5:
        raise InputError(f"start = {start!r}: fewer than 5 output times are left")
    noisy = not is_deterministic(ds)
    found = [_find(curve["time"].values, row, prominence, noisy) for row in curve.values]
    tables = np.full((3, len(found), max(len(f.at) for f in found)), np.nan)
    for r, f in enumerate(found):
        tables[:, r, : len(f.at)] = f.at, f.value, f.kind
    dims = ("replica", "extremum")
    data: dict[str, Any] = {
        "extremum_time": (dims, tables[0]),
        "extremum_value": (dims, tables[1]),
        "extremum_kind": (dims, tables[2]),
        "period": ("replica", [f.period for f in found]),
        "amplitude": ("replica", [f.amplitude for f in found]),
        "amplitude_limit": ("replica", [f.limit for f in found]),
        "contraction": ("replica", [f.contraction for f in found]),
        "chance": ("replica", [f.chance for f in found]),
        "verdict": ("replica", [f.verdict for f in found]),
    }
    result = xr.Dataset(data, {"replica": ds["replica"]})
    for name, text in _LONG_NAMES.items():
        result[name].attrs["long_name"] = text
    for name in ("period", "amplitude"):
        _, mean, error = over_replicas(result[name].values)
        result.attrs |= {name: float(mean), f"{name}_error": float(error)}
    result.attrs["variable"] = f"{variable}({order:g})" if variable == "moment" else variable
    return result
