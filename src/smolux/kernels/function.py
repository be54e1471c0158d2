"""A user's own law: a plain Python function of two sizes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from smolux.callables import Function, numbers_of, wrong_number
from smolux.errors import InputError
from smolux.intervals import Interval

from .base import Float, Kernel
from .numeric import NUMBERS, always_bounded, interval_bounds, sampled_bounds


@dataclass(frozen=True)
class FunctionKernel(Kernel):
    """A law given by a Python function; made by `from_function`."""

    user: Function
    values: tuple[float, ...]
    declared_bounds: Callable[..., Any] | None = None
    declared_degree: float | None = None
    declared_gels: bool | None = None
    name: ClassVar[str] = "function"

    def __repr__(self) -> str:
        given = ", ".join(f"{n}={v!r}" for n, v in zip(self.user.names, self.values, strict=True))
        return f"from_function({self.user.text}{', ' if given else ''}{given})"

    @property
    def label(self) -> str:
        """See `Kernel.label`."""
        return repr(self.user.text)

    @property
    def function(self) -> Callable[..., Any]:
        """The Python function."""
        return self.user.function

    @property
    def rate(self) -> Callable[..., Any]:  # type: ignore[override]
        """See `Kernel.rate`."""
        return self.user.function

    @property
    def formula(self) -> str:  # type: ignore[override]
        """The function and its arguments; its source text is in `describe`."""
        return f"{self.user.text}({', '.join(('i', 'j', *self.user.names))})"

    @property
    def parameters(self) -> tuple[float, ...]:
        """See `Kernel.parameters`."""
        return self.values

    @property
    def degree(self) -> float | None:
        """See `Kernel.degree`; as declared."""
        return self.declared_degree

    @property
    def gels(self) -> bool | None:
        """See `Kernel.gels`; as declared."""
        return self.declared_gels

    @cached_property
    def rigorous(self) -> bool:  # type: ignore[override]
        """Whether `bounds` is proved, by intervals; what is declared is checked at every pair."""
        return self.declared_bounds is None and always_bounded(self._interval)

    @cached_property
    def _follows(self) -> bool:
        """Whether intervals follow the function at all."""
        try:
            self._interval(Interval(1.0, 2.0), Interval(1.0, 2.0))
        except TypeError:
            return False
        return True

    def _interval(self, i: Interval, j: Interval) -> Interval:
        return self.user.interval((i, j), self.values)

    def interval(self, i: Interval, j: Interval) -> Interval:
        """See `Kernel.interval`; as `bounds`, but never sampled."""
        if self.declared_bounds is not None:
            return Interval(*self._declared(self.declared_bounds, i.lo, i.hi, j.lo, j.hi))
        return self._interval(i, j)

    def __call__(self, i: ArrayLike, j: ArrayLike) -> Float:
        """See `Kernel.__call__`."""
        return self.user.evaluate((i, j), self.values)

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        """See `Kernel.bounds`; declared, by interval arithmetic, or sampled, in this order."""
        if self.declared_bounds is not None:
            return self._declared(self.declared_bounds, a, b, c, d)
        if not self._follows:
            return self._sampled(a, b, c, d)
        lower, upper = interval_bounds(self._interval, a, b, c, d)
        found = np.isfinite(upper)
        if not found.all():
            sampled = self._sampled(a, b, c, d)
            lower, upper = np.where(found, lower, sampled[0]), np.where(found, upper, sampled[1])
        return lower, upper

    @property
    def singled_out(self) -> Float:
        """See `Kernel.singled_out`; of the first numbers in the function."""
        numbers = numbers_of(self.user.function)
        whole = np.unique(np.rint(numbers[(numbers >= 1) & (numbers < 2.0**20)]))
        return whole[:NUMBERS]

    def _sampled(
        self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike
    ) -> tuple[Float, Float]:
        return sampled_bounds(self, a, b, c, d, numbers_of(self.user.function))

    def _declared(self, bounds: Callable[..., Any], *box: ArrayLike) -> tuple[Float, Float]:
        sides = np.broadcast_arrays(*(np.asarray(x, float) for x in box))
        found = [
            bounds(*(float(x) for x in edges), *self.values)
            for edges in zip(*(side.ravel() for side in sides), strict=True)
        ]
        lower, upper = np.array(found, float).reshape(-1, 2).T
        return lower.reshape(sides[0].shape), upper.reshape(sides[0].shape)

    def to_dict(self) -> dict[str, Any]:
        """Raise `InputError`: a file cannot bring a Python function back."""
        raise InputError(
            f"kernel {self.user.text!r} is a Python function, which no case file holds; "
            "write it as smolux.kernels.formula(...), or name the function in the case file"
        )

    def describe(self) -> dict[str, Any]:
        """See `Kernel.describe`; with the source text, if there is any."""
        return {
            "name": self.name,
            "function": self.user.text,
            **dict(zip(self.user.names, self.values, strict=True)),
            "formula": self.formula,
            "degree": self.degree,
            "gels": self.gels,
            "source": self.user.source,
        }


def from_function(
    K: Callable[..., Any],
    *,
    bounds: Callable[..., Any] | None = None,
    degree: float | None = None,
    gels: bool | None = None,
    **parameters: float,
) -> FunctionKernel:
    """Make a kernel of a Python function ``K(i, j)``.

    It is compiled by Numba, so it may use arithmetic, ``math``, ``numpy`` and branches.

    Parameters
    ----------
    K : callable
        Takes two sizes, as floats, and returns the rate; symmetric and never negative. Further
        arguments with defaults are its parameters: ``def K(i, j, a=1.0)``.
    bounds : callable, optional
        ``bounds(a, b, c, d, *parameters) -> (lower, upper)`` of the rate over ``a <= i <= b``,
        ``c <= j <= d``. Found by interval arithmetic if left out, where the function has no
        branches; else by trial. Unless they are found by intervals, every pair a method evaluates
        is checked against them.
    degree : float, optional
        Homogeneity degree.
    gels : bool, optional
        Whether aggregation alone gels.
    **parameters : float
        Values in place of the defaults of K.

    Returns
    -------
    FunctionKernel

    Raises
    ------
    InputError
        If K is no such function, or a parameter is unknown or no number.

    Examples
    --------
    >>> def K(i, j, a=1.0):
    ...     return (i * j) ** a
    >>> from_function(K, a=0.5)
    from_function(K, a=0.5)
    """
    user = Function.of(K, ("i", "j"), "kernel")
    problems = [] if degree is None else wrong_number(degree, "kernel: degree")
    if bounds is not None and not callable(bounds):
        problems.append(f"kernel: bounds = {bounds!r}: must be a function bounds(a, b, c, d)")
    if gels not in (None, True, False):
        problems.append(f"kernel: gels = {gels!r}: must be True, False or None")
    values: tuple[float, ...] = ()
    try:
        values = user.values(parameters, "kernel")
    except InputError as error:
        problems += error.problems
    if problems:
        raise InputError(problems)
    return FunctionKernel(user, values, bounds, degree, gels)
