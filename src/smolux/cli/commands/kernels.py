"""``smolux kernels``: what laws there are, and what is known of each."""

from __future__ import annotations

import inspect
from dataclasses import MISSING, fields
from typing import Annotated

import typer

from smolux.cli import console
from smolux.errors import InputError, did_you_mean
from smolux.kernels import KERNELS
from smolux.kernels.base import Kernel
from smolux.units import of_arguments


def example(law: type[Kernel]) -> Kernel:
    """Make a kernel with its defaults, or with example parameters where it has none."""
    return law(**law.example)


def _degree(law: type[Kernel]) -> str:
    """Return the homogeneity degree; of the example where a parameter sets it."""
    degree = example(law).degree
    return "-" if degree is None else f"{degree:.4g}"


def _gels(law: type[Kernel]) -> str:
    kernel = example(law)
    if not kernel.gels:
        return "no" if kernel.gels is False else "unknown"
    time = kernel.gel_time()
    return "yes" if time is None else f"at t = {time:.3g}" if time else "at once"


def _parameters(law: type[Kernel]) -> str:
    return ", ".join(f"{k} = {v:g}" for k, v in law.example.items())


def overview() -> list[tuple[str, ...]]:
    """Rows of the table of kernels: name, degree, gels, exact, formula without its prefactor."""
    return [
        (
            law.name,
            _degree(law),
            _gels(law),
            "yes" if law.exact else "no",
            law.formula.removeprefix("scale * ").replace("scale", "1")
            + (f"   [{_parameters(law)}]" if law.example else ""),
        )
        for law in KERNELS
    ]


def details(name: str) -> str:
    """Everything about one kernel.

    Raises
    ------
    InputError
        If there is no such kernel.
    """
    laws = {law.name: law for law in KERNELS}
    if name not in laws:
        raise InputError(f"NAME = {name!r}: no such kernel{did_you_mean(name, list(laws))}")
    law = laws[name]
    words = inspect.cleandoc(law.__doc__ or "").split("\n\nParameters")[0].replace("``", "")
    remark = f" ({_parameters(law)})" if law.example else ""
    start = ", from monomers of unit density" if example(law).gels else ""
    lines = [
        f"{law.name}: K(i, j) = {law.formula}",
        "",
        words,
        "",
        f"degree     {_degree(law)}{remark}",
        f"gels       {_gels(law)}{start}{remark}",
        f"exact      {'yes, for monomers at the start' if law.exact else 'no'}",
        f"reference  {law.reference}",
        "",
        "In a case file:",
        "",
        "    [kernel]",
        f'    name = "{law.name}"',
    ]
    for f in fields(law):
        value = law.example.get(f.name, 1.0 if f.default is MISSING else f.default)
        if value is not None:
            lines.append(f"    {f.name} = {value!r}")
    for constructor in law.constructors:
        lines += ["", *_physical(law, constructor)]
    return "\n".join(lines)


def _physical(law: type[Kernel], constructor: str) -> list[str]:
    make = getattr(law, constructor)
    words = inspect.cleandoc(make.__doc__).splitlines()[0].replace("``", "")
    lines = [
        f"From physical quantities: {words}",
        "",
        "    [kernel]",
        f'    name = "{law.name}"',
    ]
    measured = of_arguments(make)
    for key, argument in inspect.signature(make).parameters.items():
        dimension = measured.get(key)
        optional = "" if argument.default is argument.empty else "   # may be left out"
        text = f'"{dimension.example}"' if dimension else repr(argument.default)
        lines.append(f"    {key} = {text}{optional}")
    return lines


def kernels(
    name: Annotated[str | None, typer.Argument(help="Show the details of one kernel.")] = None,
) -> None:
    """List the collision kernels, or show one: formula, degree, gelation, exact solution."""
    if name is not None:
        typer.echo(details(name))
        return
    console.table(
        ("name", "degree", "gels", "exact", "K(i, j) / scale"), overview(), left=(0, 2, 3, 4)
    )
    typer.echo(
        "Degree and gelation are those of the parameters in brackets, and of monomers of\n"
        "unit density. Details of one: smolux kernels brownian\n"
        "Any other law: a formula in the case file (smolux new NAME -t\n"
        "custom-formula-kernel), or a Python function (smolux.kernels.from_function)."
    )
