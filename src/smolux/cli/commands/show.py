"""``smolux show``: the summary of a result."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import smolux
from smolux.cli import spatial_run
from smolux.cli.run_directory import load_results

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
        lines = [smolux.analysis.format_sweep(ds).rstrip()]
        return "\n".join([*lines, *_warnings(ds)])
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
    lines.append(smolux.analysis.format_table(chosen(ds, most)).rstrip())
    lines.append(shown(ds, most))
    lines += [*_mixing(ds), *_warnings(ds)]
    return "\n".join(line for n, line in enumerate(lines) if line or n == 2).strip()


def _mixing(ds: Any) -> list[str]:
    """Say how mixed the particles are at the end, if they carry a composition."""
    if "mixing" not in ds:
        return []
    last = ds["mixing"].isel(time=-1)
    kinds = ", ".join(str(kind) for kind in ds["component"].values)
    return [
        f"Composition of {kinds}: the scatter among particles at the end is "
        f"{float(last.mean()):.3g} of that of pure ones (mixing)."
    ]


def _warnings(ds: Any) -> list[str]:
    return [f"warning: {w}" for w in smolux.results.warnings(ds)]


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
    summary = smolux.analysis.summary(some, sizes=()).assign_attrs(
        mass=smolux.analysis.mass_balance(ds)
    )
    constant = (0,) if "mass_in" in ds else (0, 1)  # what M0 is, the number density says
    changing = [p for p in summary["order"].values if p not in constant]
    return summary.drop_vars("n").sel(order=changing)


def show(
    path: Annotated[Path, typer.Argument(help="The folder of a run, or a results file.")],
    every: Annotated[bool, typer.Option("--all", "-a", help="Show every output time.")] = False,
) -> None:
    """Show the summary of a result: means, 95 % intervals, exact values where known."""
    ds = load_results(path)
    if ds.attrs.get("kind") == "spatial":
        typer.echo(spatial_run.text(ds))
        return
    typer.echo(text(ds, ds.sizes["time"] if every else MOST))
