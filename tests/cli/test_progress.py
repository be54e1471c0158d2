from __future__ import annotations

import math
import pickle
from typing import Any

import pytest

import smolux as sx
from shared import FORMULA
from smolux.cli import console
from smolux.cli.progress import Display, line
from smolux.runtime.progress import Progress
from smolux.runtime.stopping import ALL, AtOnce, Stopper


def at(fraction: float, events: int = 1_234_567, speed: float = 2.5e6, **known: Any) -> Progress:
    known = {"seconds_left": 83.0, **known}
    return Progress(fraction, "simulating", events, events_per_second=speed, **known)


def test_a_line_says_all():
    assert line(at(0.43)) == "43 %, 1.23 M events, 2.5 M events/s, 1 min 23 s left"
    assert line(at(0.0, seconds_left=math.nan)) == "0 %, 1.23 M events, 2.5 M events/s"
    assert line(at(1.0, events=12, speed=3.0, unit="steps")).endswith("3 steps/s, 1 min 23 s left")


def test_without_a_terminal_there_is_a_line_now_and_then(capsys):
    now = [0.0]
    with Display(terminal=False, every=10.0, clock=lambda: now[0]) as display:
        for second in range(35):
            now[0] = second
            display(at(second / 35, compile_seconds=1.5))
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "compiled in 1.5 s"
    assert [text.split(" %")[0] for text in lines[1:]] == ["29", "57", "86"]


def test_bounds_that_take_long_are_told_now_and_then(capsys):
    with Display(terminal=False) as display:
        for second in (0.1, 0.6, 0.9, 1.3, 2.0):
            display(at(0.5, bounds_seconds=second))
    lines = capsys.readouterr().err.splitlines()
    assert lines == [f"bounds of the rates: {x} s so far" for x in ("0.6", "1.3")]


def test_in_a_terminal_there_is_a_bar(capsys):
    with Display(terminal=True) as display:
        display(at(0.25, compile_seconds=2.0))
    error = capsys.readouterr().err
    assert "compiled in 2 s" in error
    assert "25%" in error
    assert "2.5 M events/s" in error


def test_the_display_can_stop_the_run():
    stopper = Stopper()
    with Display(check=stopper.check, terminal=False) as display:
        display(at(0.1))
        stopper.requested = "SIGTERM"
        with pytest.raises(KeyboardInterrupt):
            display(at(0.2))


def test_a_stop_waits_where_something_would_be_lost():
    import signal

    before = signal.getsignal(signal.SIGTERM)
    with Stopper(ALL, patient=True) as stopper:
        signal.raise_signal(signal.SIGTERM)
        assert stopper.requested == "SIGTERM"
        with pytest.raises(KeyboardInterrupt):
            stopper.check()
        with pytest.raises(AtOnce):
            signal.raise_signal(signal.SIGTERM)
    with Stopper(ALL, patient=False), pytest.raises(AtOnce):
        signal.raise_signal(signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) is before


def test_signals_of_others_are_left_alone():
    """As one guard within another is, and a program that handles them itself."""
    import signal

    # in the background of a shell it is ignored, and is left so
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with Stopper(ALL) as outer, Stopper() as inner:
            signal.raise_signal(signal.SIGINT)
            assert (outer.requested, inner.requested) == ("SIGINT", "")
            inner.check()
            with pytest.raises(KeyboardInterrupt):
                outer.check()
    finally:
        signal.signal(signal.SIGINT, before)


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


def test_one_function_serves_all(capsys: pytest.CaptureFixture[str]) -> None:
    """Whatever is computed, a display shows it and says in words what is known of it alone."""
    seen: list[Progress] = []
    model = sx.Model(sx.kernels.formula(FORMULA, c0=1.0, c1=0.0, c2=0.0, c3=0.0))
    breaking = sx.processes.Shattering(0.3)
    steady = sx.Model(sx.kernels.Constant(), [sx.processes.Aggregation(), breaking])
    small = {"method": "acceptance-rejection", "particles": 1000, "replicas": 2, "seed": 1}

    with Display(terminal=False, every=0.0) as display:

        def both(progress: Progress) -> None:
            display(progress)
            seen.append(progress)

        sx.simulate(model, [1.0], progress=both, **small)
        sx.ensemble(model, [1.0], ["M0"], progress=both, **small)
        sx.deterministic.steady_state(steady, progress=both)
        sx.spatial.simulate(sx.spatial.lattice(100, 0.2, seed=3), progress=both)
    what = list(dict.fromkeys(p.what for p in seen))
    assert what == ["simulating", "sampling", "looking for a steady state"]
    assert seen[-1].clusters == seen[-1].counts["clusters"] == 1
    assert seen[-1] == seen[-1].fraction == 1.0  # it is the number itself, too
    told = capsys.readouterr().err
    assert "1 clusters left" in told
    assert "nan" not in told
    assert pickle.loads(pickle.dumps(seen[-1])).clusters == 1
    with pytest.raises(AttributeError, match="a Progress of simulating has no window"):
        _ = seen[-1].window
