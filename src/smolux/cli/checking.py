"""The text of ``smolux check``."""

from __future__ import annotations

from ..case import Case
from ..errors import InputError
from .console import amount, duration
from .estimate import cores, estimate, negative_rates, physics_warnings


def text(case: Case, source: str) -> str:
    """Say what a case is, what it will cost and what to beware of.

    Raises
    ------
    InputError
        For mistakes that only a look at the whole case finds.
    """
    wrong = negative_rates(case)
    if wrong:
        raise InputError([f"{source}: {w}" for w in wrong])
    lines = [f"{source} is valid.", "", *description(case), ""]
    warnings = physics_warnings(case)
    if case.run is not None:
        cost = estimate(case)
        warnings = cost.warnings
        lines += [
            f"collisions   about {amount(cost.collisions)}, in {case.run.replicas} replicas",
            f"time         about {duration(cost.seconds)} on {cores()} cores, and a few seconds "
            "to compile",
            f"memory       about {amount(cost.memory, 'B')}",
            f"output       up to {amount(cost.output, 'B')}",
        ]
    lines += ["", *(f"warning: {w}" for w in warnings)] if warnings else ["", "No warnings."]
    return "\n".join(lines)


def description(case: Case) -> list[str]:
    """Lines that say what is computed."""
    model, t = case.model, " s" if case.si else ""
    processes = ", ".join(
        p.name + ("" if p.factor.constant == 1 else f" ({p.factor.text})") for p in model.processes
    )
    lines = [f"title        {case.title}"] if case.title else []
    lines += [
        f"kernel       {model.kernel!r}",
        f"processes    {processes}",
        f"initial      {model.initial!r}",
        f"times        {len(case.times)}, up to {case.times[-1]:g}{t}",
    ]
    if case.run is not None:
        run = case.run
        lines.append(
            f"simulate     {run.method}, {run.particles} particles, {run.replicas} replicas, "
            f"{run.population}, seed {'new each time' if run.seed is None else run.seed}"
        )
    if case.solve is not None:
        lines.append(f"solve        {case.solve.method}, tolerance {case.solve.tolerance:g}")
    return lines
