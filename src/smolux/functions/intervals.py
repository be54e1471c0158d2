"""Interval arithmetic on arrays, and bounds of functions over boxes by branch and bound.

An interval holds every value that an expression takes where it is defined: results are rounded
outwards, by one unit in the last place for arithmetic and by `_ELEMENTARY` for elementary
functions, which NumPy computes to a few units only.

References
----------
R. E. Moore, R. B. Kearfott and M. J. Cloud, Introduction to Interval Analysis (SIAM, 2009),
doi:10.1137/1.9780898717716.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[np.float64]

#: relative error allowed for elementary functions
_ELEMENTARY = 2e-15
#: angles beyond this are too coarse for sine and cosine to be followed
_LARGEST_ANGLE = 1e6


class UndecidedError(TypeError):
    """A comparison of intervals: the answer may differ within them."""


def _positive(x: Float) -> bool:
    """Whether all numbers are above zero and finite."""
    return x.size > 0 and bool(x.min() > 0.0 and x.max() < np.inf)


def _below(x: Float) -> Float:
    """Return the numbers just below; of positive ones by counting, as NumPy takes long."""
    if _positive(x):
        return (x.view(np.int64) - 1).view(np.float64)
    return np.nextafter(x, -np.inf)


def _above(x: Float) -> Float:
    """Return the numbers just above."""
    if _positive(x):
        return (x.view(np.int64) + 1).view(np.float64)
    return np.nextafter(x, np.inf)


def _down(x: Float) -> Float:
    # A sum or difference that is zero is exact, and so is a product by zero.
    return _below(x) if _positive(x) else np.where(x == 0, x, np.nextafter(x, -np.inf))


def _up(x: Float) -> Float:
    return _above(x) if _positive(x) else np.where(x == 0, x, np.nextafter(x, np.inf))


class Interval:
    """Closed intervals ``lo <= x <= hi``, an array of them.

    Operators and the NumPy functions of `UFUNCS` work as on arrays; a comparison raises
    `UndecidedError`. Where a function is defined on a part of an interval only, the result bounds
    its values there; where it is defined nowhere, the result is unbounded.

    Parameters
    ----------
    lo, hi : array_like
        The ends; `hi` is `lo` if left out.
    """

    __slots__ = ("hi", "lo")
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, lo: ArrayLike, hi: ArrayLike | None = None) -> None:
        self.lo: Float = np.asarray(lo, float)
        self.hi: Float = self.lo if hi is None else np.asarray(hi, float)

    def __repr__(self) -> str:
        return f"Interval({self.lo}, {self.hi})"

    def _undecided(self, other: object = None) -> NoReturn:
        raise UndecidedError("intervals cannot be compared")

    __lt__ = __le__ = __gt__ = __ge__ = __bool__ = _undecided
    __eq__ = __ne__ = _undecided

    def __neg__(self) -> Interval:
        return Interval(-self.hi, -self.lo)

    def __pos__(self) -> Interval:
        return self

    def __abs__(self) -> Interval:
        inside = (self.lo <= 0) & (self.hi >= 0)
        low, high = np.abs(self.lo), np.abs(self.hi)
        return Interval(np.where(inside, 0.0, np.minimum(low, high)), np.maximum(low, high))

    def __add__(self, other: Any) -> Any:
        o = _as_interval(other)
        if o is None:
            return NotImplemented
        with np.errstate(all="ignore"):
            return _known(_down(self.lo + o.lo), _up(self.hi + o.hi))

    def __sub__(self, other: Any) -> Any:
        o = _as_interval(other)
        return NotImplemented if o is None else self + -o

    def __rsub__(self, other: Any) -> Any:
        return -self + other

    def __mul__(self, other: Any) -> Any:
        o = _as_interval(other)
        if o is None:
            return NotImplemented
        if _positive(self.lo) and _positive(o.lo):
            with np.errstate(all="ignore"):
                lo, hi = self.lo * o.lo, self.hi * o.hi
                return Interval(np.maximum(_below(lo), 0.0), _above(hi))
        with np.errstate(all="ignore"):
            ends = [x * y for x in (self.lo, self.hi) for y in (o.lo, o.hi)]
            # An infinite end is not attained, so zero times infinity is zero.
            ends = [np.where(np.isnan(e), 0.0, e) for e in ends]
            lo = np.minimum(np.minimum(ends[0], ends[1]), np.minimum(ends[2], ends[3]))
            hi = np.maximum(np.maximum(ends[0], ends[1]), np.maximum(ends[2], ends[3]))
            # Zero may be an underflow, but not past zero if the signs are known.
            positive = ((self.lo >= 0) & (o.lo >= 0)) | ((self.hi <= 0) & (o.hi <= 0))
            negative = ((self.lo >= 0) & (o.hi <= 0)) | ((self.hi <= 0) & (o.lo >= 0))
            lo, hi = np.nextafter(lo, -np.inf), np.nextafter(hi, np.inf)
        zero = ((self.lo == 0) & (self.hi == 0)) | ((o.lo == 0) & (o.hi == 0))
        return Interval(
            np.where(positive, np.maximum(lo, 0.0), np.where(zero, 0.0, lo)),
            np.where(negative, np.minimum(hi, 0.0), np.where(zero, 0.0, hi)),
        )

    def __truediv__(self, other: Any) -> Any:
        o = _as_interval(other)
        return NotImplemented if o is None else self * _reciprocal(o)

    def __rtruediv__(self, other: Any) -> Any:
        return _reciprocal(self) * other

    def __pow__(self, other: Any) -> Any:
        if isinstance(other, (int, float, np.number)) and float(other).is_integer():
            return _integer_power(self, int(other))
        o = _as_interval(other)
        if o is None:
            return NotImplemented
        # For a base that is not negative, monotone in either argument: the corners tell.
        base = (np.maximum(self.lo, 0.0), np.where(self.hi < 0, np.nan, self.hi))
        exponents = (o.lo,) if o.hi is o.lo else (o.lo, o.hi)
        with np.errstate(all="ignore"):
            ends = [np.power(x, y) for x in base for y in exponents]
        lo, hi = reduce(np.minimum, ends), reduce(np.maximum, ends)
        return _with_negative_base(self, o, _wider(lo, hi, least=0.0))

    def __rpow__(self, other: Any) -> Any:
        return Interval(other) ** self

    __radd__ = __add__
    __rmul__ = __mul__

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **kwargs: Any) -> Any:
        if method != "__call__" or kwargs or ufunc not in UFUNCS:
            return NotImplemented
        return UFUNCS[ufunc](*inputs)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        return interpolated(*args, **kwargs) if function is np.interp else NotImplemented


def _as_interval(value: Any) -> Interval | None:
    if isinstance(value, Interval):
        return value
    if isinstance(value, (int, float, np.number)):
        return Interval(float(value))
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiu":
        return Interval(value)
    return None


def _known(lo: Float, hi: Float) -> Interval:
    """Replace what is not a number by no bound."""
    return Interval(np.where(np.isnan(lo), -np.inf, lo), np.where(np.isnan(hi), np.inf, hi))


def _wider(lo: Float, hi: Float, least: float = -np.inf, most: float = np.inf) -> Interval:
    """Round an elementary function outwards, not beyond its range."""
    with np.errstate(all="ignore"):
        lo = np.where(np.isfinite(lo), lo - _ELEMENTARY * np.abs(lo), lo)
        hi = np.where(np.isfinite(hi), hi + _ELEMENTARY * np.abs(hi), hi)
    lo, hi = np.nextafter(lo, -np.inf), np.nextafter(hi, np.inf)
    return _known(np.maximum(lo, least), np.minimum(hi, most))


def _reciprocal(x: Interval) -> Interval:
    if _positive(x.lo):
        with np.errstate(all="ignore"):
            return Interval(np.maximum(_below(1.0 / x.hi), 0.0), _above(1.0 / x.lo))
    with np.errstate(all="ignore"):
        lo = np.where(x.hi == 0, -np.inf, np.nextafter(1.0 / x.hi, -np.inf))
        hi = np.where(x.lo == 0, np.inf, np.nextafter(1.0 / x.lo, np.inf))
    lo = np.where((x.lo >= 0) & (x.hi > 0), np.maximum(lo, 0.0), lo)
    hi = np.where((x.hi <= 0) & (x.lo < 0), np.minimum(hi, 0.0), hi)
    across = ((x.lo < 0) & (x.hi > 0)) | ((x.lo == 0) & (x.hi == 0))
    return _known(np.where(across, -np.inf, lo), np.where(across, np.inf, hi))


def _integer_power(x: Interval, n: int) -> Interval:
    if n < 0:
        return _reciprocal(_integer_power(x, -n))
    if n == 0:
        return Interval(np.ones_like(x.lo))
    if n == 1:
        return x
    if n % 2 == 0:
        x = abs(x)
    with np.errstate(all="ignore"):
        lo, hi = np.power(x.lo, float(n)), np.power(x.hi, float(n))
    wide = _wider(lo, hi)
    return Interval(np.where(x.lo >= 0, np.maximum(wide.lo, 0.0), wide.lo), wide.hi)


def _with_negative_base(x: Interval, y: Interval, found: Interval) -> Interval:
    """Add to a power what it is below zero: there it is defined for whole exponents only."""
    negative = (x.lo < 0) & (np.floor(y.hi) >= np.ceil(y.lo))
    if not negative.any():
        return found
    # as large as a power of the absolute value, of either sign; far more is not needed
    size = Interval(np.where(negative, np.maximum(-x.hi, 0.0), 1.0), np.where(negative, -x.lo, 1.0))
    most = (size**y).hi
    alone = x.hi < 0  # else `found` bounds what it is from zero on
    lo = np.where(alone, -most, np.minimum(found.lo, -most))
    hi = np.where(alone, most, np.maximum(found.hi, most))
    return Interval(np.where(negative, lo, found.lo), np.where(negative, hi, found.hi))


def _increasing(
    ufunc: Any, domain: float = -np.inf, least: float = -np.inf, most: float = np.inf
) -> Callable[[Interval], Interval]:
    """Extend an increasing function, defined from `domain` on, with values of the given range."""

    def extended(x: Interval) -> Interval:
        with np.errstate(all="ignore"):
            lo, hi = ufunc(np.maximum(x.lo, domain)), ufunc(x.hi)
        nowhere = x.hi < domain
        wide = _wider(lo, hi, least, most)
        return Interval(np.where(nowhere, -np.inf, wide.lo), np.where(nowhere, np.inf, wide.hi))

    return extended


def _cosine(x: Interval) -> Interval:
    with np.errstate(all="ignore"):
        lo, hi = np.cos(x.lo), np.cos(x.hi)
        # Crests lie at 2 pi k, troughs at pi + 2 pi k; a margin covers the rounding of pi.
        first, last = (x.lo - 1e-9) / (2 * np.pi), (x.hi + 1e-9) / (2 * np.pi)
        crest = np.floor(last) >= np.ceil(first)
        trough = np.floor(last - 0.5) >= np.ceil(first - 0.5)
        coarse = ~(np.maximum(np.abs(x.lo), np.abs(x.hi)) < _LARGEST_ANGLE)
    low = np.where(trough | coarse, -1.0, np.minimum(lo, hi))
    high = np.where(crest | coarse, 1.0, np.maximum(lo, hi))
    # The rounding of pi / 2 in the sine is absolute.
    return _wider(low - 4e-16, high + 4e-16, -1.0, 1.0)


def _sine(x: Interval) -> Interval:
    return _cosine(x - np.pi / 2)


def _minimum(x: Any, y: Any) -> Interval:
    x, y = _operands(x, y)
    return Interval(np.minimum(x.lo, y.lo), np.minimum(x.hi, y.hi))


def _maximum(x: Any, y: Any) -> Interval:
    x, y = _operands(x, y)
    return Interval(np.maximum(x.lo, y.lo), np.maximum(x.hi, y.hi))


def _operands(x: Any, y: Any) -> tuple[Interval, Interval]:
    first, second = _as_interval(x), _as_interval(y)
    if first is None or second is None:
        raise TypeError(f"no interval can be made of {y if second is None else x!r}")
    return first, second


def range_of(
    values: Float, first: NDArray[np.int64], last: NDArray[np.int64]
) -> tuple[Float, Float]:
    """Least and largest of ``values[first:last]`` for many ranges; of an empty one, some value."""
    if not first.size:
        return np.empty(first.shape), np.empty(first.shape)
    padded = np.append(values, values[-1])  # so that the end of a range is a place, too
    places = np.stack([first.ravel(), last.ravel()], axis=1).ravel()
    least = np.minimum.reduceat(padded, places)[::2]
    most = np.maximum.reduceat(padded, places)[::2]
    return least.reshape(first.shape), most.reshape(first.shape)


def interpolated(
    x: Any, xp: ArrayLike, fp: ArrayLike, left: Any = None, right: Any = None
) -> Interval:
    """Range of ``np.interp``: the values at both ends and at the points of the table between."""
    if not isinstance(x, Interval):
        raise TypeError("not followed: a table of intervals")
    points, values = np.asarray(xp, float), np.asarray(fp, float)
    with np.errstate(all="ignore"):
        ends = [np.interp(end, points, values, left, right) for end in (x.lo, x.hi)]
    first = np.asarray(np.searchsorted(points, x.lo))
    last = np.asarray(np.searchsorted(points, x.hi, side="right"))
    least, most = range_of(values, first, last)
    low, high = np.minimum(*ends), np.maximum(*ends)
    low = np.where(last > first, np.minimum(low, least), low)
    high = np.where(last > first, np.maximum(high, most), high)
    # compiled code rounds the slopes in its own way
    scale = np.max(np.abs(values), initial=0.0) * _ELEMENTARY
    wide = _known(low - scale, high + scale)
    positive = min(np.min(values), 0.0 if left is None else left, 0.0 if right is None else right)
    return Interval(np.maximum(wide.lo, 0.0) if positive >= 0.0 else wide.lo, wide.hi)


#: the NumPy functions that intervals follow
UFUNCS: dict[Any, Callable[..., Any]] = {
    np.add: lambda x, y: _operands(x, y)[0] + y,
    np.subtract: lambda x, y: _operands(x, y)[0] - y,
    np.multiply: lambda x, y: _operands(x, y)[0] * y,
    np.true_divide: lambda x, y: _operands(x, y)[0] / y,
    np.power: lambda x, y: _operands(x, y)[0] ** y,
    np.float_power: lambda x, y: _operands(x, y)[0] ** y,
    np.minimum: _minimum,
    np.maximum: _maximum,
    np.fmin: _minimum,
    np.fmax: _maximum,
    np.absolute: abs,
    np.fabs: abs,
    np.negative: lambda x: -x,
    np.positive: lambda x: x,
    np.square: lambda x: x**2,
    np.reciprocal: lambda x: 1.0 / x,
    np.sqrt: _increasing(np.sqrt, domain=0.0, least=0.0),
    np.cbrt: _increasing(np.cbrt),
    np.exp: _increasing(np.exp, least=0.0),
    np.expm1: _increasing(np.expm1, least=-1.0),
    np.log: _increasing(np.log, domain=0.0),
    np.log2: _increasing(np.log2, domain=0.0),
    np.log10: _increasing(np.log10, domain=0.0),
    np.log1p: _increasing(np.log1p, domain=-1.0),
    np.tanh: _increasing(np.tanh, least=-1.0, most=1.0),
    np.arctan: _increasing(np.arctan, least=-np.pi / 2 - 1e-15, most=np.pi / 2 + 1e-15),
    np.sin: _sine,
    np.cos: _cosine,
}
