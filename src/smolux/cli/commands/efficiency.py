"""``smolux efficiency``: what methods and weightings are worth for a case."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

import smolux
from smolux.case import Case, load
from smolux.cli import console
from smolux.cli.options import Overrides
from smolux.cli.progress import Display
from smolux.errors import InputError, Interrupted, did_you_mean
from smolux.weighting import NAMES, WeightFunction
from smolux.weighting.base import Weighting


def weightings_of(texts: Sequence[str]) -> list[str | Weighting]:
    """Read names of weightings; that of a weight function takes a power, as in ``name=0.5``.

    Raises
    ------
    InputError
        With all that are none.
    """
    known = list(NAMES)
    found: list[str | Weighting] = []
    problems = []
    for text in texts:
        name, _, power = text.partition("=")
        where = f"--weighting {text}"
        if name == WeightFunction.name:
            try:
                found.append(WeightFunction(float(power)))
            except ValueError:
                problems.append(f"{where}: give the power of the size, as in {name}=0.5")
            except InputError as error:
                problems += [f"{where}: {problem}" for problem in error.problems]
        elif power or name not in known:
            problems.append(f"{where}: unknown{did_you_mean(name, known)}")
        else:
            found.append(name)
    if problems:
        raise InputError(problems)
    return found


def measure(
    case: Case,
    methods: Sequence[str] | None,
    weightings: Sequence[str] | None,
    observables: Sequence[str] | None,
    figure: Path | None,
) -> None:
    """Measure efficiencies, print them as tables, and draw them if wanted.

    Raises
    ------
    InputError
        If the case has no table ``[run]``, a method, weighting or observable is unknown, or the
        figure cannot be written.
    """
    if case.run is None:
        raise InputError("efficiency: the case has no table [run], so there is nothing to simulate")
    seeded = case.with_seed()
    settings = seeded.run
    assert settings is not None
    chosen = weightings_of(weightings or ("number", "mass-flow"))
    if figure is not None:
        from smolux.plotting.style import kind_of

        kind_of(figure)  # before all that would be lost
    console.say(
        f"seed {settings.seed}, {settings.replicas:,} replicas of {settings.particles:,} particles"
    )
    try:
        with Display() as display:
            ds = smolux.ensembles.efficiency(
                seeded.model,
                methods or [settings.method],
                chosen,
                list(observables or dict.fromkeys([settings.target, "M2"])),
                times=settings.times,
                population=settings.population,
                particles=settings.particles,
                replicas=settings.replicas,
                seed=settings.seed,
                progress=display,
            )
    except (InputError, Interrupted) as early:
        if early.dataset is not None:
            _print(early.dataset)
        if isinstance(early, Interrupted):  # there is nothing to go on from
            raise KeyboardInterrupt from None
        raise
    _print(ds)
    if figure is not None:
        smolux.plotting.save(smolux.plotting.efficiency(ds), figure)
        print(f"{figure} written")


def _print(ds: Any) -> None:
    print(smolux.ensembles.efficiency_table(ds))
    print(
        f"Bias against: {ds.attrs['reference']}. Efficiency: 1 / (cost variance), over that of "
        "the first row as ratio. Times are processor seconds without compilation."
    )
    if not ds.attrs["complete"]:
        console.say(f"statistics of {ds.attrs['replicas']:,} replicas")


def efficiency(
    case: Annotated[Path, typer.Argument(help="The case file.")],
    overrides: Overrides = None,
    method: Annotated[
        list[str] | None,
        typer.Option("--method", "-m", help="Only these methods; that of the case if left out."),
    ] = None,
    weighting: Annotated[
        list[str] | None,
        typer.Option(
            "--weighting",
            "-w",
            help="Only these, such as mass-flow or weight-function=0.5; number and mass-flow if "
            "left out.",
        ),
    ] = None,
    observable: Annotated[
        list[str] | None,
        typer.Option("--observable", "-o", help="Such as M2 or n_50; the target of the case, M2."),
    ] = None,
    figure: Annotated[
        Path | None, typer.Option("--figure", "-f", help="Draw the efficiencies into this file.")
    ] = None,
) -> None:
    """Measure bias, variance, cost and efficiency with the particles and replicas of a case."""
    measure(load(case, overrides or ()), method, weighting, observable, figure)
