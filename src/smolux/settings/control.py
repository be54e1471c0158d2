"""What drives a run, and decides no number of its result."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError, Problem
from .kinds import Called, File, Kind, Seconds, checked, setting


class _Executor(Kind):
    """What takes tasks, or None."""

    def check(self, key: str, value: Any) -> Any:
        """See `Kind`."""
        if value is None or callable(getattr(value, "submit", None)):
            return value
        cure = "must be a concurrent.futures.Executor, or None for threads"
        raise InputError([Problem(key, cure, value)])


@dataclass(frozen=True)
class Control:
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
    def checked(cls, given: Mapping[str, Any]) -> tuple[Control, list[str]]:
        """Return the arguments, as far as they are right, and what is wrong with the others."""
        good, problems = checked(cls, given)
        executor = good.get("executor")
        if executor is not None and not isinstance(executor, ThreadPoolExecutor):
            cure = "is only for runs on threads of this process; leave it out, or the executor"
            problems += [
                Problem(name, cure, given[name])
                for name in ("checkpoint", "time_limit")
                if given.get(name) is not None
            ]
        return cls(**good), problems
