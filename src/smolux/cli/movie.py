"""``smolux movie``: a movie of discs in a box."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def movie(
    path: Annotated[Path, typer.Argument(help="The folder of a run in space, or its results.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File of the movie: .gif or .mp4.")
    ] = None,
    frames: Annotated[int, typer.Option("--frames", "-n", help="Number of frames.")] = 120,
    rate: Annotated[float, typer.Option("--rate", "-r", help="Frames a second.")] = 20.0,
    pixels: Annotated[int, typer.Option("--pixels", "-p", help="Width; even.")] = 480,
) -> None:
    """Make a movie of a run in space: GIF, or MP4 with the extra "movie"."""
    from smolux import plotting

    from . import showing

    file = output or showing.find(path).parent / "movie.gif"
    tree = showing.load(path)
    typer.echo(plotting.movie(tree, file, frames=frames, rate=rate, pixels=pixels))
