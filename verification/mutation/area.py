"""The mistakes of one area of the code, tried one after the other on every core."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import astuple
from functools import partial
from itertools import pairwise
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from smolux.runtime.resources import cores
from verification.outcome import Check, Item, Outcome, Table
from verification.suite import ROOT

from .mistakes import Mistake, read
from .records import Records
from .trial import PATIENCE, BrokenTrialError, Copy

#: the share of mistakes that the fast suite sees
GOAL = 0.95


def tried(copy: Copy, mistake: Mistake) -> dict[str, Any]:
    """Try one mistake: which test of the fast suite sees it, or else which slow one."""
    begun = time.perf_counter()
    with copy.mistaken(mistake) as wrong:
        by, suite = wrong.failing(mistake.tests), "fast"
        if not by and mistake.slow:
            by, suite = wrong.failing(mistake.slow, slow=True), "slow"
    if not by:
        suite = "none"
    return {
        "file": mistake.file,
        "what": mistake.what,
        "suite": suite,
        "by": by,
        "seconds": time.perf_counter() - begun,
    }


def pass_unchanged(copy: Copy, tests: tuple[tuple[str, ...], bool]) -> None:
    """Run tests without a mistake.

    Raises
    ------
    BrokenTrialError
        One fails.
    """
    names, slow = tests
    failed = copy.failing(names, slow=slow, patience=PATIENCE * len(names))
    if failed:
        raise BrokenTrialError(f"fails without a mistake: {failed}")


def _tests(mistakes: Sequence[Mistake]) -> dict[tuple[str, bool], None]:
    """Return all tests of mistakes once, those of a file together, and whether they are slow."""
    named = {(test, False) for m in mistakes for test in m.tests}
    return dict.fromkeys(sorted(named | {(test, True) for m in mistakes for test in m.slow}))


def _check_tests(
    records: Records, mistakes: Sequence[Mistake], parts: int, each: Callable[..., Any]
) -> None:
    """See that all tests pass without a mistake, those of which it is not known yet."""
    files = {test: records.of([test[0]], test) for test in _tests(mistakes)}
    left = [test for test, file in files.items() if records.known(file) is None]
    groups = []
    for slow in (False, True):
        names = [name for name, kind in left if kind == slow]
        cuts = [len(names) * k // parts for k in range(parts + 1)]
        groups += [(tuple(names[a:b]), slow) for a, b in pairwise(cuts) if b > a]
    each(pass_unchanged, groups)
    for test in left:
        records.note(files[test], True)


def compute(area: str, quick: bool, root: Path = ROOT) -> dict[str, Any]:
    """Try all mistakes of an area; two of them in a quick run."""
    mistakes = read(area)[: 2 if quick else None]
    workers = cores()
    with ExitStack() as stack:
        scratch = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        # what was compiled for a mistake before is right still: it is kept by what it was made of
        given = os.environ.get("SMOLUX_CACHE_DIR")
        kept = Path(given) / "mistakes" if given else scratch / "kept"
        copies: SimpleQueue[Copy] = SimpleQueue()
        for k in range(workers):
            copies.put(stack.enter_context(Copy.of(root, scratch / str(k), kept / "compiled")))
        records = Records(scratch / "0", kept / "trials")

        def on_a_copy(action: Callable[[Copy, Any], Any], argument: Any) -> Any:
            copy = copies.get()
            try:
                return action(copy, argument)
            finally:
                copies.put(copy)

        def each(action: Callable[[Copy, Any], Any], arguments: Iterable[Any]) -> list[Any]:
            return list(pool.map(partial(on_a_copy, action), arguments))

        def tried_once(copy: Copy, mistake: Mistake) -> dict[str, Any]:
            file = records.of((*mistake.tests, *mistake.slow), astuple(mistake))
            found: dict[str, Any] = records.known(file) or records.note(file, tried(copy, mistake))
            print(f"  {mistake.what}: {found['by'] or 'not seen'}", flush=True)
            return found

        pool = stack.enter_context(ThreadPoolExecutor(workers))
        _check_tests(records, mistakes, workers, each)
        return {"mistakes": each(tried_once, mistakes)}


def present(area: str, data: dict[str, Any]) -> Outcome:
    """Make the table of an area."""
    found = data["mistakes"]
    number = {suite: sum(m["suite"] == suite for m in found) for suite in ("fast", "slow", "none")}
    rows = [
        [f"`{m['file']}`", m["what"], f"`{m['by']}`" if m["by"] else "**not seen**", m["suite"]]
        for m in found
    ]
    unseen = [m["what"] for m in found if m["suite"] == "none"]
    checks = [
        Check(
            "mistakes that the fast tests see",
            f"{number['fast']} of {len(found)}",
            f"{GOAL:.0%}",
            f"{len(found) - number['fast']} others in this area",
            number["fast"] >= GOAL * len(found),
        ),
        Check(
            "mistakes that no test sees", "; ".join(unseen) or "none", "none", "none", not unseen
        ),
    ]
    return Outcome(
        f"{len(found)} mistakes in {area}: {number['fast']} seen by the fast tests, "
        f"{number['slow']} by slow ones, {number['none']} by none.",
        checks=checks,
        tables=[
            Table(f"Mistakes in {area}", ["file", "mistake", "first test to fail", "suite"], rows)
        ],
    )


def total(values: dict[str, Any]) -> str:
    """Say how many mistakes of all areas are seen."""
    found = [m["suite"] for area in values.values() for m in area["mistakes"]]
    fast, slow = found.count("fast"), found.count("slow")
    share = fast / max(len(found), 1)
    return (
        f"**Of {len(found)} mistakes that were tried the fast tests see {fast} ({share:.1%}), slow "
        f"ones {slow} more, and none sees {found.count('none')}. The goal is {GOAL:.0%}.**"
    )


def item(area: str) -> Item:
    """Return an area as an item of the suite."""
    return Item(area, f"Mistakes in {area}", partial(compute, area), partial(present, area))
