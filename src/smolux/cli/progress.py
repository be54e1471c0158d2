"""How far a run is: a bar in a terminal, else a line now and then."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any

from smolux.runtime.progress import Progress

from .console import amount, duration, say


class Display:
    """Shows progress on standard error; called with a `Progress` a few times a second.

    Parameters
    ----------
    check : callable, optional
        Called each time; may raise to stop the run.
    terminal : bool, optional
        Whether there is a terminal for a bar; found out if left out.
    first : str
        What is done before anything is told, for the bar.
    every : float
        Seconds between two lines where there is no terminal.
    clock : callable
        Seconds.
    """

    def __init__(
        self,
        check: Callable[[], None] | None = None,
        terminal: bool | None = None,
        first: str = "compiling",
        every: float = 10.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.terminal = sys.stderr.isatty() if terminal is None else terminal
        self.check, self.first, self.every, self.clock = check, first, every, clock
        self.last: Progress | None = None
        self._due = self._bounds = 0.0
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> Display:
        if self.terminal:
            self._open_bar()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def __call__(self, progress: Progress) -> None:
        """Show how far the run is."""
        if self.last is None:
            self._due = self.clock() + self.every
            if progress.compile_seconds > 0.5:
                self._print(f"compiled in {duration(progress.compile_seconds)}")
        if progress.bounds_seconds > max(0.5, 2.0 * self._bounds):
            self._bounds = progress.bounds_seconds
            self._print(f"bounds of the rates: {duration(self._bounds)} so far")
        self.last = progress
        if self._bar is not None:
            self._bar.update(
                self._task, total=None if math.isnan(progress) else 1.0,
                completed=0.0 if math.isnan(progress) else progress, description=progress.what,
                rate=", ".join(p for p in (rate(progress), progress.note) if p),
                left=left(progress),
            )  # fmt: skip
        elif self.clock() >= self._due:
            self._due = self.clock() + self.every
            say(line(progress))
        if self.check is not None:
            self.check()

    def _print(self, text: str) -> None:
        if self._bar is not None:
            self._bar.console.print(text)
        else:
            say(text)

    def _open_bar(self) -> None:
        from rich.progress import BarColumn, TaskProgressColumn, TextColumn
        from rich.progress import Progress as Bar

        from .console import console

        self._bar = Bar(
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            TaskProgressColumn(),
            TextColumn("{task.fields[rate]}"),
            TextColumn("{task.fields[left]}"),
            console=console(True, self.terminal),
            transient=True,
        )
        self._task = self._bar.add_task(self.first, total=None, rate="", left="")
        self._bar.start()


def rate(progress: Progress) -> str:
    """Write the speed: ``"2.1 M events/s"``."""
    return f"{amount(progress.events_per_second)} {progress.unit}/s"


def left(progress: Progress) -> str:
    """Write the time left: ``"40 s left"``; nothing while it is not known."""
    known = not math.isnan(progress.seconds_left)
    return f"{duration(progress.seconds_left)} left" if known else ""


def line(progress: Progress) -> str:
    """Write all in a line: ``"43 %, 1.2 M events, 2.1 M events/s, 40 s left"``."""
    parts = (
        "" if math.isnan(progress) else f"{100 * progress:.0f} %",
        f"{amount(progress.events)} {progress.unit}",
        rate(progress),
        progress.note,
        left(progress),
    )
    return ", ".join(part for part in parts if part)
