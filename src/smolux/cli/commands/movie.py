"""``smolux movie``: a movie of discs in a box."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import smolux
from smolux.cli.run_directory import find_results, load_results


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
    file = output or find_results(path).parent / "movie.gif"
    tree = load_results(path)
    typer.echo(smolux.plotting.movie(tree, file, frames=frames, rate=rate, pixels=pixels))
