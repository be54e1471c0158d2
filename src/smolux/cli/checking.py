"""The text of ``smolux check``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from smolux.case import Case, Parallel, Run
from smolux.case.physics import model_tables
from smolux.case.settings import as_table
from smolux.case.write import value
from smolux.errors import InputError
from smolux.runtime.executors import check_installed
from smolux.runtime.resources import cores
from smolux.settings import SolverSettings
from smolux.stochastic.planning import make_plan

from .console import amount, duration
from .estimate import estimate, negative_rates, physics_warnings


def text(case: Case, source: str) -> str:
    """Say what a case is, what it will cost and what to beware of.

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
        cost = estimate(case)
        warnings = cost.warnings
        lines += [
            f"collisions   about {amount(cost.collisions)}, in {case.run.replicas} replicas"
            + (" at the start" if case.run.target_error is not None else ""),
            f"time         about {duration(cost.seconds)} on {cores()} cores, and a few seconds "
            "to compile",
            f"memory       about {amount(cost.memory, 'B')}",
            f"output       up to {amount(cost.output, 'B')}",
        ]
    lines += ["", *(f"warning: {w}" for w in warnings)] if warnings else ["", "No warnings."]
    return "\n".join(lines)


def refusals(case: Case) -> list[str]:
    """Find what a run of the case would refuse before it begins, such as for want of memory."""
    plans: list[Callable[[], object]] = [partial(check_installed, case.parallel.executor)]
    if case.run is not None:
        given = case.run.arguments()
        if given["weighting"] == "auto":  # a pilot finds it, and hardly differs in what it needs
            given["weighting"] = "number"
        plans.append(partial(make_plan, case.model, **given))
    if case.solve is not None:
        plans.append(partial(SolverSettings.for_model, case.model, case.solve_arguments()))
    found = []
    for plan in plans:
        try:
            plan()
        except InputError as error:
            found += error.problems
    return found


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
