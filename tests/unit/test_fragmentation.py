"""Bounds of the breakage of a size: above every split, and not far above."""

from __future__ import annotations

import math

import numpy as np
import pytest

import smolux as sx
from smolux.callables import Function
from smolux.core.slots import slot_edges
from smolux.processes import Fragmentation

EDGES = slot_edges(3).astype(float)
LOW, HIGH = EDGES[1:-1], EDGES[2:] - 1.0


def halves(i, j):
    return 1.0 if abs(i - j) <= 1 else 0.0


def monomers(i, j):
    return 1.0 if min(i, j) == 1 else 0.0


@pytest.mark.parametrize(
    "law", [1.5, "2/(i+j-1)", "1/(i*j)", "i*j", sx.kernels.Shear(1.0), halves, monomers]
)
def test_ceiling_holds_along_the_diagonal(law: object) -> None:
    process = Fragmentation(law)
    ceiling = process.ceiling(LOW, HIGH)
    assert np.isfinite(ceiling).all()
    for s in range(1, 45):  # every size and split up to 160 or so
        k, i = np.meshgrid(np.arange(LOW[s], HIGH[s] + 1), np.arange(1.0, HIGH[s]), indexing="ij")
        split = i < k
        largest = (0.5 * (k - 1) * process.pairs(i, np.where(split, k - i, 1.0)))[split].max()
        assert 0.55 * ceiling[s] <= largest <= ceiling[s]


def test_ceiling_of_a_law_that_falls_with_the_size() -> None:
    """Uniform binary breakage has the rate 1 at every size; over the box it would be (k - 1)."""
    ceiling = Fragmentation("2/(i+j-1)").ceiling(LOW, HIGH)[1:]
    assert (ceiling >= 1.0).all()
    assert (ceiling < 1.7).all()


def test_what_is_too_large_is_infinite() -> None:
    """As compiled code has it: no bare OverflowError, whatever sizes are tried."""
    law = Function.of(lambda k: math.exp(math.lgamma(k)), ("k",), "the law")
    assert law.scalar((1e3,), ()) == math.inf
