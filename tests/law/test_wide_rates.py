"""Rates over many decades: what is left of the large ones must not stand for the small ones."""

from __future__ import annotations

import chains
import laws
import numpy as np
import pytest

import smolux as sx

START = (1, 1, 1, 1, 10, 10, 10)
END = 1e12


def _rate(i: int, j: int) -> float:
    """Of the formula below: two of ten or more merge at once, all others hardly ever."""
    return 1e-12 + 1e12 * (min(i, j) >= 10)


@pytest.mark.parametrize("method", ["inverse", "size-class"])
def test_rates_over_24_decades(method: str) -> None:
    kernel = sx.kernels.formula("1e-12 + 1e12 * min(1, max(0, min(i, j) - 9))")
    start = sx.initial.from_sizes({1: 4 / 7, 10: 3 / 7})
    ds = sx.simulate(
        sx.Model(kernel, initial=start), [END], method=method, population="fixed-volume",
        particles=7, replicas=4000, bins_per_octave=1, seed=1,
    )  # fmt: skip
    volume = float(ds["volume"][0, 0])
    # what merges at once has merged: the exponential of the other rates is left
    moves = chains.pairs(lambda i, j: _rate(1, 1), lambda k: 1.0, volume)
    place, p = chains.law((1, 1, 1, 1, 30), moves, (END,), 5)
    mean = sum(p[0][k] * len(state) for state, k in place.items())
    laws.agree(ds["particles"].values[:, 0], mean, method)


@pytest.mark.parametrize("method", ["inverse", "size-class"])
def test_a_lone_giant_does_not_meet_itself(method: str) -> None:
    """Of the sizes 10**4, 1 and 1, in a law so steep that a giant with itself has 1e32 times more."""
    kernel = sx.kernels.formula("(i*j)**4")
    start = sx.initial.from_sizes({1: 2 / 3, 10**4: 1 / 3})
    end = 1e-16
    ds = sx.simulate(
        sx.Model(kernel, initial=start), [end], method=method, population="fixed-volume",
        particles=3, replicas=4000, bins_per_octave=1, seed=2,
    )  # fmt: skip
    volume = float(ds["volume"][0, 0])
    moves = chains.pairs(lambda i, j: float((i * j) ** 4), lambda k: 1.0, volume)
    place, p = chains.law((1, 1, 10**4), moves, (end,), 3)
    mean = sum(p[0][k] * len(state) for state, k in place.items())
    laws.agree(ds["particles"].values[:, 0], mean, method)


@pytest.mark.parametrize("method", ["low-rank", "fictitious-jumps"])
def test_a_majorant_of_a_law_with_zeros(method: str) -> None:
    kernel = sx.kernels.formula("(i-j)**2")
    start = sx.initial.from_sizes({1: 0.5, 2: 0.5})
    ds = sx.simulate(
        sx.Model(kernel, initial=start), [0.5], method=method, population="fixed-volume",
        particles=6, replicas=4000, bins_per_octave=1, seed=3,
    )  # fmt: skip
    volume = float(ds["volume"][0, 0])
    moves = chains.pairs(lambda i, j: float((i - j) ** 2), lambda k: 1.0, volume)
    place, p = chains.law((1, 1, 1, 2, 2, 2), moves, (0.5,), 6)
    mean = sum(p[0][k] * len(state) for state, k in place.items())
    laws.agree(ds["particles"].values[:, 0], mean, method)
    assert not any("bound" in text for text in ds.attrs["warnings"])
