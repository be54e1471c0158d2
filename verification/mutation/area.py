"""The mistakes of one area of the code, tried one after the other on every core."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from smolux.resources import cores

from ..outcome import Check, Item, Outcome, Table
from ..suite import ROOT
from .mistakes import Mistake, read
from .trial import BrokenTrialError, Copy

#: the share of mistakes that the fast suite sees
GOAL = 0.95


def tried(copy: Copy, mistake: Mistake) -> dict[str, Any]:
    """Try one mistake: which test of the fast suite sees it, or else which slow one."""
    begun = time.perf_counter()
    with copy.mistaken(mistake):
        by, suite = copy.failing(mistake.tests), "fast"
        if not by and mistake.slow:
            by, suite = copy.failing(mistake.slow, slow=True), "slow"
    return {
        "file": mistake.file,
        "what": mistake.what,
        "suite": suite if by else "none",
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
    failed = copy.failing(names, slow=slow)
    if failed:
        raise BrokenTrialError(f"fails without a mistake: {failed}")


def compute(area: str, quick: bool, root: Path = ROOT) -> dict[str, Any]:
    """Try all mistakes of an area; two of them in a quick run."""
    mistakes = read(area)[: 2 if quick else None]
    with tempfile.TemporaryDirectory() as scratch:
        workers = cores()
        copies: SimpleQueue[Copy] = SimpleQueue()
        for k in range(workers):
            copies.put(Copy.of(root, Path(scratch) / str(k), Path(scratch) / "compiled"))

        def on_a_copy(action: Callable[[Copy, Any], Any], argument: Any) -> Any:
            copy = copies.get()
            try:
                return action(copy, argument)
            finally:
                copies.put(copy)

        def each(action: Callable[[Copy, Any], Any], arguments: Iterable[Any]) -> list[Any]:
            return list(pool.map(partial(on_a_copy, action), arguments))

        with ThreadPoolExecutor(workers) as pool:
            distinct = {(m.tests, False): None for m in mistakes}
            distinct |= {(m.slow, True): None for m in mistakes if m.slow}
            each(pass_unchanged, distinct)
            return {"mistakes": each(tried, mistakes)}


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
            number["fast"] >= GOAL * len(found) - 1,
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
