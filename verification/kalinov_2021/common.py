"""Models of the paper, its targets, and runs of them."""

from __future__ import annotations

import time
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import smolux as sx
from smolux.plotting.style import MARKERS, PALETTE

TARGETS = Path(__file__).parent / "targets"
AR, INVERSE = "acceptance-rejection", "inverse"
METHODS = (AR, INVERSE)
#: what the methods are called in tables and figures
LABEL = {AR: "acceptance-rejection", INVERSE: "inverse"}
SEED = 2021


def model(kernel: Any, shattering: Any, initial: Any = None) -> sx.Model:
    """Make aggregation with shattering, of monomers unless said otherwise."""
    return sx.Model(
        kernel=kernel,
        processes=[sx.processes.Aggregation(), sx.processes.Shattering(shattering)],
        initial=initial or sx.initial.monodisperse(),
    )


def constant() -> sx.Model:
    """Tables 1 and 3."""
    return model(sx.kernels.Constant(), 0.1)


def ballistic() -> sx.Model:
    """Tables 2 and 4, Figure 1."""
    return model(sx.kernels.Ballistic(), 0.01)


def brownian(a: float, shattering: Any, *, spread: bool = False) -> sx.Model:
    """Figures 2 and 3: ``(i/j)^a + (j/i)^a``; `spread` starts from 0.1 of each size 1 to 10."""
    initial = sx.initial.from_sizes(dict.fromkeys(range(1, 11), 0.1)) if spread else None
    return model(sx.kernels.GeneralizedBrownian(a), shattering, initial)


def target(name: str) -> dict[str, Any]:
    """Read a table of the paper: the file, with its rows as dictionaries."""
    data = tomllib.loads((TARGETS / f"{name}.toml").read_text())
    data["rows"] = [dict(zip(data["columns"], row, strict=True)) for row in data["rows"]]
    return data


def curves(name: str) -> np.ndarray:
    """Read reference curves: a structured array with the columns of the file."""
    # the first line says what it is
    return np.genfromtxt(TARGETS / f"{name}.csv", delimiter=",", names=True, skip_header=1)


def simulate(
    physics: sx.Model, times: Sequence[float], particles: int, replicas: int, **options: Any
) -> xr.Dataset:
    """Simulate with the seed of the verification."""
    settings: dict[str, Any] = {"seed": SEED, "sizes": 1024} | options
    return sx.simulate(physics, times, particles=particles, replicas=replicas, **settings)


def second_moments(
    physics: sx.Model,
    times: np.ndarray,
    particles: int,
    method: str,
    runs: tuple[int, int],
    until: float,
) -> dict[str, Any]:
    """M2 of some runs to the end, and of these and some more to `until`.

    Single runs show whether oscillations last; means can be compared only as long as the runs are
    in phase, and there more of them are worth their time.
    """
    options: dict[str, Any] = {"method": method, "orders": (2,), "sizes": 1}
    first = simulate(physics, times, particles, runs[0], **options)
    long = first["moment"].values.reshape(runs[0], -1)
    early = times[times <= until]
    found = [long[:, : len(early)]]
    if runs[1]:
        more = simulate(physics, early, particles, runs[1], **options | {"seed": SEED + 1})
        found.append(more["moment"].values.reshape(runs[1], -1))
    collisions = float(first["collisions"].values[:, -1].mean()) / particles
    return {"long": long, "early": np.concatenate(found), "collisions": collisions}


def loop_seconds(physics: sx.Model, time_end: float, particles: int, method: str) -> float:
    """Processor seconds of the event loop of one run, compilation and set-up left out."""
    from smolux.stochastic.make_plan import make_plan
    from smolux.stochastic.replicas import Group

    plan = make_plan(
        physics,
        [time_end],
        method=method,
        particles=particles,
        replicas=1,
        seed=SEED,
        orders=(0, 1, 2, 3),
        sizes=1024,
    )
    group = Group.start(plan, 0, 1)
    group.compile()
    start = time.thread_time()
    group.advance(lambda: False)
    return time.thread_time() - start


def draw_first_runs(ax: Any, data: dict[str, Any]) -> None:
    """Draw the first long run of each method."""
    for m, method in enumerate(METHODS):
        ax.plot(
            data["times"],
            np.asarray(data["runs"][method]["long"])[0],
            ms=2.2,
            mfc="none",
            mew=0.5,
            label=f"{LABEL[method]}, one run",
            zorder=3,
            color=PALETTE[m],
            marker=MARKERS[m],
            ls="none",
        )
