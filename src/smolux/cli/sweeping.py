"""A sweep from the command line: progress, the table, what failed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import smolux
from smolux.errors import InputError, Interrupted, quiet
from smolux.runtime.stopping import ALL, Stopper
from smolux.sweeps import go_on
from smolux.sweeps.grid import failures

from . import showing
from .console import say
from .progress import Display


def proceed(
    case: Path,
    over: Sequence[str],
    sets: Sequence[str],
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
    if begun and (over or sets or output is not None):
        raise InputError(f"{case}: is a sweep that was begun: it goes on as it is, without options")
    folder = case if begun else output or Path(f"{case.stem}-sweep")
    with Stopper(ALL, patient=False, say=say) as stopper, quiet():
        try:
            with display(check=stopper.check, first="sweeping") as progress:
                ds: Any = (
                    go_on(folder, progress=progress)
                    if begun
                    else smolux.sweep(case, over, directory=folder, sets=sets, progress=progress)
                )
        except KeyboardInterrupt as stop:
            reason = str(stop) if isinstance(stop, Interrupted) else "stopped"
            raise Interrupted(f"{reason}\ngo on with: smolux sweep {folder}") from None
    print(showing.text(ds))
    say(f"all points are in {folder / 'results.nc'}")
    wrong = [f"{label}: {message}" for label, message in failures(ds)]
    if wrong:
        raise InputError(
            [*wrong, f"{len(wrong)} points failed; try them again with: smolux sweep {folder}"]
        )
