"""``smolux compare``: the same case by several methods and the solver."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

import smolux
from smolux.case import Case, load
from smolux.cli import console
from smolux.cli.options import Overrides
from smolux.cli.progress import Display
from smolux.errors import InputError, Interrupted, SolverError, did_you_mean, quiet
from smolux.methods import NAMES
from smolux.settings.solution import OBSERVED

SOLVER = "solver"
EXACT: Literal["exact"] = "exact"


@dataclass(frozen=True)
class Computed:
    """One result of the case.

    Attributes
    ----------
    name : str
        The method, or the solver.
    ds : xarray.Dataset
    seconds, compile_seconds : float
        Wall time without compilation, and the compilation.
    collisions : float
        In all replicas; NaN for the solver.
    """

    name: str
    ds: Any
    seconds: float
    compile_seconds: float
    collisions: float


def choose(methods: Sequence[str] | None, carried: bool = False) -> list[str]:
    """Return the methods to compare: those given, or all that can and the solver.

    Not all can if something is `carried` by the particles.

    Raises
    ------
    InputError
        If one is unknown.
    """
    known = [*NAMES, SOLVER]
    wrong = [m for m in methods or () if m not in known]
    if wrong:
        raise InputError([f"--method {m}: unknown{did_you_mean(m, known)}" for m in wrong])
    if carried and not methods:
        methods = [m.name for m in smolux.methods.METHODS if m().carrying() is not None]
        return [*methods, SOLVER]
    return list(dict.fromkeys(methods or known))


def compute(
    case: Case, methods: Sequence[str], display: Callable[..., Display] = Display
) -> list[Computed]:
    """Compute a case by every method, each with random numbers of its own.

    Parameters
    ----------
    case : Case
        With a table ``[run]`` and its seed.
    methods : sequence of str
        As `choose` returns them.
    display : callable
        Makes the display of progress.

    Raises
    ------
    Interrupted
        At the time limit.
    """
    found = []
    for number, name in enumerate(methods):
        console.say(f"{name} ...")
        if name == SOLVER:
            with display(first="solving") as progress:
                try:
                    found.append(_solved(case, progress))
                except SolverError as error:
                    console.say(f"{SOLVER}: left out: {error}")
        else:
            with display() as progress:
                found.append(_simulated(case, name, number, progress))
    for computed in found:
        for text in smolux.results.warnings(computed.ds):
            console.say(f"{computed.name}: warning: {text}")
    return found


def _simulated(case: Case, name: str, number: int, progress: Display) -> Computed:
    run = case.run
    assert run is not None
    assert run.seed is not None
    settings = replace(run, method=name, seed=run.seed + number).arguments()
    with quiet():  # they are said in words of the command line
        ds = smolux.simulate(case.model, **settings, time_limit=run.time_limit, progress=progress)
    if not ds.attrs["complete"]:
        raise Interrupted(f"{name}: {ds.attrs['stopped']}: raise run.time_limit, or leave it out")
    compiling = float(ds.attrs["compile_seconds"])
    wall = float(ds.attrs["wall_seconds"]) - compiling
    return Computed(name, ds, wall, compiling, float(ds.attrs["events"]))


def _solved(case: Case, progress: Display) -> Computed:
    run = case.run
    assert run is not None
    settings = {name: getattr(run, name) for name in ("times", *OBSERVED)} | {"tolerance": 1e-6}
    if case.model.reduced.kernel.gels and case.model.only_aggregates:
        settings["gel"] = "reacts"  # as it does in a simulation
    if case.solve is not None:
        settings = case.solve_arguments()
    begun = time.perf_counter()
    with quiet():
        ds = smolux.solve(case.model, **settings, progress=progress)
    wall = time.perf_counter() - begun
    compiling = float(ds.attrs.get("compile_seconds", 0.0))
    return Computed(SOLVER, ds, wall - compiling, compiling, float("nan"))


def reference(found: Sequence[Computed]) -> tuple[str, Any]:
    """Choose what the others are compared with: the exact solution, the solver, or the first."""
    first = found[0]
    if smolux.analysis.exact_dataset(first.ds) is not None:
        return EXACT, EXACT
    by_name = {c.name: c for c in found}
    best = by_name.get(SOLVER, first)
    return best.name, best.ds


def rows(found: Sequence[Computed]) -> tuple[str, list[tuple[str, ...]], bool]:
    """Compare results with their reference.

    Returns
    -------
    name : str
        Of the reference.
    rows : list of tuple of str
        Method, time, collisions per second, largest deviation and where, p, verdict.
    agree : bool
        Whether all agree.
    """
    name, standard = reference(found)
    table, agree = [], True
    tests = max(sum(c.name not in (name, SOLVER) for c in found), 1)
    for each in found:
        speed = each.collisions / each.seconds if each.seconds > 0 else float("nan")
        cells = [each.name, console.duration(each.seconds)]
        cells.append("-" if speed != speed else f"{console.amount(speed)}/s")
        if each.name == name or (each.name == SOLVER and name == EXACT):
            table.append((*cells, *_deterministic(each, name)))
            continue
        test = smolux.analysis.compare(each.ds, standard).attrs
        known, words = smolux.analysis.verdict(test, tests)
        agree = agree and known != 0
        where = f"{test['largest_sigmas']:.1f} in {test['where']}" if test["where"] else "-"
        words = words.upper() if known == 0 else words
        table.append((*cells, where, f"{test['p_value']:.2g}", words))
    return name, table, agree


def _deterministic(each: Computed, name: str) -> tuple[str, str, str]:
    """Cells of the reference, or of the solver beside the exact solution: no sigmas, a ratio."""
    if each.name == name:
        return "-", "-", "reference"
    relative = smolux.analysis.compare(each.ds, EXACT)["moment"].sel(statistic="relative")
    return f"{float(abs(relative).max()):.1e} relative, in the moments", "-", "no scatter"


def compared(case: Case, methods: Sequence[str] | None, figure: Path | None) -> bool:
    """Compute a case by several methods, print how they compare, and draw it if wanted.

    Returns
    -------
    bool
        Whether all agree.

    Raises
    ------
    InputError
        If the case has no table ``[run]``, a method is unknown, or the figure cannot be written.
    """
    if case.run is None:
        raise InputError("compare: the case has no table [run], so there is nothing to simulate")
    seeded = case.with_seed()
    assert seeded.run is not None
    chosen = choose(methods, bool(case.model.attributes))
    if figure is not None:
        from smolux.plotting.style import kind_of

        kind_of(figure)  # before all that would be lost
    console.say(f"seed {seeded.run.seed}")
    found = compute(seeded, chosen)
    if not found:
        raise InputError("compare: nothing could be computed")
    name, table, agree = rows(found)
    console.table(
        ("method", "time", "collisions", "largest deviation (σ)", "p", ""), table, left=(0, 3, 5)
    )
    print(
        f"Compared with {'the exact solution' if name == EXACT else name}, at all times: moments "
        "and size densities.\nTimes are without compilation. Equal results are said to differ in "
        "1 of 100 tables or fewer."
    )
    if figure is not None:
        smolux.plotting.save(smolux.plotting.comparison({c.name: c.ds for c in found}), figure)
        print(f"{figure} written")
    return agree


def compare(
    case: Annotated[Path, typer.Argument(help="The case file.")],
    overrides: Overrides = None,
    method: Annotated[
        list[str] | None,
        typer.Option("--method", "-m", help="Only these methods; all and the solver if left out."),
    ] = None,
    figure: Annotated[
        Path | None, typer.Option("--figure", "-f", help="Draw the comparison into this file.")
    ] = None,
) -> None:
    """Run a case by every method and the solver: differences in sigmas, and the time of each.

    Ends with 1 if a method differs.
    """
    if not compared(load(case, overrides or ()), method, figure):
        raise typer.Exit(1)
