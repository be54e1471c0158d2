"""A law given as a formula."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from smolux.callables import wrong_number
from smolux.errors import InputError
from smolux.formula import Formula, check_names, parse
from smolux.intervals import Interval

from .base import Float, Kernel
from .numeric import always_bounded, interval_bounds, sampled_bounds

_SIZES = ("i", "j")


@dataclass(frozen=True)
class FormulaKernel(Kernel):
    """A law given as a formula in i, j and its parameters; made by `formula`."""

    expression: Formula
    names: tuple[str, ...]
    values: tuple[float, ...]
    declared_degree: float | None = None
    declared_gels: bool | None = None
    name: ClassVar[str] = "formula"

    def __repr__(self) -> str:
        given = "".join(f", {n}={v!r}" for n, v in zip(self.names, self.values, strict=True))
        return f"formula({self.formula!r}{given})"

    @property
    def label(self) -> str:
        """See `Kernel.label`."""
        return repr(self.formula)

    @property
    def formula(self) -> str:  # type: ignore[override]
        """The formula as it was written."""
        return self.expression.text

    @property
    def rate(self) -> Callable[..., Any]:  # type: ignore[override]
        """See `Kernel.rate`; the same object for the same text and names."""
        return self.expression.function((*_SIZES, *self.names))

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
        """Whether interval arithmetic bounds the formula over all sizes."""
        return always_bounded(self._interval)

    def _interval(self, i: Interval, j: Interval) -> Interval:
        result = self.rate(i, j, *self.values)
        return result if isinstance(result, Interval) else Interval(float(result))

    def interval(self, i: Interval, j: Interval) -> Interval:
        """See `Kernel.interval`; by interval arithmetic."""
        return self._interval(i, j)

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        """See `Kernel.bounds`; by interval arithmetic, sampled where that finds none."""
        lower, upper = interval_bounds(self._interval, a, b, c, d)
        found = np.isfinite(upper)
        if not found.all():
            sampled = sampled_bounds(self, a, b, c, d)
            lower, upper = np.where(found, lower, sampled[0]), np.where(found, upper, sampled[1])
        return lower, upper

    def to_dict(self) -> dict[str, Any]:
        """See `Kernel.to_dict`."""
        stated = {"degree": self.degree, "gels": self.gels}
        return {
            "name": self.name,
            "formula": self.formula,
            **dict(zip(self.names, self.values, strict=True)),
            **{key: value for key, value in stated.items() if value is not None},
        }


def formula(
    text: str, /, *, degree: float | None = None, gels: bool | None = None, **parameters: float
) -> FormulaKernel:
    """Make a kernel of a formula in the sizes i and j.

    Parameters
    ----------
    text : str
        For example ``"(i/j)**a + (j/i)**a"``; see `smolux.formula` for the language.
    degree : float, optional
        Homogeneity degree.
    gels : bool, optional
        Whether aggregation alone gels.
    **parameters : float
        Values of the other names in the formula.

    Returns
    -------
    FormulaKernel

    Raises
    ------
    InputError
        With every problem found.

    Examples
    --------
    >>> float(formula("(i/j)**a + (j/i)**a", a=0.5)(1, 4))
    2.5
    """
    problems = check_names(list(parameters), _SIZES, "kernel")
    for name, value in parameters.items():
        problems += wrong_number(value, f"kernel: parameter {name!r}")
    problems += [] if degree is None else wrong_number(degree, "kernel: degree")
    if gels not in (None, True, False):
        problems.append(f"kernel: gels = {gels!r}: must be True, False or None")
    try:
        expression = parse(text, (*_SIZES, *parameters), "kernel formula")
        problems += [
            f"kernel formula = {text!r}: parameter {name!r} does not occur in it; leave it out"
            for name in parameters
            if name not in expression.names
        ]
    except InputError as error:
        problems += error.problems
    if problems:
        raise InputError(problems)
    values = tuple(float(value) for value in parameters.values())
    return FormulaKernel(expression, tuple(parameters), values, degree, gels)
