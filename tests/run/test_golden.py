"""A change that only moves or renames leaves every trajectory as it was, see `golden`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent.parent / "spatial"))

import golden

EXPECTED = json.loads(golden.PATH.read_text())


def assert_same(found: list[dict[str, Any]], expected: list[dict[str, Any]]) -> None:
    """Compare all but times exactly, and these to what logarithms may differ by."""
    for ours, theirs in zip(found, expected, strict=True):
        assert {**ours, "times": None} == {**theirs, "times": None}
        np.testing.assert_allclose(
            np.array(ours["times"], float), np.array(theirs["times"], float), rtol=1e-9
        )


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, marks=() if fast else pytest.mark.slow)
        for case, (*_, fast) in golden.CASES.items()
    ],
)
def test_trajectories(case: str) -> None:
    expected = EXPECTED["trajectories"][case]
    for budget in (1000, 7):
        assert_same(golden.trajectories(case, budget), expected)


@pytest.mark.parametrize("case", golden.FLIGHTS)
def test_flights(case: str) -> None:
    assert_same(golden.flights(case), EXPECTED["flights"][case])


@pytest.mark.parametrize("processes", golden.PROCESSES)
def test_moments(processes: str) -> None:
    """To a tenth of the tolerance: transforms are rounded in another way elsewhere."""
    expected = EXPECTED["moments"][processes]
    np.testing.assert_allclose(golden.moments(processes), expected, rtol=1e-9)


def test_nothing_is_left_out_and_nothing_is_trivial() -> None:
    assert set(EXPECTED["trajectories"]) == set(golden.CASES)
    doubled = 0
    for case, replicas in EXPECTED["trajectories"].items():
        assert min(sum(each["events"]) for each in replicas) > 20, case
        assert len({each["random"] for each in replicas}) == 3, case
        doubled += any(each["doublings"] for each in replicas)
    assert doubled > len(golden.CASES) // 4
