"""A law given as a formula."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

from smolux.errors import InputError, Problem, about
from smolux.functions.formula import Formula, check_names, parse
from smolux.functions.law import Law
from smolux.functions.user_function import wrong_number

from .user_kernel import SIZES, OwnKernel

#: words with a meaning in the table of a kernel
_KEYS = ("name", "formula", "terms", "coefficient", "varying")


@dataclass(frozen=True)
class FormulaKernel(OwnKernel):
    """A law given as a formula in i, j and its parameters; made by `formula`."""

    expression: Formula
    names: tuple[str, ...]
    values: tuple[float, ...]
    declared_degree: float | None = None
    declared_gels: bool | None = None
    name: ClassVar[str] = "formula"

    def __repr__(self) -> str:
        return f"formula({self.formula!r}{self.given})"

    @cached_property
    def law(self) -> Law:
        """See `OwnKernel.law`."""
        return Law(self.expression.text, SIZES, self.names, self.values, formula=self.expression)

    @property
    def formula(self) -> str:  # type: ignore[override]
        """The formula as it was written."""
        return self.expression.text

    @property
    def degree(self) -> float | None:
        """See `Kernel.degree`; as declared."""
        return self.declared_degree

    @property
    def gels(self) -> bool | None:
        """See `Kernel.gels`; as declared."""
        return self.declared_gels

    def to_dict(self) -> dict[str, Any]:
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
        For example ``"(i/j)**a + (j/i)**a"``; see `smolux.functions.formula` for the language.
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
    problems = check_names(list(parameters), (*SIZES, *_KEYS), "kernel")
    for name, value in parameters.items():
        wrong = wrong_number(value, f"kernel: parameter {name!r}")
        problems += [Problem.at(text, name) for text in wrong]
    problems += [] if degree is None else wrong_number(degree, "kernel: degree")
    if gels not in (None, True, False):
        problems.append(f"kernel: gels = {gels!r}: must be True, False or None")
    try:
        with about("formula"):
            expression = parse(text, (*SIZES, *parameters), "kernel formula")
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
