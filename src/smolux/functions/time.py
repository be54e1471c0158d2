"""A number, a function of time or a formula in ``t``, with bounds over intervals of time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.errors import InputError

from .bounds import subdivided
from .intervals import Interval
from .law import Law
from .stated import Stated
from .user_function import numbers_of, spread

Float = NDArray[np.float64]

#: how closely a function that intervals do not follow is tried, see `.user_function.spread`
_SAMPLES = 128
_MARGIN = 0.1
#: a lower bound that is negative by no more than this share of the upper one is rounding
_ROUNDING = 1e-12
#: a function that reads more numbers than this holds tables rather than times
_TIMES = 64
_KINDS = 'a number, a function f(t) or a formula in t such as "0.01 * (1 - t/400)"'


@dataclass(frozen=True)
class TimeFunction(Law):
    """A rate that may depend on time; made by `TimeFunction.of`."""

    @classmethod
    def of(cls, value: Any, what: str = "the function of time") -> TimeFunction:
        """Make a function of time from a number, a callable or a formula.

        Parameters
        ----------
        value : float, callable, str, Stated or TimeFunction
            A number; a plain Python function ``f(t)``, whose further arguments have defaults; or a
            formula in ``t`` such as ``"0.01 * (1 - t/400)"``, see `smolux.functions.formula`;
            or a function with what is known of it, see `smolux.law`.
        what : str
            What it stands for, for messages.

        Raises
        ------
        InputError
            If it is none of these, or negative or not finite at ``t = 0``.
        """
        if isinstance(value, cls):
            return value
        if isinstance(value, (str, float, int)):
            return _remembered(value, what)
        if isinstance(value, Stated):
            read = cls.read(value.function, ("t",), what, _KINDS)
            new = replace(read, stated=value.bounds, breakpoints=value.breakpoints)
        else:
            new = cls.read(value, ("t",), what, _KINDS)
        new._check_start(what)
        return new

    def _check_start(self, what: str) -> None:
        where = f"{what} = {self.text}"
        try:
            start = self(0.0)
        except Exception as error:  # a user's function may raise anything
            raise InputError(
                f"{where}: raises {type(error).__name__} at t = 0: {error}; correct the function"
            ) from error
        if not (np.isfinite(start) and start >= 0):
            when = "" if self.constant is not None else " at t = 0"
            raise InputError(f"{where}: is {start:g}{when}; must be a finite number, zero or more")

    def __call__(self, t: ArrayLike) -> Any:
        """Evaluate at one time (a float) or at an array of times (an array)."""
        values = self.on(t)
        return values if np.ndim(t) else float(values)

    @property
    def edges(self) -> Float:
        """Times between which it is bounded by itself.

        Those that the user states, and those that a function names which is known by trial alone.
        """
        read = np.empty(0)
        if self.operands and not self.followed:
            read = np.concatenate([law.edges for law in self.operands])  # type: ignore[attr-defined]
        elif self.user is not None and self.stated is None and not self.followed:
            read = numbers_of(self.user.function)
            read = read if len(read) <= _TIMES else np.empty(0)
        return np.unique(np.concatenate([self.breakpoints, read]))

    def bounds(self, t0: ArrayLike, t1: ArrayLike) -> tuple[Any, Any]:
        """Bounds over the times ``t0 <= t <= t1``, numbers or arrays.

        By interval arithmetic for formulas, and for Python functions that it can follow; other
        functions are tried at many times, and a margin is added. A sum or product of which
        intervals follow only a part has those of both together.

        Returns
        -------
        lower, upper : float or ndarray
            Infinite if the function is not bounded. A function that turns negative has a negative
            lower bound.
        """
        sides = np.broadcast_arrays(np.asarray(t0, float), np.asarray(t1, float))
        if self.stated is not None:
            lower, upper = self.stated_bounds(*sides)
        elif self.followed:
            lower, upper = self._proved(*sides)
        elif self.operands:
            found = (Interval(*law.bounds(*sides)) for law in self.operands)  # type: ignore[attr-defined]
            both = self._of_both(*found)
            lower, upper = both.lo, both.hi
        else:
            lower, upper = self._sampled(*sides)
        return (lower, upper) if np.ndim(lower) else (float(lower), float(upper))

    def _proved(self, t0: Float, t1: Float) -> tuple[Float, Float]:
        if self.constant is not None:
            return np.full(t0.shape, self.constant), np.full(t0.shape, self.constant)
        zero = np.zeros(t0.shape)
        low, high = subdivided(
            lambda t, _: self.interval(t), t0, t1, zero, zero, 8, geometric=False, tolerance=0.01,
        )  # fmt: skip
        return np.where((-_ROUNDING * high <= low) & (low < 0), 0.0, low), high

    def _sampled(self, t0: Float, t1: Float) -> tuple[Float, Float]:
        times, window = _times(t0.ravel(), t1.ravel(), self.numbers)
        values = self(times)
        least, most = np.full(t0.size, np.inf), np.full(t0.size, -np.inf)
        np.minimum.at(least, window, values)
        np.maximum.at(most, window, values)
        low, high = least.reshape(t0.shape), most.reshape(t0.shape)
        margin = _MARGIN * (high - low)
        # A function that is not seen to be negative is not taken to be.
        return np.where(low >= 0, np.maximum(low - margin, 0.0), low - margin), high + margin


def _times(t0: Float, t1: Float, numbers: Float) -> tuple[Float, NDArray[np.int64]]:
    """Return times at which a function is tried over ranges of time, and the range of each.

    In no step with any period; both sides of what the function compares with, and what lies between
    two of these.
    """
    shares = spread(_SAMPLES)
    times = [(t0[:, None] + (t1 - t0)[:, None] * shares).ravel()]
    owners = [np.repeat(np.arange(len(t0)), len(shares))]
    for k, (low, high) in enumerate(zip(t0, t1, strict=True)):
        inside = numbers[(numbers >= low) & (numbers <= high)]
        ends = np.unique(np.concatenate([[low], inside, [high]]))
        between = 0.5 * (ends[1:] + ends[:-1])
        found = [inside, np.nextafter(inside, low), np.nextafter(inside, high), between]
        times += found
        owners.append(np.full(sum(map(len, found)), k))
    return np.concatenate(times), np.concatenate(owners)


@lru_cache(maxsize=256, typed=True)
def _remembered(value: str | float, what: str) -> TimeFunction:
    """Read a number or formula, which never change, once: processes are asked again and again."""
    new = TimeFunction.read(value, ("t",), what, _KINDS)
    new._check_start(what)
    return new
