"""``smolux plot``: figures of a result."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

import smolux
from smolux.case.spatial import FIGURES
from smolux.cli import figures, spatial_run
from smolux.cli.run_directory import find_results, load_results, load_solution
from smolux.errors import InputError

_DEFAULT = ("clusters", "moments", "size-distribution")
_DPI = 300


def draw(path: Path, kinds: Sequence[str], output: Path | None) -> list[Path]:
    """Draw figures of a result and write them.

    Parameters
    ----------
    path : Path
        Folder of a run, or a results file.
    kinds : sequence of str
        Which; the usual ones if empty.
    output : Path or None
        The file, for one figure; each beside the result if left out.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        For an unknown kind, or several for one file.
    """
    if output is not None and len(kinds) != 1:
        raise InputError(f"-o {output}: is one file; choose one figure with --kind")
    ds, folder = load_results(path), find_results(path).parent
    if ds.attrs.get("kind") == "spatial":
        pictures = [(name, spatial_run.draw(name, ds)) for name in kinds or FIGURES]
    else:
        solution = load_solution(path)
        pictures = [(name, figures.draw(name, ds, solution)) for name in kinds or _DEFAULT]
    return [
        smolux.plotting.save(figure, output or folder / f"{name}.png", dpi=_DPI)
        for name, figure in pictures
    ]


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
    for file in draw(path, kind or [], output):
        typer.echo(file)
