"""``smolux check``: what a case is and what it will cost, before it is run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from smolux.case import Case, Parallel, Run, load, spatial
from smolux.case.model_tables import model_tables
from smolux.case.settings import as_table
from smolux.case.write import value
from smolux.cli import spatial_run
from smolux.cli.cautions import (
    all_warnings,
    negative_rates,
    output,
    physics_warnings,
    stores_at_most,
)
from smolux.cli.console import amount, duration
from smolux.cli.options import Overrides
from smolux.errors import InputError
from smolux.runtime.executors import check_installed
from smolux.runtime.resources import available_memory, cores
from smolux.settings import Settings, SolverSettings

#: the share of the memory below which no run is refused for want of it
_PLENTY = 0.25


def text(case: Case, source: str, cost: bool = False) -> str:
    """Say what a case is and what to beware of; what it will cost, if a pilot is to find that.

    Raises
    ------
    InputError
        For mistakes that only a look at the whole case finds.
    """
    wrong = negative_rates(case) or refusals(case)
    if wrong:
        raise InputError([f"{source}: {w}" for w in wrong])
    lines = [f"{source} is valid.", "", *description(case), ""]
    warnings = physics_warnings(case)
    if case.run is not None:
        warnings = all_warnings(case, case.run)
        needs, told = _costs(case, case.run) if cost else (_room(case, case.run), [])
        lines, warnings = lines + needs, warnings + told
    lines += ["", *(f"warning: {w}" for w in warnings)] if warnings else ["", "No warnings."]
    if case.run is not None and not cost:
        lines.append(f"How long it takes, by a small run: smolux check {source} --cost")
    return "\n".join(lines)


def _costs(case: Case, run: Run) -> tuple[list[str], list[str]]:
    """Lines that say what a case costs, by a pilot, and of what that has warned."""
    from smolux.cli.estimate import estimate  # a simulation, for which all is loaded

    found = estimate(case)
    start = " at the start" if run.target_error is not None else ""
    return [
        f"collisions   about {amount(found.collisions)}, in {run.replicas} replicas{start}",
        f"time         about {duration(found.seconds)} on {cores()} cores, and a few seconds "
        "to compile",
        f"memory       about {amount(found.memory, 'B')}",
        f"output       up to {amount(found.output, 'B')}",
    ], found.warnings


def _room(case: Case, run: Run) -> list[str]:
    observed = output(case, run)
    return [
        f"memory       up to {amount(stores_at_most(run) + observed, 'B')} at the start",
        f"output       up to {amount(observed, 'B')}",
    ]


def refusals(case: Case) -> list[str]:
    """Find what a run of the case would refuse before it begins, such as for want of memory."""
    tries: list[Callable[[], object]] = [partial(check_installed, case.parallel.executor)]
    if case.run is not None:
        tries.append(partial(_planned, case, case.run))
    if case.solve is not None:
        tries.append(partial(SolverSettings.for_model, case.model, case.solve_arguments()))
    found = []
    for attempt in tries:
        try:
            attempt()
        except InputError as error:
            found += error.problems
    return found


def _planned(case: Case, run: Run) -> None:
    """Plan the simulation, as far as there is something that a plan would refuse."""
    given, available = run.arguments(), available_memory()
    if given["weighting"] == "auto":  # a pilot finds it, and hardly differs in what it needs
        given["weighting"] = "number"
    Settings.for_model(case.model, given)
    most = stores_at_most(run) + output(case, run)
    if given["weighting"] != "number" or (available is not None and most > _PLENTY * available):
        from smolux.stochastic.make_plan import make_plan  # which loads Numba, for nothing else

        make_plan(case.model, **given)


def description(case: Case) -> list[str]:
    """Lines that say what is computed."""
    model, t = case.model, " s" if case.si else ""
    processes = ", ".join(
        p.called + ("" if p.factor.constant == 1 else f" ({p.factor.text})")
        for p in model.processes
    )
    tables = model_tables(model, case.si)
    lines = [f"title        {case.title}"] if case.title else []
    lines += [
        f"kernel       {_words(tables['kernel'])}",
        f"processes    {processes}",
        f"initial      {_words(tables['initial'])}",
        *(f"{a['name']:12s} {_words(a)}" for a in tables.get("attributes", ())),
        f"times        {len(case.times)}, up to {case.times[-1]:g}{t}",
    ]
    if case.run is not None:
        run = case.run
        lines.append(
            f"simulate     {run.method}, {run.particles} particles, {run.replicas} replicas, "
            f"{run.population}, seed {'new each time' if run.seed is None else run.seed}"
        )
        if run.weighting != Run.weighting:
            table = as_table(run)
            power = f", exponent {table['exponent']:g}" if "exponent" in table else ""
            power = f", for {run.target}" if run.weighting == "auto" else power
            lines.append(f"weighting    {table['weighting']}{power}")
        if run.target_error is not None:
            lines.append(
                f"until        the 95 % interval of {run.target} is ±{100 * run.target_error:g} %, "
                f"with at most {run.max_replicas} replicas"
            )
    if case.parallel != Parallel():
        lines.append(f"parallel     {_words(as_table(case.parallel))}")
    if case.solve is not None:
        lines.append(f"solve        {case.solve.method}, tolerance {case.solve.tolerance:g}")
    return lines


def _words(table: Mapping[str, Any]) -> str:
    """Write a table of the case in a line."""
    name = [str(table["name"])] if "name" in table else []
    return ", ".join([*name, *(f"{k} = {value(v)}" for k, v in table.items() if k != "name")])


def check(
    case: Annotated[Path, typer.Argument(help="The case file.")],
    overrides: Overrides = None,
    cost: Annotated[
        bool,
        typer.Option("--cost", "-c", help="Run it small, for time, extinction and growth, too."),
    ] = False,
) -> None:
    """Check a case: mistakes, gelation, memory and output; what it will cost, if that is asked."""
    in_space = spatial.load(case, overrides or ())
    if in_space is not None:
        typer.echo(spatial_run.described(in_space, str(case)))
        return
    typer.echo(text(load(case, overrides or ()), str(case), cost))
