"""Results as text, and where they are found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from smolux import analysis, results
from smolux.errors import InputError
from smolux.results import warnings


def find(path: Path) -> Path:
    """Return the results file of a folder, or the file itself.

    Raises
    ------
    InputError
        If there is none.
    """
    if not path.is_dir():
        return path
    file = path / "results.nc"
    if not file.is_file():
        hint = f"; run it with: smolux run {path}" if (path / "case.toml").is_file() else ""
        raise InputError(f"{path}: there is no results.nc in it{hint}")
    return file


def load(path: Path) -> Any:
    """Read a result.

    Raises
    ------
    InputError
        If there is none, or it cannot be read.
    """
    return results.load(find(path))


def load_solution(path: Path) -> Any:
    """Read the solution of the rate equations beside a result; None if there is none."""
    file = find(path).with_name("solution.nc")
    return results.load(file) if file.is_file() and file != path else None


#: output times in a table, unless all are wanted
MOST = 12


def text(ds: Any, most: int = MOST) -> str:
    """Say how a result was made, and write its summary as tables.

    Parameters
    ----------
    ds : xarray.Dataset
        A result.
    most : int
        Output times shown; if there are more, some of them, the first and the last included.
    """
    attributes = ds.attrs
    if "sweep" in attributes:
        return "\n".join(
            [analysis.format_sweep(ds).rstrip(), *(f"warning: {w}" for w in warnings(ds))]
        )
    facts = [str(attributes.get("method", "?"))]
    if "initial_particles" in attributes:
        facts += [
            f"{attributes['initial_particles']} particles",
            f"{ds.sizes['replica']} replicas",
            str(attributes.get("population", "")),
            f"seed {attributes.get('seed', '?')}",
        ]
    if not attributes.get("complete", 1):
        facts.append("unfinished")
    lines = [str(attributes.get("title", "")), ", ".join(f for f in facts if f), ""]
    lines.append(analysis.format_table(chosen(ds, most)).rstrip())
    lines.append(shown(ds, most))
    lines += [f"warning: {w}" for w in warnings(ds)]
    return "\n".join(line for n, line in enumerate(lines) if line or n == 2).strip()


def shown(ds: Any, most: int) -> str:
    """Say that not all times are shown; nothing if they are."""
    times = ds.sizes["time"]
    return f"{most} of {times} times are shown." if times > most else ""


def chosen(ds: Any, most: int) -> Any:
    """Return the summary of at most so many times and of the moments that change."""
    times = ds.sizes["time"]
    some = ds
    if times > most:
        some = ds.isel(time=np.unique(np.linspace(0, times - 1, most).round().astype(int)))
    summary = analysis.summary(some, sizes=()).assign_attrs(mass=analysis.mass_balance(ds))
    constant = (0,) if "mass_in" in ds else (0, 1)  # what M0 is, the number density says
    changing = [p for p in summary["order"].values if p not in constant]
    return summary.drop_vars("n").sel(order=changing)
