"""Figures by the names that case files and the command line have for them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import smolux
from smolux.case.settings import FIGURES
from smolux.errors import InputError, did_you_mean

#: those that know the exact solution themselves
_KNOWING = ("clusters", "moments", "size-distribution")
_DPI = 200


def draw(name: str, ds: Any, solution: Any = None) -> Any:
    """Draw a figure.

    Parameters
    ----------
    name : str
        As case files have it; the function of `smolux.plotting` has an underscore for a dash.
    ds : xarray.Dataset
        A result.
    solution : xarray.Dataset, optional
        A solution of the rate equations to draw with it, where no exact one is known.

    Raises
    ------
    InputError
        If there is no such kind of figure, or the result holds nothing to draw.
    """
    if name not in FIGURES:
        raise InputError(f"--kind {name}: no such figure{did_you_mean(name, FIGURES)}")
    reference = solution
    if name in _KNOWING:
        exact = smolux.analysis.exact_dataset
        reference = "exact" if solution is None or exact(ds) is not None else solution
    return getattr(smolux.plotting, name.replace("-", "_"))(ds, reference=reference)


def write(
    names: Sequence[str], ds: Any, folder: Path, solution: Any = None
) -> tuple[list[Path], list[str]]:
    """Draw figures and write them as PNG.

    Returns
    -------
    files : list of Path
    remarks : list of str
        On figures that could not be drawn: a result without oscillations has no cycle, and the rest
        is written all the same.
    """
    files, remarks = [], []
    for name in names:
        try:
            figure = draw(name, ds, solution)
        except InputError as error:
            remarks.append(f"no figure {name!r}: {error}")
            continue
        files.append(smolux.plotting.save(figure, folder / f"{name}.png", dpi=_DPI))
    return files, remarks
