"""Rates over many decades: what is left of the large ones must not stand for the small ones."""

from __future__ import annotations

from typing import Any

import chains
import laws
import pytest

import smolux as sx

END = 1e12


#: one law for all tests, so that they share their loops
FORMULA = "c0 + c1*min(1, max(0, min(i, j) - 9)) + c2*(i*j)**4 + c3*(i - j)**2"


def _kernel(c0: float = 0.0, c1: float = 0.0, c2: float = 0.0, c3: float = 0.0) -> Any:
    return sx.kernels.formula(FORMULA, c0=c0, c1=c1, c2=c2, c3=c3)


@pytest.mark.parametrize("method", ["inverse", "size-class"])
def test_rates_over_24_decades(method: str) -> None:
    kernel = _kernel(c0=1e-12, c1=1e12)
    start = sx.initial.from_sizes({1: 4 / 7, 10: 3 / 7})
    ds = sx.simulate(
        sx.Model(kernel, initial=start), [END], method=method, population="fixed-volume",
        particles=7, replicas=4000, bins_per_octave=1, seed=1,
    )  # fmt: skip
    volume = float(ds["volume"][0, 0])
    # what merges at once has merged: the exponential of the other rates is left
    moves = chains.pairs(lambda i, j: 1e-12, lambda k: 1.0, volume)
    place, p = chains.law((1, 1, 1, 1, 30), moves, (END,), 5)
    mean = sum(p[0][k] * len(state) for state, k in place.items())
    laws.agree(ds["particles"].values[:, 0], mean, method)


@pytest.mark.parametrize("method", ["inverse", "size-class"])
def test_a_lone_giant_does_not_meet_itself(method: str) -> None:
    """In a law so steep that a giant with itself would have 1e32 times the rate of monomers."""
    kernel = _kernel(c2=1.0)
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
    kernel = _kernel(c3=1.0)
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
