"""Figures by the names that case files and the command line have for them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from smolux import plotting
from smolux.errors import InputError, did_you_mean

#: name -> function of a result and of what it is compared with
KINDS: dict[str, Callable[..., Any]] = {
    "clusters": plotting.clusters,
    "moments": plotting.moments,
    "size-distribution": plotting.size_distribution,
    "oscillations": plotting.oscillations,
    "scaling": plotting.scaling,
}
#: those that know the exact solution themselves
_KNOWING = ("clusters", "moments", "size-distribution")
_DPI = 200


def draw(name: str, ds: Any, solution: Any = None) -> Any:
    """Draw a figure.

    Parameters
    ----------
    name : str
        Of `KINDS`.
    ds : xarray.Dataset
        A result.
    solution : xarray.Dataset, optional
        A solution of the rate equations to draw with it, where no exact one is known.

    Raises
    ------
    InputError
        If there is no such kind of figure, or the result holds nothing to draw.
    """
    if name not in KINDS:
        raise InputError(f"--kind {name}: no such figure{did_you_mean(name, list(KINDS))}")
    reference = solution
    if name in _KNOWING:
        from smolux.analysis import exact_dataset

        reference = "exact" if solution is None or exact_dataset(ds) is not None else solution
    return KINDS[name](ds, reference=reference)


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
        files.append(plotting.save(figure, folder / f"{name}.png", dpi=_DPI))
    return files, remarks
