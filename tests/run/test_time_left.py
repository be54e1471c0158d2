"""What is told of a run while it lasts."""

from __future__ import annotations

from typing import Any

import pytest
import runs

from shared import QUICK
from smolux.stochastic.driving import Run


def test_the_time_left_is_what_the_rest_will_take() -> None:
    """A quarter in 100 seconds, without those of the compilation, leaves 300."""
    told: list[Any] = []
    plan = runs.plan(runs.model(0.1), [1.0], QUICK[0], replicas=4)
    run = Run(plan, [], told.append, 1)
    run.started -= 150.0
    run.compile_seconds = 50.0
    run.report(1.0, 10, 5.0)
    (progress,) = told
    assert progress.fraction == 0.25
    assert progress.seconds_left == pytest.approx(300.0, rel=0.05)
