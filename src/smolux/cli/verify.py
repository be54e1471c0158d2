"""``smolux verify``: whether every method obeys the exact laws on this machine."""

from __future__ import annotations

from typing import Annotated

import typer


def verify(
    method: Annotated[
        list[str] | None, typer.Option("--method", "-m", help="Only these methods.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of all checks.")] = 1,
) -> None:
    """Test every method against the exact laws: means, fluctuations, whole distributions, mass."""
    from . import verifying

    if not verifying.run(method, seed):
        raise typer.Exit(1)
