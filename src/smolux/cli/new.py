"""``smolux new``: a case file to start from."""

from __future__ import annotations

from typing import Annotated

import typer


def new(
    name: Annotated[str, typer.Argument(help="Name of the case; NAME.toml is written.")] = "",
    template: Annotated[
        str, typer.Option("--template", "-t", help="Which template; see --list.")
    ] = "aggregation",
    listing: Annotated[bool, typer.Option("--list", "-l", help="List the templates.")] = False,
) -> None:
    """Write a commented case file from a template; nothing is ever overwritten."""
    from . import templates

    if listing or not name:
        for key, title in templates.titles().items():
            typer.echo(f"{key:24s}{title}")
        if not listing:
            typer.echo("\nMake one with: smolux new my-case --template shattering")
        return
    file = templates.write(name, template)
    typer.echo(f"{file} written; next: smolux check {file}, smolux run {file}")
