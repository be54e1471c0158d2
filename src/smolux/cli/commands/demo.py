"""``smolux demo``: a first run, whose exact solution is known."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

import smolux
from smolux.analysis.table import aligned
from smolux.case import Case, Output, Run
from smolux.cli.commands.run import proceed
from smolux.cli.console import say
from smolux.cli.run_directory import RunDirectory
from smolux.errors import InputError
from smolux.kernels import Constant
from smolux.model import Model
from smolux.runtime.files import replacing

TITLE = "Demo: constant kernel"


def case(seed: int) -> Case:
    """Return the case of the demo."""
    return Case(
        Model(kernel=Constant()),
        Run((0.5, 1.0, 2.0, 5.0, 10.0, 20.0), particles=100_000, replicas=8, seed=seed),
        output=Output(("clusters", "size-distribution")),
        title=TITLE,
    )


def demonstrate(seed: int, folder: Path) -> tuple[str, bool]:
    """Run the demo in a folder.

    Returns
    -------
    text : str
        What came out.
    agrees : bool
        Whether it agrees with the exact solution.

    Raises
    ------
    InputError
        If the folder holds something else than an earlier demo.
    """
    directory = _folder(folder, case(seed))
    say(f"{TITLE}, 100000 particles, 8 replicas, seed {seed}")
    outcome = proceed(directory)
    summary = smolux.analysis.summary(outcome.results)
    rows = smolux.analysis.tables(summary, ["number_density"])[0][1]
    header = ("time", "clusters per volume", *rows[0][2:])
    words, agrees = verdict(outcome.results)
    return "\n".join([*aligned([header, *rows[1:]]), "", words, _where(directory)]), agrees


def _folder(folder: Path, wanted: Case) -> RunDirectory:
    """Return the folder, cleared of an earlier demo."""
    directory = RunDirectory(folder)
    if directory.case.is_file():
        if directory.load().title != TITLE:
            raise InputError(f"-o {folder}: holds a run of yours; name another folder")
        for file in (directory.results, directory.checkpoint):
            file.unlink(missing_ok=True)
    elif folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"-o {folder}: is not empty; name a new folder")
    folder.mkdir(parents=True, exist_ok=True)
    with replacing(directory.case) as temporary:
        temporary.write_text(wanted.to_toml(), encoding="utf-8")
    return directory


def verdict(ds: Any) -> tuple[str, bool]:
    """Say and return whether a result agrees with the exact solution."""
    found = smolux.analysis.compare(ds, "exact").attrs
    agrees = found["agree"] == 1
    words = {1: "agrees with", 0: "DOES NOT AGREE with"}.get(found["agree"], "cannot be told from")
    text = (
        f"The simulation {words} the exact solution: all {found['entries']} moments and "
        f"densities\ntogether have p = {found['p_value']:.2g} (below 0.005 would be a difference)."
    )
    if found["agree"] < 0:
        text += f" {found['notes']}"
    return text, agrees


def _where(directory: RunDirectory) -> str:
    return f"Figures, results and {directory.report} are written; next: smolux new my-case"


def demo(
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the random numbers.")] = 1,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the demo.")] = Path(
        "smolux-demo"
    ),
) -> None:
    """Simulate the constant kernel, 8 replicas, and compare with the exact solution."""
    words, agrees = demonstrate(seed, output)
    typer.echo(words)
    if not agrees:
        raise typer.Exit(1)
