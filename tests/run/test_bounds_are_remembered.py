"""Bounds are proved once for all groups, and never remembered of what may have changed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import smolux as sx
from smolux import remembered
from smolux.assembly import rates_for
from smolux.kernels import Additive
from smolux.weighting import MassFlow, Number, WeightFunction

BOXES = [np.array(side, float) for side in ([1, 2, 9], [1, 3, 11], [2, 2, 40], [4, 3, 47])]
height = 1.0


def step(i: float, j: float) -> float:
    return height * (i + j)


def weight(size: Any) -> Any:
    return height * size


@pytest.mark.parametrize("weighting", [Number(), MassFlow(), WeightFunction(0.5)])
def test_the_second_time_bounds_are_the_same_and_nothing_is_proved(
    monkeypatch: pytest.MonkeyPatch, weighting: Any
) -> None:
    kernel, calls = Additive(0.25), []
    plain = type(weighting).bounds

    def counted(self: Any, kernel: Any) -> Any:
        found = plain(self, kernel)
        return lambda *box: calls.append(box) or found(*box)

    monkeypatch.setattr(type(weighting), "bounds", counted)
    first, second = (rates_for(sx.Model(kernel), weighting).bounds(*BOXES) for _ in range(2))
    assert len(calls) == 1
    for one, other, right in zip(first, second, plain(weighting, kernel)(*BOXES), strict=True):
        np.testing.assert_array_equal(one, right)
        np.testing.assert_array_equal(other, right)
        one[:] = 0.0  # what is given away is a copy
    np.testing.assert_array_equal(
        rates_for(sx.Model(kernel), weighting).bounds(*BOXES)[0], second[0]
    )
    other_boxes = [side + 1.0 for side in BOXES]
    assert (rates_for(sx.Model(kernel), weighting).bounds(*other_boxes)[1] != second[1]).all()


@pytest.mark.parametrize("weighting", [Number(), WeightFunction(weight)])
def test_what_a_function_reads_may_change(monkeypatch: pytest.MonkeyPatch, weighting: Any) -> None:
    kernel = sx.kernels.from_function(step)
    before = rates_for(sx.Model(kernel), weighting).bounds(*BOXES)[1]
    monkeypatch.setitem(globals(), "height", 2.0)
    factor = 2.0 if isinstance(weighting, Number) else 1.0  # twice the kernel, half the factor
    after = rates_for(sx.Model(kernel), weighting).bounds(*BOXES)[1]
    np.testing.assert_allclose(after, factor * before)


def test_no_more_than_some_are_remembered() -> None:
    rates = rates_for(sx.Model(Additive(0.125)), MassFlow())
    for k in range(1, 200):
        lower, upper = rates.bounds(*(side + k for side in BOXES))
        assert (lower <= upper).all()
    kept = rates.bounds.__wrapped__  # type: ignore[attr-defined]
    assert len(kept._known) <= remembered._MOST
