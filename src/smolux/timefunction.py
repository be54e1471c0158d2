"""A number, a function of time or a formula in ``t``, with bounds over intervals of time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .boxes import subdivided
from .callables import Function, numbers_of, spread
from .checks import is_number
from .errors import InputError
from .formula import Formula, parse
from .intervals import Interval

Float = NDArray[np.float64]

#: how closely a function that intervals do not follow is tried, see `smolux.callables.spread`
_SAMPLES = 128
_MARGIN = 0.1
#: a lower bound that is negative by no more than this share of the upper one is rounding
_ROUNDING = 1e-12


def _number(t: Any, value: Any) -> Any:
    return value


@dataclass(frozen=True)
class TimeFunction:
    """A rate that may depend on time; made by `TimeFunction.of`.

    Attributes
    ----------
    text : str
        For case files and messages: the number, the formula, or the name of the function.
    parameters : tuple of float
        What `rate` takes after the time.
    constant : float or None
        The value, if it does not depend on time.
    formula : Formula or None
    user : smolux.callables.Function or None
        At most one of the three is given.
    """

    text: str
    parameters: tuple[float, ...] = ()
    constant: float | None = None
    formula: Formula | None = None
    user: Function | None = None

    @classmethod
    def of(cls, value: Any, what: str = "the function of time") -> TimeFunction:
        """Make a function of time from a number, a callable or a formula.

        Parameters
        ----------
        value : float, callable, str or TimeFunction
            A number; a plain Python function ``f(t)``, whose further arguments have defaults; or a
            formula in ``t`` such as ``"0.01 * (1 - t/400)"``, see `smolux.formula`.
        what : str
            What it stands for, for messages.

        Raises
        ------
        InputError
            If it is none of these, or negative or not finite at ``t = 0``.
        """
        if isinstance(value, cls):
            return value
        if isinstance(value, str):
            expression = parse(value, ("t",), what)
            if expression.names:
                new = cls(value, formula=expression)
            else:
                number = float(expression.evaluate())
                new = cls(value, (number,), number)
        elif is_number(value):
            new = cls(repr(float(value)), (float(value),), float(value))
        elif callable(value):
            user = Function.of(value, ("t",), what)
            new = cls(user.text, user.defaults, user=user)
        else:
            raise InputError(
                f"{what} = {value!r}: must be a number, a function f(t) or a formula in t "
                'such as "0.01 * (1 - t/400)"'
            )
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

    @property
    def rate(self) -> Callable[..., Any]:
        """``rate(t, *parameters) -> float``: plain Python that Numba compiles.

        The same object for equal functions.
        """
        if self.formula is not None:
            return self.formula.function(("t",))
        return _number if self.user is None else self.user.function

    @property
    def rigorous(self) -> bool:
        """Whether `bounds` is proved: for numbers and formulas."""
        return self.user is None

    def __call__(self, t: ArrayLike) -> Any:
        """Evaluate at one time (a float) or at an array of times (an array)."""
        if self.user is not None:
            values = self.user.evaluate((t,), self.parameters)
        elif self.formula is not None:
            values = self.formula.evaluate(t=t)
        else:
            values = np.full(np.shape(t), self.constant)
        return values if np.ndim(t) else float(values)

    def bounds(self, t0: float, t1: float) -> tuple[float, float]:
        """Bounds over the times ``t0 <= t <= t1``.

        By interval arithmetic for formulas, and for Python functions that it can follow; other
        functions are sampled, and a margin is added.

        Returns
        -------
        lower, upper : float
            Infinite if the function is not bounded. A function that turns negative has a negative
            lower bound.
        """
        if self.constant is not None:
            return self.constant, self.constant
        try:
            found = subdivided(self._interval, t0, t1, 0.0, 0.0, 8, geometric=False, tolerance=0.01)
        except TypeError:
            return self._sampled(t0, t1)
        low, high = float(found[0]), float(found[1])
        return (0.0 if -_ROUNDING * high <= low < 0 else low), high

    def _interval(self, t: Interval, _: Interval) -> Interval:
        if self.user is not None:
            return self.user.interval((t,), self.parameters)
        assert self.formula is not None
        return self.formula.interval(t=t)

    def _sampled(self, t0: float, t1: float) -> tuple[float, float]:
        assert self.user is not None
        shares = spread(_SAMPLES)
        numbers = numbers_of(self.user.function)
        inside = numbers[(numbers >= t0) & (numbers <= t1)]
        # Both sides of what the function compares with, and what lies between two of these.
        edges = np.concatenate([inside, np.nextafter(inside, t0), np.nextafter(inside, t1)])
        ends = np.unique(np.concatenate([[t0], inside, [t1]]))
        between = 0.5 * (ends[1:] + ends[:-1])
        values = self(np.concatenate([t0 + (t1 - t0) * shares, edges, between]))
        low, high = float(values.min()), float(values.max())
        margin = _MARGIN * (high - low)
        # A function that is not seen to be negative is not taken to be.
        return (max(low - margin, 0.0) if low >= 0 else low - margin), high + margin
