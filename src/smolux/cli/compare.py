"""``smolux compare``: the same case by several methods."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .check import Sets


def compare(
    case: Annotated[Path, typer.Argument(help="The case file.")],
    sets: Sets = None,
    method: Annotated[
        list[str] | None,
        typer.Option("--method", "-m", help="Only these methods; all and the solver if left out."),
    ] = None,
    figure: Annotated[
        Path | None, typer.Option("--figure", "-f", help="Draw the comparison into this file.")
    ] = None,
) -> None:
    """Run a case by every method and the solver: differences in sigmas, and the time of each.

    Ends with 1 if a method differs.
    """
    from smolux.case import load

    from . import comparing

    if not comparing.run(load(case, sets or ()), method, figure):
        raise typer.Exit(1)
