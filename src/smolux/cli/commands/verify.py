"""``smolux verify``: whether every method obeys the exact laws on this machine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer

from smolux import conformance
from smolux.cli.console import duration, say
from smolux.conformance import Finding
from smolux.errors import InputError, did_you_mean
from smolux.methods import NAMES


def verified(methods: Sequence[str] | None, seed: int) -> bool:
    """Run all checks and print a table of the findings.

    Returns
    -------
    bool
        Whether all were passed.

    Raises
    ------
    InputError
        If there is no such method.
    """
    known = list(NAMES)
    wrong = [m for m in methods or () if m not in known]
    if wrong:
        raise InputError([f"--method {m}: unknown{did_you_mean(m, known)}" for m in wrong])
    say(f"seed {seed}; about a minute, more where the methods are compiled for the first time")
    found: list[Finding] = []
    for finding in conformance.verify(methods or known, seed):
        if not found or finding.method != found[-1].method:
            print(f"\n{finding.method}\n{HEADER}\n{'-' * len(HEADER)}")
        print(row(finding), flush=True)
        found.append(finding)
    failed = [f for f in found if not f.passed]
    total = duration(sum(f.seconds for f in found))
    if failed:
        print(f"\n{len(failed)} of {len(found)} checks FAILED ({total}).")
        say("Please report this with the tables above; do not trust results on this machine.")
    else:
        print(f"\nAll {len(found)} checks passed ({total}).")
    return not failed


def _columns(*cells: str) -> str:
    law, measured, expected, p, verdict, seconds = cells
    return f"{law:26}  {measured:>13}  {expected:>13}  {p:>5}  {verdict:6}  {seconds:>6}"


HEADER = _columns("law", "measured", "exact", "p", "", "time")


def row(finding: Finding) -> str:
    """Write a finding as a line of the table."""
    return _columns(
        finding.check,
        finding.measured,
        finding.expected,
        f"{finding.p:.2g}" if finding.p > 1e-3 else f"{finding.p:.0e}",
        "passed" if finding.passed else "FAILED",
        f"{finding.seconds:.1f} s",
    )


def verify(
    method: Annotated[
        list[str] | None, typer.Option("--method", "-m", help="Only these methods.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of all checks.")] = 1,
) -> None:
    """Test every method against the exact laws: means, fluctuations, whole distributions, mass."""
    if not verified(method, seed):
        raise typer.Exit(1)
