"""Stopping on request: Ctrl-C, SIGTERM, a closed terminal."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any

from . import console

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP")


class Stopper:
    """Within it a signal asks for a stop; `check` makes one, where nothing is lost by it.

    The first signal is kept until the next `check` while `patient` is set, else it raises at once.
    A second one always raises at once.

    Attributes
    ----------
    requested : str
        Name of the signal that came, or nothing.
    patient : bool
        Whether a stop waits for `check`.
    """

    def __init__(self) -> None:
        self.requested = ""
        self.patient = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Stopper:
        if threading.current_thread() is threading.main_thread():
            for name in _NAMES:
                number = getattr(signal, name, None)
                if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
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
            raise KeyboardInterrupt
        console.say("stopping at the next safe point; once more to stop at once")

    def check(self) -> None:
        """Stop here if that was asked for.

        Raises
        ------
        KeyboardInterrupt
        """
        if self.requested:
            raise KeyboardInterrupt
