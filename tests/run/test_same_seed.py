"""Runs that differ by a parameter, with the same seed, by the loop of the tests of ensembles."""

from __future__ import annotations

import numpy as np

import smolux as sx


def counted(scale: float, seed: int) -> np.ndarray:
    ds = sx.simulate(
        sx.Model(sx.kernels.Constant(scale)), [2.0], method="acceptance-rejection",
        weighting=sx.weighting.WeightFunction(0.0), particles=500, replicas=200, seed=seed,
    )  # fmt: skip
    return np.asarray(ds["number_density"].values[:, 0])


def test_differences_between_parameters_scatter_far_less_with_the_same_seed() -> None:
    one, same, other = counted(1.0, 1), counted(1.01, 1), counted(1.01, 2)
    assert (same - one).var() < 0.2 * (other - one).var()
    # dM0/dK at t = 2: M0 = 2 / (K t + 2)
    change = (same - one).mean() / 0.01
    assert abs(change + 0.25) < 4.5 * (same - one).std() / 0.01 / np.sqrt(200)
