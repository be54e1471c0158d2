"""The work of ``smolux plot``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from smolux import plotting
from smolux.errors import InputError

from . import figures, flying, showing

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
    ds, folder = showing.load(path), showing.find(path).parent
    if ds.attrs.get("kind") == "spatial":
        pictures = [(name, flying.draw(name, ds)) for name in kinds or flying.FIGURES]
        return [
            plotting.save(figure, output or folder / f"{name}.png", dpi=_DPI)
            for name, figure in pictures
        ]
    solution = showing.load_solution(path)
    drawn = [(name, figures.draw(name, ds, solution)) for name in kinds or _DEFAULT]
    return [
        plotting.save(figure, output or folder / f"{name}.png", dpi=_DPI) for name, figure in drawn
    ]
