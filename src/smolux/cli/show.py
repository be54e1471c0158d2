"""``smolux show``: the summary of a result."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def show(
    path: Annotated[Path, typer.Argument(help="The folder of a run, or a results file.")],
    every: Annotated[bool, typer.Option("--all", "-a", help="Show every output time.")] = False,
) -> None:
    """Show the summary of a result: means, 95 % intervals, exact values where known."""
    from . import showing

    ds = showing.load(path)
    if ds.attrs.get("kind") == "spatial":
        from . import flying

        typer.echo(flying.text(ds))
        return
    typer.echo(showing.text(ds, ds.sizes["time"] if every else showing.MOST))
