"""``smolux sweep``: run a case at every point of a grid of its parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

import smolux
from smolux.cli.commands.show import text
from smolux.cli.console import say
from smolux.cli.options import Overrides
from smolux.cli.progress import Display
from smolux.errors import InputError, Interrupted, quiet
from smolux.runtime.stopping import ALL, Stopper
from smolux.sweeps import go_on
from smolux.sweeps.grid import failures


def proceed(
    case: Path,
    over: Sequence[str],
    overrides: Sequence[str],
    output: Path | None,
    display: Callable[..., Display] = Display,
) -> None:
    """Run a sweep, new or begun, and print its table.

    Raises
    ------
    InputError
        For mistakes, and at the end if points failed.
    Interrupted
        On a signal.
    """
    begun = case.is_dir()
    if begun and (over or overrides or output is not None):
        raise InputError(f"{case}: is a sweep that was begun: it goes on as it is, without options")
    folder = case if begun else output or Path(f"{case.stem}-sweep")
    with Stopper(ALL, patient=False, say=say) as stopper, quiet():
        try:
            with display(check=stopper.check, first="sweeping") as progress:
                ds: Any
                if begun:
                    ds = go_on(folder, progress=progress)
                else:
                    ds = smolux.sweep(
                        case, over, directory=folder, sets=overrides, progress=progress
                    )
        except KeyboardInterrupt as stop:
            reason = str(stop) if isinstance(stop, Interrupted) else "stopped"
            raise Interrupted(f"{reason}\ngo on with: smolux sweep {folder}") from None
    print(text(ds))
    say(f"all points are in {folder / 'results.nc'}")
    wrong = [f"{label}: {message}" for label, message in failures(ds)]
    if wrong:
        raise InputError(
            [*wrong, f"{len(wrong)} points failed; try them again with: smolux sweep {folder}"]
        )


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
    overrides: Overrides = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder of the sweep; CASE-sweep if left out."),
    ] = None,
) -> None:
    """Run a case at every point of a grid; all results in one file.

    Points that are finished are kept, whatever ends the sweep; the same command again, or
    "smolux sweep FOLDER", does those that are missing.
    """
    proceed(case, over or (), overrides or (), output)
