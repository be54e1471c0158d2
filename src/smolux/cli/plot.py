"""``smolux plot``: figures of a result."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def plot(
    path: Annotated[Path, typer.Argument(help="The folder of a run, or a results file.")],
    kind: Annotated[
        list[str] | None,
        typer.Option(
            "--kind",
            "-k",
            help="clusters, moments, size-distribution, oscillations or scaling; of a run in space "
            "discs, coarsening, spatial-kernel, pair-distribution, box-dimension or "
            "mass-dimension. May be repeated.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="File of the figure: .png, .pdf or .svg."),
    ] = None,
) -> None:
    """Draw figures of a result, beside it or where you want them."""
    from . import drawing

    for file in drawing.draw(path, kind or [], output):
        typer.echo(file)
