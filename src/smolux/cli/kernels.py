"""``smolux kernels``: what laws there are."""

from __future__ import annotations

from typing import Annotated

import typer


def kernels(
    name: Annotated[str | None, typer.Argument(help="Show the details of one kernel.")] = None,
) -> None:
    """List the collision kernels, or show one: formula, degree, gelation, exact solution."""
    from . import catalogue, console

    if name is not None:
        typer.echo(catalogue.details(name))
        return
    console.table(
        ("name", "degree", "gels", "exact", "K(i, j) / scale"),
        catalogue.overview(),
        left=(0, 2, 3, 4),
    )
    typer.echo(
        "Degree and gelation are those of the parameters in brackets, and of monomers of\n"
        "unit density. Details of one: smolux kernels brownian\n"
        "Any other law: a formula in the case file (smolux new NAME -t\n"
        "custom-formula-kernel), or a Python function (smolux.kernels.from_function)."
    )
