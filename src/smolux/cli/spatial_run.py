"""Discs in a box on the command line: running a case, its text and its figures."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import typer

import smolux
from smolux.case import spatial as cases
from smolux.case.spatial import FIGURES, SpatialCase
from smolux.errors import InputError, Interrupted, did_you_mean, quiet
from smolux.runtime.stopping import ALL, Stopper
from smolux.settings import SpatialSettings

from . import run_directory
from .console import amount, duration, say
from .progress import Display
from .run_directory import RunDirectory

_DPI = 200


def run(case: SpatialCase, path: Path, output: Path | None) -> None:
    """Run a case in a folder of its own, or finish what is in one.

    Parameters
    ----------
    case : SpatialCase
    path : Path
        The case file, or the folder of a run.
    output : Path, optional
        The folder that is wanted.
    """
    if path.is_dir():
        directory = run_directory.find(path)
    else:
        case = case.with_seed()
        directory = run_directory.create(case, path, output)
    say(f"seed {case.run.seed}, folder {directory.path}")
    tree = _stored(directory, case)
    if tree is None or _cut(tree):
        tree = _simulate(case, directory, tree)
    typer.echo(text(tree))
    for remark in _write_output(case, tree, directory.path):
        say(remark)
    say(f"results and figures are in {directory.path}")


def _stored(directory: RunDirectory, case: SpatialCase) -> Any:
    """Load what a run has reached; None if there is nothing."""
    if not directory.results.is_file():
        return None
    tree = smolux.results.load(directory.results)
    begun = tree.attrs.get("case", "")
    if begun != case.to_toml():
        raise InputError(
            f"{directory.path}: its results are of another case; run the case file anew"
        )
    return tree


def _simulate(case: SpatialCase, directory: RunDirectory, before: Any) -> Any:
    """Run to the end, from what was reached before if the method can go on from there."""
    arguments = case.run.arguments()
    exact = arguments["method"].exact
    tree: Any
    if before is None or not exact:
        begun = partial(smolux.spatial.simulate, case.run.system())
    else:
        say(f"going on at t = {before.attrs['time_reached']:.6g}")
        begun = partial(smolux.spatial.resume, before)
        del arguments["method"]
    with Stopper(ALL, say=say) as stopper, Display(stopper.check) as progress, quiet():
        try:
            tree = begun(progress=progress, **arguments)
        except Interrupted as stop:
            tree, reason = stop.dataset, str(stop)
        else:
            reason = tree.attrs["stopped"]
    _store(tree, case, directory)
    if _cut(tree):
        raise Interrupted(
            f"{reason}; what was reached is in {directory.results}\n"
            f"{'go on' if exact else 'begin again'} with: smolux run {directory.path}"
        )
    say(f"simulated in {duration(float(tree.attrs['wall_seconds']))}")
    return tree


def _cut(tree: Any) -> bool:
    """Whether a run was stopped by what is no part of the case: the user, the clock, memory."""
    reason = str(tree.attrs.get("stopped", ""))
    return reason.startswith(("interrupted", "the time limit", "memory"))


def _store(tree: Any, case: SpatialCase, directory: RunDirectory) -> None:
    tree.attrs["case"] = case.to_toml()
    if case.title:
        tree.attrs["title"] = case.title
    smolux.results.save(tree, directory.results)


def _write_output(case: SpatialCase, tree: Any, folder: Path) -> list[str]:
    """Write figures, trajectory and movie; return remarks on what could not be made."""
    wanted = case.output
    jobs: list[tuple[str, Callable[[], object]]] = [
        (f"{name}.png", partial(_save, name, tree, folder)) for name in wanted.figures
    ]
    if wanted.trajectory != "none":
        file = folder / f"trajectory.{wanted.trajectory}"
        write = partial(smolux.spatial.write_trajectory, tree, file, frames=wanted.frames)
        jobs.append((file.name, write))
    if wanted.movie:
        film = folder / "movie.gif"
        jobs.append((film.name, partial(smolux.plotting.movie, tree, film, frames=wanted.frames)))
    remarks = []
    for name, job in jobs:
        try:
            job()
        except InputError as error:
            remarks.append(f"no {name}: {error}")
    return remarks


def _save(name: str, tree: Any, folder: Path) -> Path:
    return smolux.plotting.save(draw(name, tree), folder / f"{name}.png", dpi=_DPI)


def draw(name: str, tree: Any) -> Any:
    """Draw a figure.

    Parameters
    ----------
    name : str
        Of `FIGURES`.
    tree : xarray.DataTree
        A result.

    Raises
    ------
    InputError
        If there is no such kind of figure, or the result holds nothing to draw.
    """
    figure, measured = smolux.plotting, smolux.spatial
    kinds: dict[str, Callable[[Any], Any]] = {
        "discs": figure.discs,
        "coarsening": figure.coarsening,
        "spatial-kernel": lambda t: figure.spatial_kernel(measured.measured_kernel(t)),
        "pair-distribution": lambda t: figure.pair_distribution(measured.pair_distribution(t)),
        "box-dimension": lambda t: figure.dimension(measured.box_dimension(t)),
        "mass-dimension": lambda t: figure.dimension(measured.mass_dimension(t)),
    }
    if name not in kinds:
        raise InputError(f"--kind {name}: no such figure{did_you_mean(name, FIGURES)}")
    return kinds[name](tree)


def text(tree: Any) -> str:
    """Say how a result was made and what came of it."""
    a = tree.attrs
    model = json.loads(a["model"])
    series = tree["series"].to_dataset()
    kinds = "discs" if len(model["box"]) == 2 else "spheres"
    lines = [
        str(a.get("title", "")),
        f"{a['method']}, {model['discs']} {kinds}, volume fraction {model['volume_fraction']:.4g}, "
        f"walls {', '.join(dict.fromkeys(model['walls']))}, seed {a.get('seed', '?')}",
        "",
        f"{'time':>12s} {'clusters':>10s} {'mean mass':>12s} {'largest':>10s} {'energy':>12s}",
    ]
    reached = series.isel(time=series["clusters"].notnull().values)
    count = reached.sizes["time"]
    for k in sorted({round(m * (count - 1) / 11) for m in range(12)} if count else ()):
        row = reached.isel(time=k)
        lines.append(
            f"{float(row['time']):12.5g} {float(row['clusters']):10.0f} "
            f"{float(row['mean_mass']):12.5g} {float(row['largest']):10.0f} "
            f"{float(row['kinetic_energy']):12.5g}"
        )
    merges, walls = tree["events"].sizes["event"], tree["walls"].sizes["reflection"]
    walls += int(tree["walls"]["more"].sum()) if "more" in tree["walls"] else 0
    lines += ["", f"{merges} merges and {walls} reflections until t = {a['time_reached']:.6g}."]
    lines += [f"warning: {w}" for w in smolux.results.warnings(tree)]
    return "\n".join(lines).strip()


def described(case: cases.SpatialCase, source: str) -> str:
    """Say what a case is; whether its discs fit has been tried.

    Raises
    ------
    InputError
        If they do not, or for what a run would refuse.
    """
    system = case.with_seed().run.system()
    SpatialSettings.checked(case.run.settings())
    run_ = case.run
    memory = 450 * len(system)
    lines = [
        f"{source} is valid.",
        "",
        f"{'title':12s} {case.title}",
        f"{'system':12s} {system!r}",
        f"{'velocities':12s} {run_.velocities}",
        f"{'simulate':12s} {run_.method}, to {run_.clusters} cluster{'s' * (run_.clusters > 1)}"
        + (f" or t = {run_.until:g}" if run_.until else ""),
        f"{'memory':12s} about {amount(memory, 'B')}",
    ]
    return "\n".join(lines)
