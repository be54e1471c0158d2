"""One large set of small replicas of several models, from which all groups are taken."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

import smolux as sx
from smolux.errors import quiet

PARTICLES = 500
#: of each model: 2000 groups of 32
REPLICAS = 64_000
#: models and their times: early and late; below, near and beyond a gel
MODELS: dict[str, tuple[sx.Model, tuple[float, ...]]] = {
    "constant": (sx.Model(sx.kernels.Constant()), (1.0, 10.0)),
    "additive": (sx.Model(sx.kernels.Additive()), (0.5, 1.0)),
    "multiplicative": (sx.Model(sx.kernels.Multiplicative()), (0.5, 0.9, 1.2)),
    "ballistic": (sx.Model(sx.kernels.Ballistic()), (0.3, 1.0)),
    "constant, shattering 0.1": (
        sx.Model(sx.kernels.Constant(), [sx.processes.Aggregation(), sx.processes.Shattering(0.1)]),
        (10.0,),
    ),
}
#: densities by size, of which some are rare
SIZES = (1, 5, 30)
#: expected clusters in all groups below which a density is left out
_LEAST = 0.02


@cache
def sampled(name: str, replicas: int) -> dict[str, np.ndarray]:
    """Observables of all replicas of a model, by name and time."""
    model, times = MODELS[name]
    with quiet():
        ds = sx.simulate(
            model, times, particles=PARTICLES, replicas=replicas, seed=7, sizes=max(SIZES),
            bins_per_octave=1, population="fixed-volume",
        )  # fmt: skip
    found: dict[str, Any] = {}
    for k, t in enumerate(times):
        columns = {f"M{p}": ds["moment"].sel(order=p).values[:, k] for p in (0, 2, 3)}
        columns["largest"] = ds["largest"].values[:, k]
        columns |= {f"n_{s}": ds["n"].sel(size=s).values[:, k] for s in SIZES}
        found |= {f"{key}, t = {t:g}": values for key, values in columns.items()}
    return {
        key: values
        for key, values in found.items()
        if values.std() > 0 and (not key.startswith("n_") or PARTICLES * values.mean() > _LEAST)
    }


def groups(values: np.ndarray, size: int, most: int = 2000) -> np.ndarray:
    """Values in groups along the first axis, none twice."""
    many = min(len(values) // size, most)
    return values[: many * size].reshape(many, size).T
