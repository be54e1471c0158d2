"""Products of whole numbers against those of Python."""

from __future__ import annotations

import numba
import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from smolux.jit.wide import upper_half

words = st.integers(0, (1 << 64) - 1)


@numba.njit
def halves(a, b):  # type: ignore[no-untyped-def]
    return upper_half(a, b), a * b


@settings(max_examples=200, deadline=None)
@given(words, words)
@example((1 << 64) - 1, (1 << 64) - 1)
@example((1 << 64) - 1, 3)
def test_both_halves_of_a_product(a: int, b: int) -> None:
    upper, lower = halves(np.uint64(a), np.uint64(b))
    assert (int(upper) << 64) + int(lower) == a * b
