"""Algorithms and models of the paper, its targets, and ensembles of them."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import smolux as sx
from smolux.plotting.style import MARKERS, PALETTE
from verification.outcome import Check

TARGETS = Path(__file__).parent / "targets"
SEED = 2003
_NORMAL = 1.959963984540054


class Algorithm(NamedTuple):
    """What the paper calls an algorithm: a method, a weighting, and what becomes of few particles.

    The label is that of figures.
    """

    method: str
    weighting: Any
    population: str
    label: str


AR, AUTO = "acceptance-rejection", "auto"
ALGORITHMS = {
    "MMF": Algorithm(AR, "number", "none", "MMF"),
    "MMF doubling": Algorithm(AR, "number", "doubling", "MMF, doubling"),
    "MFA": Algorithm(AUTO, "mass-flow", "none", "MFA"),
    "WA q=0.5": Algorithm(AUTO, sx.weighting.WeightFunction(0.5), "none", "WA, $q=0.5$"),
    "WA q=1": Algorithm(AUTO, sx.weighting.WeightFunction(1.0), "none", "WA, $q=1$"),
    "WA q=1.25": Algorithm(AUTO, sx.weighting.WeightFunction(1.25), "none", "WA, $q=1.25$"),
}
#: those of a smoke test, which compiles less
QUICK = ("MMF", "MMF doubling", "MFA")
KERNELS = {"constant": sx.kernels.Constant(), "additive": sx.kernels.Additive(0.5)}
KERNEL_NAME = {"constant": "constant kernel", "additive": "kernel (i + j)/2"}
LOOK = {
    name: {"color": PALETTE[k], "marker": MARKERS[k], "label": algorithm.label}
    for k, (name, algorithm) in enumerate(ALGORITHMS.items())
}


def model(kernel: str) -> sx.Model:
    """Make the aggregation of monomers."""
    return sx.Model(kernel=KERNELS[kernel])


def target(name: str) -> dict[str, Any]:
    """Read a table of the paper: the file, with its rows as dictionaries."""
    data = tomllib.loads((TARGETS / f"{name}.toml").read_text())
    data["rows"] = [dict(zip(data["columns"], row, strict=True)) for row in data["rows"]]
    return data


def curves(name: str) -> np.ndarray:
    """Read reference curves: a structured array with the columns of the file."""
    # the first line says what it is
    return np.genfromtxt(TARGETS / f"{name}.csv", delimiter=",", names=True, skip_header=1)


def exact(kernel: str, observables: Sequence[str], times: Sequence[float]) -> np.ndarray:
    """Solution of the rate equations, of shape (observables, times)."""
    solution = sx.exact.solution(model(kernel))
    return np.array(
        [
            solution.densities(times, [int(name[2:])])[:, 0]
            if name.startswith("n_")
            else solution.moment(times, float(name[1:]))
            for name in observables
        ]
    )


def finite(
    kernel: str, observables: Sequence[str], times: Sequence[float], particles: int
) -> np.ndarray:
    """Means of direct simulation in a fixed volume, exactly, of shape (observables, times)."""
    law = sx.exact.finite.find(model(kernel), particles)
    assert law is not None
    sizes = [int(name[2:]) for name in observables if name.startswith("n_")]
    density = {}
    if sizes:
        counts = np.array([law.counts(t, sizes) for t in times]).T / particles
        density = dict(zip(sizes, counts, strict=True))
    return np.array(
        [
            density[int(name[2:])]
            if name.startswith("n_")
            else [law.second_moment(t) for t in times]
            for name in observables
        ]
    )


def measure(
    kernel: str,
    algorithm: str,
    observables: Sequence[str],
    times: Sequence[float],
    particles: int,
    replicas: int,
    *,
    rounds: int = 1,
    method: str | None = None,
) -> dict[str, Any]:
    """Run an ensemble and return what is stored of it; arrays are of shape (observables, times).

    Parameters
    ----------
    kernel, algorithm : str
        Keys of `KERNELS` and `ALGORITHMS`.
    observables, times, particles, replicas
        As for `smolux.ensemble`.
    rounds : int
        Ensembles, of which each has its share of the replicas, and a cost of its own.
    method : str, optional
        Instead of that of the algorithm, for what does not depend on it.
    """
    chosen = ALGORITHMS[algorithm]
    each = max(replicas // rounds, 2)
    parts = [
        sx.ensemble(
            model(kernel), times, observables, method=method or chosen.method,
            weighting=chosen.weighting, population=chosen.population, particles=particles,
            replicas=each, seed=SEED + 1000 * k, threads=1,
        )
        for k in range(rounds)
    ]  # fmt: skip
    means = np.array([ds["mean"].values for ds in parts])
    variance = np.mean([ds["variance"].values for ds in parts], axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        # of the logarithm, from the interval: the scatter of the variance itself
        scatter = [np.log(ds["variance_upper"] / ds["variance"]) / _NORMAL for ds in parts]
        relative = np.sqrt(np.mean(np.square(scatter), axis=0) / rounds)
    return {
        "mean": means.mean(axis=0),
        "error": np.sqrt(variance / (each * rounds)),
        "variance": variance,
        "variance_error": relative,
        "cost": [float(ds["cost"]) for ds in parts],
        "collisions": float(np.mean([float(ds["collisions"]) for ds in parts])) / particles,
        "method": parts[0].attrs["method"],
        "particles": particles,
        "replicas": each * rounds,
    }


def cost(found: dict[str, Any]) -> float:
    """Processor seconds of a replica: the median of the rounds."""
    return float(np.median(found["cost"]))


def within(what: str, ratios: Sequence[float], low: float, high: float, why: str) -> Check:
    """Check that all ratios, ours over the expected one, are in a range."""
    x = np.asarray(ratios, float)
    spread = f"{x.min():.3g} to {x.max():.3g}" if x.size > 1 else f"{x[0]:.3g}"
    allowed = f"{low:g} to {high:g} {why}".strip() if high < np.inf else f"≥ {low:g} {why}".strip()
    return Check(what, spread, "1", allowed, bool(x.min() >= low and x.max() <= high))


def count(number: float) -> str:
    """Write a number of replicas or particles with thin groups of three digits."""
    return f"{number:,.0f}".replace(",", " ")
