"""``smolux check``: what a case will cost, before it is run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Sets = Annotated[
    list[str] | None,
    typer.Option("--set", "-s", metavar="KEY=VALUE", help="Change a value: run.particles=1e5"),
]


def check(
    case: Annotated[Path, typer.Argument(help="The case file.")],
    sets: Sets = None,
) -> None:
    """Check a case: mistakes, gelation, extinction, time, memory and size of the output."""
    from smolux.case import load, spatial

    from . import checking, flying

    flight = spatial.load(case, sets or ())
    if flight is not None:
        typer.echo(flying.described(flight, str(case)))
        return
    typer.echo(checking.text(load(case, sets or ()), str(case)))
