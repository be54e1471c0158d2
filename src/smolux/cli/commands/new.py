"""``smolux new``: a case file to start from, made of a template."""

from __future__ import annotations

import os
from importlib import resources
from pathlib import Path
from typing import Annotated

import typer

from smolux.errors import InputError, did_you_mean

#: in the order of the list, from simple to special
TEMPLATES = (
    "aggregation",
    "shattering",
    "oscillations",
    "custom-formula-kernel",
    "aerosol",
    "ballistic-2d",
)


def text(template: str, file: str = "CASE") -> str:
    """Text of a template, for a case file of the given name.

    Raises
    ------
    InputError
        If there is no such template.
    """
    if template not in TEMPLATES:
        raise InputError(
            f"--template {template}: no such template{did_you_mean(template, TEMPLATES)}"
        )
    source = resources.files("smolux") / "templates" / f"{template}.toml"
    return source.read_text(encoding="utf-8").replace("{file}", file)


def titles() -> dict[str, str]:
    """Name and first line of each template."""
    return {name: text(name).splitlines()[0].lstrip("# ").rstrip(".") for name in TEMPLATES}


def write(name: str, template: str) -> Path:
    """Write ``name.toml``; a file that is there is left alone.

    Raises
    ------
    InputError
        If there is no such template or folder, or the file exists.
    """
    file = Path(name).expanduser()
    if file.suffix != ".toml":
        file = file.with_name(file.name + ".toml")
    content = text(template, os.fspath(file))
    if not file.parent.is_dir():
        raise InputError(f"{name}: there is no folder {file.parent}; create it first")
    try:
        with file.open("x", encoding="utf-8") as out:
            out.write(content)
    except FileExistsError:
        raise InputError(f"{file}: is already there; choose another name") from None
    return file


def new(
    name: Annotated[str, typer.Argument(help="Name of the case; NAME.toml is written.")] = "",
    template: Annotated[
        str, typer.Option("--template", "-t", help="Which template; see --list.")
    ] = "aggregation",
    listing: Annotated[bool, typer.Option("--list", "-l", help="List the templates.")] = False,
) -> None:
    """Write a commented case file from a template; nothing is ever overwritten."""
    if listing or not name:
        for key, title in titles().items():
            typer.echo(f"{key:24s}{title}")
        if not listing:
            typer.echo("\nMake one with: smolux new my-case --template shattering")
        return
    file = write(name, template)
    typer.echo(f"{file} written; next: smolux check {file}, smolux run {file}")
