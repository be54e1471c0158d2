"""Kernels by name, as in case files."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from typing import Any

from smolux.errors import InputError, Problem, about, did_you_mean

from .base import Kernel
from .formula_kernel import formula
from .sum import Sum
from .varying import varied


def _laws() -> tuple[type[Kernel], ...]:
    from smolux import kernels  # the registry is the package, which imports this module

    return kernels.KERNELS


def by_name(name: str) -> type[Kernel]:
    """Return the law of this name.

    Raises
    ------
    InputError
        If there is none.
    """
    laws = {law.name: law for law in _laws()}
    if name not in laws:
        raise InputError(f"kernel name = {name!r}: unknown{did_you_mean(str(name), list(laws))}")
    return laws[name]


def from_dict(table: Mapping[str, Any]) -> Kernel:
    """Make a kernel of plain data, as in a case file.

    Parameters
    ----------
    table : mapping
        ``name`` and the parameters of the law. ``name = "brownian.continuum"`` calls a constructor
        from physical quantities, in SI units; ``name = "formula"`` takes the text as ``formula``,
        ``name = "sum"`` a list of such tables as ``terms``, each of which may have a
        ``coefficient``. Each table may have ``varying``, a number or a formula in t.

    Returns
    -------
    Kernel

    Raises
    ------
    InputError
        With every problem found: an unknown name or parameter, a missing one, a wrong value.

    Examples
    --------
    >>> from_dict({"name": "bilinear", "A": 0.5, "B": 0.25})
    Bilinear(A=0.5, B=0.25, scale=1.0)
    """
    if not isinstance(table, Mapping) or not isinstance(table.get("name"), str):
        raise InputError(f"kernel = {table!r}: needs a name, such as {{'name': 'ballistic'}}")
    rest = {str(key): value for key, value in table.items() if key != "name"}
    if "varying" in rest:
        varying = rest.pop("varying")
        kernel = from_dict({"name": table["name"], **rest})
        with about("varying"):
            return varied(kernel, varying)
    name = table["name"]
    if name == "formula":
        text = rest.pop("formula", None)
        if text is None:
            raise InputError('kernel \'formula\': needs formula = "...", such as "(i + j)/2"')
        return formula(text, **rest)
    if name == Sum.name:
        return _sum(rest)
    make = _maker(name)
    accepted = inspect.signature(make).parameters
    problems: list[str] = [
        Problem.at(
            f"kernel {name!r}: unknown parameter {key!r}{did_you_mean(key, list(accepted))}", key
        )
        for key in rest
        if key not in accepted
    ]
    problems += [
        f"kernel {name!r}: parameter {key!r} is missing"
        for key, parameter in accepted.items()
        if parameter.default is parameter.empty and key not in rest
    ]
    if problems:
        raise InputError(problems)
    kernel = make(**rest)
    assert isinstance(kernel, Kernel)
    return kernel


def _sum(rest: dict[str, Any]) -> Sum:
    """Make a sum of its terms."""
    terms = rest.pop("terms", None)
    problems = [f"kernel 'sum': unknown key {key!r}; its terms are tables" for key in rest]
    if isinstance(terms, str) or not isinstance(terms, Sequence) or not terms:
        problems.append(
            f"kernel 'sum': terms = {terms!r}: must be a list of tables, each as of a kernel, with "
            "a coefficient or without"
        )
        raise InputError(problems)
    made, coefficients = [], []
    for n, term in enumerate(terms):
        table = dict(term) if isinstance(term, Mapping) else term
        coefficients.append(table.pop("coefficient", 1.0) if isinstance(table, dict) else 1.0)
        try:
            with about("terms", n):
                made.append(from_dict(table))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    return Sum(tuple(made), tuple(coefficients))


def _maker(name: str) -> Any:
    """Return the class, or the constructor after a point."""
    law, _, constructor = name.partition(".")
    known = [law.name for law in _laws()] + ["formula", Sum.name]
    known += [f"{law.name}.{each}" for law in _laws() for each in law.constructors]
    if name not in known:
        raise InputError(f"kernel name = {name!r}: unknown{did_you_mean(name, known)}")
    return getattr(by_name(law), constructor) if constructor else by_name(law)
