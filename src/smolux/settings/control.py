"""What drives a run, and decides no number of its result."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from smolux.errors import InputError, Problem

from .arguments import Arguments
from .kinds import Called, File, Kind, Seconds, setting


class _Executor(Kind):
    """What takes tasks, or None."""

    def check(self, key: str, value: Any) -> Any:
        if value is None or callable(getattr(value, "submit", None)):
            return value
        cure = "must be a concurrent.futures.Executor, or None for threads"
        raise InputError([Problem(key, cure, value)])


@dataclass(frozen=True)
class Control(Arguments):
    """Where a run is computed, whom it tells, when it is kept and when it ends.

    See `smolux.simulate`.
    """

    executor: Executor | None = setting(_Executor(), None)
    progress: Callable[[Any], None] | None = setting(
        Called("a function that takes a Progress"), None
    )
    checkpoint: Path | None = setting(File(), None)
    checkpoint_every: float = setting(Seconds(), 600.0)
    time_limit: float | None = setting(Seconds(optional=True), None)

    @classmethod
    def disagreements(cls, good: Mapping[str, Any]) -> list[str]:
        executor = good.get("executor")
        if executor is None or isinstance(executor, ThreadPoolExecutor):
            return []
        cure = "is only for runs on threads of this process; leave it out, or the executor"
        names = ("checkpoint", "time_limit")
        given = {n: good[n] for n in names if good.get(n) is not None}
        return [Problem(n, cure, str(v) if isinstance(v, Path) else v) for n, v in given.items()]
