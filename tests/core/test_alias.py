"""Alias tables against the laws they stand for."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from smolux.core.rng import bits
from smolux.core.seeds import streams
from smolux.methods.size_class import alias


@numba.njit
def draw(weights, sure, state, number):  # type: ignore[no-untyped-def]
    n = len(weights)
    share, other, queue = np.zeros(n), np.zeros(n, np.int32), np.zeros(n, np.int32)
    alias.build(weights, weights.sum(), share, other, queue)
    table = np.zeros(3 * n, np.uint64)
    alias.pack(n, share, other, np.arange(n).astype(np.uint32), sure, table)
    outcome, at_once, rest = (
        np.zeros(number, np.int64),
        np.zeros(number, np.bool_),
        np.zeros(number),
    )
    for k in range(number):
        outcome[k], column, left, at_once[k] = alias.draw(table, np.uint64(n), bits(state))
        rest[k] = alias.remainder(table, column, left)
    return outcome, at_once, rest, share, other


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(1e-3, 1e3), min_size=1, max_size=300))
def test_the_columns_add_up_to_the_law(weights: list[float]) -> None:
    given = np.array(weights)
    *_, share, other = draw(given, given, streams(1, 0, 1)[0], 0)
    law = np.bincount(other, 1.0 - share, len(given)) + share
    assert law / len(given) == pytest.approx(given / given.sum(), abs=1e-12)
    assert ((share >= 0.0) & (share <= 1.0 + 1e-12)).all()


GIVEN = np.array([0.5, 0.0, 3.0, 1e-3, 7.0, 0.25, 0.25])
SURE = np.array([0.9, 0.5, 0.0, 1.0, 0.75, 1.0, 0.3])
NUMBER = 200_000


def test_draws_follow_the_law() -> None:
    outcome, *_ = draw(GIVEN, SURE, streams(2, 0, 1)[0], NUMBER)
    counts = np.bincount(outcome, minlength=len(GIVEN))
    expected = GIVEN / GIVEN.sum() * NUMBER
    assert counts[1] == 0
    some = expected > 0
    deviation = (counts[some] - expected[some]) / np.sqrt(expected[some])
    assert (deviation**2).sum() < 30.0  # chi-square of 5 degrees of freedom: 1e-5


def test_what_is_left_of_the_bits_is_uniform_and_decides_what_is_sure() -> None:
    outcome, at_once, rest, *_ = draw(GIVEN, SURE, streams(3, 0, 1)[0], NUMBER)
    for k in np.unique(outcome):
        mine = outcome == k
        assert stats.kstest(rest[mine], "uniform").pvalue > 1e-5
        # sure from the upper half of a word of 64 bits, rounded down
        assert (rest[mine & at_once] < SURE[k]).all()
        assert (rest[mine & ~at_once] > SURE[k] - 1e-8).all()
