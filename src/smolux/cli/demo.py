"""``smolux demo``: a first run, whose exact solution is known."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def demo(
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the random numbers.")] = 1,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the demo.")] = Path(
        "smolux-demo"
    ),
) -> None:
    """Simulate the constant kernel, 8 replicas, and compare with the exact solution."""
    from . import demonstration

    text, agrees = demonstration.run(seed, output)
    typer.echo(text)
    if not agrees:
        raise typer.Exit(1)
