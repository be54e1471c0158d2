"""Ctrl-C between two slices of a run, where its state and its log agree."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType


class CtrlC:
    """Within it Ctrl-C waits for the next `check`; a second one does not wait.

    Python raises it wherever it comes, and that is mostly right after a compiled loop, before the
    events of that loop are kept. Handlers that somebody else has set are left alone.

    Attributes
    ----------
    impatient : bool
        Whether a second one came: state and log may not agree.
    """

    def __init__(self) -> None:
        self.asked = self.impatient = self._mine = False

    def __enter__(self) -> CtrlC:
        own = threading.current_thread() is threading.main_thread()
        if own and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._receive)
            self._mine = True
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._mine:
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def _receive(self, number: int, frame: FrameType | None) -> None:
        if self.asked:
            self.impatient = True
            raise KeyboardInterrupt
        self.asked = True

    def check(self) -> None:
        """Stop here if that was asked for.

        Raises
        ------
        KeyboardInterrupt
        """
        if self.asked:
            raise KeyboardInterrupt
