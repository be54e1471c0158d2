"""``smolux run``: run a case, or go on with one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .check import Sets


def run(
    case: Annotated[Path, typer.Argument(help="A case file, or the folder of an unfinished run.")],
    sets: Sets = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder of the run; the name of the case if left out."),
    ] = None,
) -> None:
    """Run a case: results, figures and a report in a folder.

    Ctrl-C, SIGTERM or the time limit stop it without loss; "smolux run FOLDER" goes on from there,
    and the data are bit for bit those of a run without a stop.
    """
    from smolux.case import load, spatial
    from smolux.errors import InputError
    from smolux.results import warnings

    from . import flying, report, rundir, running, showing
    from .console import say

    flight = spatial.load(case / "case.toml" if case.is_dir() else case, sets or ())
    if flight is not None:
        flying.run(flight, case, output)
        return
    if case.is_dir():
        if sets or output is not None:
            raise InputError(
                f"{case}: is a run that was begun: it goes on as it is, without --set and -o"
            )
        directory = rundir.find(case)
    else:
        directory = rundir.create(load(case, sets or ()).with_seed(), case, output)
    settings = directory.load()
    seed = f"seed {settings.run.seed}, " if settings.run is not None else ""
    say(f"{seed}folder {directory.path}")
    outcome = running.proceed(directory)
    typer.echo(showing.text(outcome.results))
    if outcome.solution is not None:
        typer.echo(f"\n{report.agreement(outcome.results, outcome.solution)}")
        for warning in warnings(outcome.solution):
            typer.echo(f"warning: rate equations: {warning}")
    for remark in outcome.remarks:
        say(remark)
    say(f"results, figures and report.html are in {directory.path}")
