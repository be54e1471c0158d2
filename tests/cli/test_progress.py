from __future__ import annotations

import math
from dataclasses import dataclass

import pytest

from smolux.cli import console
from smolux.cli.progress import Display, line
from smolux.cli.signals import Stopper


@dataclass
class At:
    fraction: float
    events: int = 1_234_567
    events_per_second: float = 2.5e6
    seconds_left: float = 83.0
    compile_seconds: float = 0.0
    bounds_seconds: float = 0.0


def test_a_line_says_all():
    assert line(At(0.43)) == "43 %, 1.23 M events, 2.5 M events/s, 1 min 23 s left"
    assert line(At(0.0, seconds_left=math.nan)) == "0 %, 1.23 M events, 2.5 M events/s"
    assert line(At(1.0, events=12, events_per_second=3.0), "steps").endswith(
        "3 steps/s, 1 min 23 s left"
    )


def test_without_a_terminal_there_is_a_line_now_and_then(capsys):
    now = [0.0]
    with Display(terminal=False, every=10.0, clock=lambda: now[0]) as display:
        for second in range(35):
            now[0] = second
            display(At(second / 35, compile_seconds=1.5))
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "compiled in 1.5 s"
    assert [text.split(" %")[0] for text in lines[1:]] == ["29", "57", "86"]


def test_bounds_that_take_long_are_told_now_and_then(capsys):
    with Display(terminal=False) as display:
        for second in (0.1, 0.6, 0.9, 1.3, 2.0):
            display(At(0.5, bounds_seconds=second))
    lines = capsys.readouterr().err.splitlines()
    assert lines == [f"bounds of the rates: {x} s so far" for x in ("0.6", "1.3")]


def test_in_a_terminal_there_is_a_bar(capsys):
    with Display(terminal=True) as display:
        display(At(0.25, compile_seconds=2.0))
    error = capsys.readouterr().err
    assert "compiled in 2 s" in error
    assert "25%" in error
    assert "2.5 M events/s" in error


def test_the_display_can_stop_the_run():
    stopper = Stopper()
    with Display(check=stopper.check, terminal=False) as display:
        display(At(0.1))
        stopper.requested = "SIGTERM"
        with pytest.raises(KeyboardInterrupt):
            display(At(0.2))


def test_a_stop_waits_where_something_would_be_lost():
    import signal

    before = signal.getsignal(signal.SIGTERM)
    with Stopper() as stopper:
        stopper.patient = True
        signal.raise_signal(signal.SIGTERM)
        assert stopper.requested == "SIGTERM"
        with pytest.raises(KeyboardInterrupt):
            stopper.check()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
    with Stopper() as stopper, pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0123, "0.012 s"),
        (3.24, "3.2 s"),
        (12.3, "12 s"),
        (59.7, "1 min 0 s"),
        (250, "4 min 10 s"),
        (7500, "2 h 5 min"),
        (4e5, "4.6 days"),
        (math.nan, "unknown"),
    ],
)
def test_durations(seconds, text):
    assert console.duration(seconds) == text


def test_amounts():
    assert console.amount(999) == "999"
    assert console.amount(12_345_678) == "12.3 M"
    assert console.amount(2.5e9, "B") == "2.5 GB"
    assert console.amount(12, "B") == "12 B"
