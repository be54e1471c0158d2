"""``smolux sweep``: run a case at every point of a grid of its parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .check import Sets


def sweep(
    case: Annotated[Path, typer.Argument(help="A case file, or the folder of a sweep.")],
    over: Annotated[
        list[str] | None,
        typer.Option(
            "--over",
            metavar="KEY=VALUES",
            help="Values of a key: kernel.a=0.5:1:11, run.particles=1e3:1e5:3:log, "
            "processes.shattering.rate=0,0.01. Several span a grid.",
        ),
    ] = None,
    sets: Sets = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder of the sweep; CASE-sweep if left out."),
    ] = None,
) -> None:
    """Run a case at every point of a grid; all results in one file.

    Points that are finished are kept, whatever ends the sweep; the same command again, or
    "smolux sweep FOLDER", does those that are missing.
    """
    from . import sweeping

    sweeping.proceed(case, over or (), sets or (), output)
