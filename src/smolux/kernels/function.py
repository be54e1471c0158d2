"""A user's own law: a plain Python function of two sizes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

from numpy.typing import ArrayLike

from smolux.errors import InputError
from smolux.functions.law import Law
from smolux.functions.stated import StatedBounds, statements
from smolux.functions.user_function import Function, wrong_number

from .user_kernel import SIZES, OwnKernel


@dataclass(frozen=True)
class FunctionKernel(OwnKernel):
    """A law given by a Python function; made by `from_function`."""

    user: Function
    values: tuple[float, ...]
    declared_bounds: StatedBounds | None = None
    declared_degree: float | None = None
    declared_gels: bool | None = None
    breakpoints: tuple[float, ...] = ()
    name: ClassVar[str] = "function"

    def __repr__(self) -> str:
        return f"from_function({self.user.text}{self.given})"

    @cached_property
    def law(self) -> Law:
        """See `OwnKernel.law`."""
        return Law(
            self.user.text,
            SIZES,
            self.user.names,
            self.values,
            user=self.user,
            stated=self.declared_bounds,
            breakpoints=self.breakpoints,
        )

    @cached_property
    def takes_arrays(self) -> bool:
        """Whether the function may be called with arrays."""
        return self.user.takes_arrays(self.values)

    @property
    def function(self) -> Callable[..., Any]:
        """The Python function."""
        return self.user.function

    @property
    def formula(self) -> str:  # type: ignore[override]
        """The function and its arguments; its source text is in `describe`."""
        return f"{self.user.text}({', '.join((*SIZES, *self.user.names))})"

    @property
    def degree(self) -> float | None:
        """See `Kernel.degree`; as declared."""
        return self.declared_degree

    @property
    def gels(self) -> bool | None:
        """See `Kernel.gels`; as declared."""
        return self.declared_gels

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
    bounds: Any = None,
    breakpoints: ArrayLike = (),
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
    bounds : float, (float, float) or callable, optional
        The highest rate, the lowest and the highest one, or
        ``bounds(a, b, c, d, *parameters) -> (lower, upper)`` of the rate over ``a <= i <= b``,
        ``c <= j <= d``. Found by interval arithmetic if left out, where the function has no
        branches; else by trial. Unless they are found by intervals, every pair a method evaluates
        is checked against them.
    breakpoints : sequence of float, optional
        Sizes, or sums or differences of two sizes, at which the rate is not what it is beside
        them. Those that the function names are known without.
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
    wrong, stated, points = statements(bounds, breakpoints, "kernel")
    problems += wrong
    if gels not in (None, True, False):
        problems.append(f"kernel: gels = {gels!r}: must be True, False or None")
    values: tuple[float, ...] = ()
    try:
        values = user.values(parameters, "kernel")
    except InputError as error:
        problems += error.problems
    if problems:
        raise InputError(problems)
    return FunctionKernel(user, values, stated, degree, gels, points)
