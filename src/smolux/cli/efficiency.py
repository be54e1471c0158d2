"""``smolux efficiency``: what methods and weightings are worth for a case."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .check import Sets


def efficiency(
    case: Annotated[Path, typer.Argument(help="The case file.")],
    sets: Sets = None,
    method: Annotated[
        list[str] | None,
        typer.Option("--method", "-m", help="Only these methods; that of the case if left out."),
    ] = None,
    weighting: Annotated[
        list[str] | None,
        typer.Option(
            "--weighting",
            "-w",
            help="Only these, such as mass-flow or weight-function=0.5; number and mass-flow if "
            "left out.",
        ),
    ] = None,
    observable: Annotated[
        list[str] | None,
        typer.Option("--observable", "-o", help="Such as M2 or n_50; the target of the case, M2."),
    ] = None,
    figure: Annotated[
        Path | None, typer.Option("--figure", "-f", help="Draw the efficiencies into this file.")
    ] = None,
) -> None:
    """Measure bias, variance, cost and efficiency with the particles and replicas of a case."""
    from smolux.case import load

    from . import weighing

    weighing.run(load(case, sets or ()), method, weighting, observable, figure)
