"""Stopping on request, Ctrl-C and other signals, where nothing is lost by it."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any

#: what asks a program to stop: Ctrl-C, the system, a closed terminal
ALL = ("SIGINT", "SIGTERM", "SIGHUP")
_NEXT = "stopping at the next safe point; once more to stop at once"


class AtOnce(KeyboardInterrupt):
    """A stop that did not wait: what was under way may not be complete."""


class Stopper:
    """Within it a signal asks for a stop; `check` makes one, where nothing is lost by it.

    Python raises `KeyboardInterrupt` wherever a signal comes, and that is mostly right after a
    compiled loop, before what the loop did is kept. Here the first signal is kept until the next
    `check` while `patient` is set, else it raises `AtOnce`, as a second one always does.
    Signals that somebody else handles or ignores are left alone.

    Parameters
    ----------
    names : sequence of str
        Names of signals.
    patient : bool
        Whether a stop waits for `check`, until this is changed.
    say : callable, optional
        Told, in words, that a stop waits.

    Attributes
    ----------
    requested : str
        Name of the signal that came, or nothing.
    patient : bool
        Whether a stop waits for `check`.
    """

    def __init__(
        self,
        names: tuple[str, ...] = ("SIGINT",),
        *,
        patient: bool = True,
        say: Callable[[str], None] | None = None,
    ) -> None:
        self.names, self.patient, self.say = names, patient, say
        self.requested = ""
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Stopper:
        if threading.current_thread() is threading.main_thread():
            for name in self.names:
                number = getattr(signal, name, None)  # not every system has all of them
                usual = (signal.SIG_DFL, signal.default_int_handler)
                if number is not None and signal.getsignal(number) in usual:
                    self._before[number] = signal.signal(number, self._receive)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _receive(self, number: int, frame: FrameType | None) -> None:
        again = bool(self.requested)
        self.requested = signal.Signals(number).name
        if again or not self.patient:
            raise AtOnce
        if self.say is not None:
            self.say(_NEXT)

    def check(self) -> None:
        """Stop here if that was asked for.

        Raises
        ------
        KeyboardInterrupt
        """
        if self.requested:
            raise KeyboardInterrupt
