"""A number, a function of time or a formula in ``t``, with bounds over intervals of time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InputError

Float = NDArray[np.float64]


def _number(t: Any, value: Any) -> Any:
    return value


@dataclass(frozen=True)
class TimeFunction:
    """A rate that may depend on time; made by `TimeFunction.of`.

    Attributes
    ----------
    rate : callable
        ``rate(t, *parameters) -> float``: plain Python that Numba can compile.
    parameters : tuple of float
    text : str
        For case files and messages.
    constant : float or None
        The value if it does not depend on time.
    rigorous : bool
        Whether `bounds` is proved, or sampled.
    """

    rate: Callable[..., Any]
    parameters: tuple[float, ...]
    text: str
    constant: float | None
    rigorous: bool

    @classmethod
    def of(cls, value: Any, what: str = "the function of time") -> TimeFunction:
        """Make a function of time from a number, a callable or a formula.

        Parameters
        ----------
        value : float, callable or TimeFunction
        what : str
            What it stands for, for messages.
        """
        if isinstance(value, cls):
            return value
        if callable(value):
            new = cls(value, (), getattr(value, "__name__", repr(value)), None, False)
        elif isinstance(value, (int, float, np.number)) and not isinstance(value, bool):
            new = cls(_number, (float(value),), repr(float(value)), float(value), True)
        else:
            raise InputError(f"{what} = {value!r}: must be a number, a function f(t) or a formula")
        start = float(new(0.0))
        if not (np.isfinite(start) and start >= 0):
            raise InputError(
                f"{what} = {new.text}: is {start} at t = 0; must be a finite number, zero or more"
            )
        return new

    def __call__(self, t: ArrayLike) -> Any:
        """Evaluate at one time or at an array of times."""
        if np.ndim(t) == 0:
            return float(self.rate(float(t), *self.parameters))  # type: ignore[arg-type]
        return np.array([self.rate(x, *self.parameters) for x in np.ravel(t)], float).reshape(
            np.shape(t)
        )

    def bounds(self, t0: float, t1: float) -> tuple[float, float]:
        """Bounds over the times ``t0 <= t <= t1``."""
        if self.constant is not None:
            return self.constant, self.constant
        values = self(np.linspace(t0, t1, 257))
        low, high = float(values.min()), float(values.max())
        return low - 0.1 * (high - low), high + 0.1 * (high - low)
