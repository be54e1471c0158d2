"""A kernel times a function of time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from smolux.errors import InputError
from smolux.functions.intervals import Interval
from smolux.functions.time import TimeFunction

from .base import Float, Kernel
from .composite import MadeOfKernels
from .majorant import Majorant

ONE = TimeFunction.of(1.0)


@dataclass(frozen=True)
class Varying(MadeOfKernels):
    """``K(i, j) f(t)``; made by ``kernel * "1 + t"``.

    As a law of two sizes it is K, where f is one: that is what pairs are drawn by. Whatever follows
    time looks at `in_time`.
    """

    kernel: Kernel
    factor: TimeFunction

    @property
    def name(self) -> str:  # type: ignore[override]
        """See `Kernel.name`; in a case file the factor is a key beside the others."""
        return self.kernel.name

    @property
    def made_of(self) -> tuple[Kernel, ...]:
        return (self.kernel,)

    @property
    def in_time(self) -> tuple[tuple[TimeFunction, Kernel], ...]:
        return ((self.factor, self.kernel),)

    def __repr__(self) -> str:
        return f"{self.kernel!r} * {self.factor.text!r}"

    @property
    def label(self) -> str:
        return f"{self.kernel.label} times {self.factor.text}"

    @property
    def formula(self) -> str:  # type: ignore[override]
        """The formula of the kernel, times the function of time."""
        return f"({self.factor.text}) * ({self.kernel.formula})"

    @property
    def rate(self) -> Callable[..., Any]:  # type: ignore[override]
        """See `Kernel.rate`."""
        return self.kernel.rate

    @property
    def parameters(self) -> tuple[float, ...]:
        return self.kernel.parameters

    @property
    def cheap(self) -> bool:  # type: ignore[override]
        """See `Kernel.cheap`."""
        return self.kernel.cheap

    @property
    def degree(self) -> float | None:
        return self.kernel.degree

    @property
    def gels(self) -> bool | None:
        """See `Kernel.gels`; the factor may become zero before, but makes no gel."""
        return False if self.kernel.gels is False else None

    def __call__(self, i: ArrayLike, j: ArrayLike) -> Float:
        """See `Kernel.__call__`; where the factor is one."""
        return self.kernel(i, j)

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        return self.kernel.bounds(a, b, c, d)

    def interval(self, i: Interval, j: Interval) -> Interval:
        return self.kernel.interval(i, j)

    def majorant(self) -> Majorant | None:
        return self.kernel.majorant()

    def to_dict(self) -> dict[str, Any]:
        """See `Kernel.to_dict`: that of the kernel, and the factor as ``varying``."""
        if self.factor.functions:
            raise InputError(
                f"kernel {self.label}: {self.factor.text} is a Python function, which no file holds"
            )
        return {**self.kernel.to_dict(), "varying": self.factor.text}

    def describe(self) -> dict[str, Any]:
        return {**self.kernel.describe(), "formula": self.formula, "varying": self.factor.text}


def varied(kernel: Kernel, given: Any) -> Kernel:
    """Return a kernel times a function of time, a formula in ``t`` or a number.

    Raises
    ------
    InputError
        If it is none of these, or negative or not finite at ``t = 0``.
    """
    from .sum import Sum

    law = TimeFunction.of(given, "varying")
    if law.constant is not None:
        return law.constant * kernel
    terms = []
    for _, part in kernel.parts:
        ((before, plain),) = part.in_time or ((ONE, part),)
        terms.append(Varying(plain, before * law))
    if isinstance(kernel, Sum):
        return Sum(tuple(terms), kernel.coefficients)
    return terms[0]
