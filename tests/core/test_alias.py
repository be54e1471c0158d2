"""Alias tables against the laws they stand for."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smolux.core import alias
from smolux.core.rng import streams, uniform


@numba.njit
def draw(weights, state, number):  # type: ignore[no-untyped-def]
    n = len(weights)
    share, other, queue = np.zeros(n), np.zeros(n, np.int32), np.zeros(n, np.int32)
    alias.build(weights, weights.sum(), share, other, queue)
    counts = np.zeros(n, np.int64)
    either = (np.arange(n) << 32) | other  # what a column keeps, and what its alias gives
    for _ in range(number):
        counts[alias.outcome(share, either, n, uniform(state))] += 1
    return counts, share, other


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(1e-3, 1e3), min_size=1, max_size=300))
def test_the_columns_add_up_to_the_law(weights: list[float]) -> None:
    given = np.array(weights)
    _, share, other = draw(given, streams(1, 0, 1)[0], 0)
    law = np.bincount(other, 1.0 - share, len(given)) + share
    assert law / len(given) == pytest.approx(given / given.sum(), abs=1e-12)
    assert ((share >= 0.0) & (share <= 1.0 + 1e-12)).all()


def test_draws_follow_the_law() -> None:
    given = np.array([0.5, 0.0, 3.0, 1e-3, 7.0, 0.25, 0.25])
    number = 200_000
    counts, _, _ = draw(given, streams(2, 0, 1)[0], number)
    expected = given / given.sum() * number
    assert counts[1] == 0
    some = expected > 0
    deviation = (counts[some] - expected[some]) / np.sqrt(expected[some])
    assert (deviation**2).sum() < 30.0  # chi-square of 5 degrees of freedom: 1e-5
