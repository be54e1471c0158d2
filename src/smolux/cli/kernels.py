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
        ("name", "K(i, j) / scale", "example", "degree", "gels", "exact"),
        catalogue.overview(),
        left=(0, 1, 2, 4, 5),
    )
    typer.echo(
        "Any other law: a formula in the case file (smolux new NAME --template "
        "custom-formula-kernel),\nor a Python function (smolux.kernels.from_function). "
        "Details of one: smolux kernels brownian"
    )
