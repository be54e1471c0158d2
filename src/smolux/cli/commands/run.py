"""``smolux run``: a case in its folder, from wherever it stands, a new run and an old one alike."""

from __future__ import annotations

import errno
import json
import os
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

import smolux
from smolux.case import Case, load, parse, spatial
from smolux.cli import figures, report, run_directory, spatial_run
from smolux.cli.commands import show
from smolux.cli.console import duration, say
from smolux.cli.options import Overrides
from smolux.cli.progress import Display
from smolux.cli.run_directory import RunDirectory
from smolux.errors import InputError, Interrupted, OutOfMemoryError, SolverError, WorkerError, quiet
from smolux.model_dict import model_to_dict
from smolux.observables import units
from smolux.runtime.executors import opened
from smolux.runtime.stopping import ALL, Stopper
from smolux.settings import Settings


@dataclass
class Outcome:
    """What a run has given.

    Attributes
    ----------
    results : xarray.Dataset
    solution : xarray.Dataset or None
        Of the rate equations, if both were wanted.
    remarks : list of str
        On what was left out.
    """

    results: Any
    solution: Any
    remarks: list[str]


def proceed(directory: RunDirectory, display: Callable[..., Display] = Display) -> Outcome:
    """Do what is still to be done of a run: simulate, solve, draw, report.

    Parameters
    ----------
    directory : RunDirectory
        With its case.
    display : callable
        Makes the display of progress, see `Display`.

    Raises
    ------
    Interrupted
        On a signal, past the time limit or without memory: what there is has been written, and the
        run goes on from there, if it had a checkpoint.
    """
    case = directory.load()
    with Stopper(ALL, patient=False, say=say) as stopper, quiet():
        try:
            return _stages(case, directory, stopper, display)
        except KeyboardInterrupt as stop:
            reason = str(stop) if isinstance(stop, Interrupted) else "stopped"
            raise Interrupted(f"{reason}\n{_onward(directory)}") from None
        except OutOfMemoryError as error:
            raise Interrupted(f"error: {error}\n{_onward(directory)}") from None
        except WorkerError as error:
            raise Interrupted(
                f"error: {error}\ntry again with: smolux run {directory.path}"
            ) from None
        except OSError as error:
            if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EROFS):
                raise
            raise Interrupted(
                f"error: {error.strerror or error}\nwhen there is room, {_onward(directory)}"
            ) from error


def _onward(directory: RunDirectory) -> str:
    """Say how to go on: from the start, if nothing is there to go on from."""
    kept = directory.checkpoint.is_file()
    if not kept and directory.results.is_file():
        with suppress(InputError):  # what is whole is not computed again
            kept = bool(smolux.results.load(directory.results).attrs.get("complete", 1))
    return f"{'go on' if kept else 'begin again'} with: smolux run {directory.path}"


def _stages(
    case: Case, directory: RunDirectory, stopper: Stopper, display: Callable[..., Display]
) -> Outcome:
    ds, solution = None, None
    remarks: list[str] = []
    if case.run is not None:
        ds = _finished(directory.results, case, directory.checkpoint)
        if ds is None:
            ds = _simulate(case, directory, stopper, display)
    if case.solve is not None:
        file = directory.results if ds is None else directory.solution
        solution = _finished(file, case)
        try:
            solution = solution if solution is not None else _solve(case, file, display)
        except SolverError as error:
            if ds is None:
                raise InputError(f"solve: {error}") from None
            # the simulation has nothing to do with it, and stays
            remarks.append(f"no solution of the rate equations: {error}")
    if ds is None:
        ds, solution = solution, None
    files, undrawn = figures.write(case.output.figures, ds, directory.path, solution)
    if case.output.report:
        report.write(directory.report, case, ds, solution, files)
    return Outcome(ds, solution, [*remarks, *undrawn])


def _finished(file: Path, case: Case, checkpoint: Path | None = None) -> Any:
    """Load results that are complete; None if there are none.

    Raises
    ------
    InputError
        If they are those of another case.
    """
    if checkpoint is not None and checkpoint.is_file():
        _check_plan(_plan_of(checkpoint), case)
        return None
    if not file.is_file():
        return None
    ds = smolux.results.load(file)
    if not ds.attrs.get("complete", 1):
        return None
    begun = parse(str(ds.attrs["case"])) if "case" in ds.attrs else case
    settings = "run" if ds.attrs.get("method") != "solve" else "solve"
    if begun.model != case.model or _data(begun, settings) != _data(case, settings):
        raise InputError(_CHANGED)
    return ds


_CHANGED = (
    "case.toml: was changed since the run was begun; put it back, or start a new run of it with -o "
    "(checkpoint_every, time_limit, [parallel] and [output] may be changed)"
)


def _data(case: Case, settings: str) -> dict[str, Any]:
    """Return the settings that decide on the data."""
    if settings == "solve" and case.solve is not None:
        return case.solve.arguments()
    return {} if case.run is None else case.run.arguments()


def _plan_of(checkpoint: Path) -> Any:
    from smolux.stochastic.checkpoint import load as stored  # which loads Numba

    return stored(checkpoint)[0]


def _check_plan(plan: Any, case: Case) -> None:
    """Check that a checkpoint belongs to the case.

    Raises
    ------
    InputError
        If it does not.
    """
    same = model_to_dict(plan.model) == model_to_dict(case.model)
    asked = None if case.run is None else Settings.checked(case.run.arguments())
    if not same or asked != plan.asked:
        raise InputError(_CHANGED)


def _simulate(
    case: Case, directory: RunDirectory, stopper: Stopper, display: Callable[..., Display]
) -> Any:
    def check() -> None:
        # from the first call on there is something to lose
        stopper.patient = True
        stopper.check()

    with display(check=check) as progress:
        try:
            ds = _stored(
                partial(_computed, case, directory, progress), case, directory.results, stopper
            )
        except Interrupted as stop:
            raise Interrupted(f"{str(stop).partition(';')[0]}{_share(progress)}") from None
    if not ds.attrs["complete"]:
        raise Interrupted(f"{ds.attrs['stopped']}{_share(progress)}")
    # not before: whatever happens between, the run can go on from it
    directory.checkpoint.unlink(missing_ok=True)
    say(
        f"simulated in {duration(float(ds.attrs['wall_seconds']))}"
        f" ({duration(float(ds.attrs['compile_seconds']))} of it compiling,"
        f" {duration(float(ds.attrs['bounds_seconds']))} for bounds of the rates)"
    )
    if case.run is not None and case.run.method == "auto":
        say(f"method {ds.attrs['method']}: {ds.attrs['method_reason']}")
    if case.run is not None and case.run.weighting == "auto":
        settings = "".join(f" {v}" for v in json.loads(ds.attrs["weighting_settings"]).values())
        say(f"weighting {ds.attrs['weighting']}{settings}: {ds.attrs['weighting_reason']}")
    stopper.patient = False
    stopper.check()
    return ds


def _share(progress: Display) -> str:
    return f", {100 * progress.last.fraction:.0f} % done" if progress.last else ""


def _computed(case: Case, directory: RunDirectory, progress: Display) -> Any:
    run, file = case.run, directory.checkpoint
    assert run is not None
    with opened(**asdict(case.parallel)) as executor:
        if case.parallel.executor != "threads" and not file.is_file():
            return smolux.simulate(
                case.model, executor=executor, progress=progress, **run.arguments()
            )
        settings: dict[str, Any] = {
            "executor": executor if case.parallel.executor == "threads" else None,
            "progress": progress,
            "checkpoint_every": run.checkpoint_every,
            "time_limit": run.time_limit,
        }
        if file.is_file():
            return smolux.resume(file, **settings)
        return smolux.simulate(case.model, checkpoint=file, **run.arguments(), **settings)


def _solve(case: Case, file: Path, display: Callable[..., Display]) -> Any:
    settings = case.solve_arguments()
    with display(first="solving") as progress:
        ds = _stored(partial(smolux.solve, case.model, **settings, progress=progress), case, file)
    say(f"solved in {duration(float(ds.attrs['wall_seconds']))}")
    return ds


def _stored(
    compute: Callable[[], Any], case: Case, file: Path, stopper: Stopper | None = None
) -> Any:
    """Compute and save the result; also what there was when something ended it: that is right.

    Nothing stops this before it is saved, if there is a `stopper`.
    """
    try:
        ds = compute()
    except (Interrupted, InputError, SolverError, WorkerError) as stop:
        if stopper is not None:
            stopper.patient = True
        if stop.dataset is not None:
            _store(stop.dataset, case, file)
            say(f"what was computed until then is in {file}")
        raise
    if stopper is not None:
        stopper.patient = True
    _store(ds, case, file)
    return ds


def _store(ds: Any, case: Case, file: Path) -> None:
    """Save a result with its case; if its folder cannot take it, save it elsewhere and say so."""
    ds.attrs["case"] = case.to_toml()
    if case.title:
        ds.attrs["title"] = case.title
    if case.si:
        for name, unit in units().items():
            if "units" in ds.get(name, ds).attrs:
                ds[name].attrs["units"] = unit
    try:
        smolux.results.save(ds, file)
    except OSError:
        handle, name = tempfile.mkstemp(prefix=f"smolux-{file.stem}-", suffix=".nc")
        os.close(handle)
        smolux.results.save(ds, name)  # if that fails too, the first error is told with it
        say(f"{file} cannot be written; what was computed is in {name}")
        raise


def run(
    case: Annotated[Path, typer.Argument(help="A case file, or the folder of an unfinished run.")],
    overrides: Overrides = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder of the run; the name of the case if left out."),
    ] = None,
) -> None:
    """Run a case: results, figures and a report in a folder.

    Ctrl-C, SIGTERM or the time limit stop it without loss; "smolux run FOLDER" goes on from there,
    and the data are bit for bit those of a run without a stop.
    """
    in_space = spatial.load(case / "case.toml" if case.is_dir() else case, overrides or ())
    if in_space is not None:
        spatial_run.run(in_space, case, output)
        return
    if case.is_dir():
        if overrides or output is not None:
            raise InputError(
                f"{case}: is a run that was begun: it goes on as it is, without --set and -o"
            )
        directory = run_directory.find(case)
    else:
        directory = run_directory.create(load(case, overrides or ()).with_seed(), case, output)
    settings = directory.load()
    seed = f"seed {settings.run.seed}, " if settings.run is not None else ""
    say(f"{seed}folder {directory.path}")
    _tell(proceed(directory), directory)


def _tell(outcome: Outcome, directory: RunDirectory) -> None:
    """Print what a run has given."""
    typer.echo(show.text(outcome.results))
    if outcome.solution is not None:
        typer.echo(f"\n{report.agreement(outcome.results, outcome.solution)}")
        for warning in smolux.results.warnings(outcome.solution):
            typer.echo(f"warning: rate equations: {warning}")
    for remark in outcome.remarks:
        say(remark)
    say(f"results, figures and report.html are in {directory.path}")
