"""The runs behind the figures of final clusters: every size, fraction and method, many seeds."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

import smolux.spatial as sp

from .common import EVENTS, FRACTIONS, METHODS, SIZES, Finished, compiled, method_of, run

#: discs -> seeds
SEEDS = {100: 48, 400: 24, 900: 12, 2500: 8, 10_000: 4}
QUICK = {100: 12, 400: 6}
QUICK_FRACTIONS = (0.1, 0.3)
#: gaps up to which discs touch, over a diameter
TOLERANCES = (1e-9, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
#: distances within which neighbours are counted, in diameters
WITHIN = (1.5, 2.0, 3.0, 5.0)


@cache
def runs(quick: bool) -> dict[str, Any]:
    """Run them all, once in a process.

    Returns
    -------
    dict
        By method, volume fraction and number of discs: the indicators of each run, and means and
        standard deviations over runs of the pair distribution and of the numbers of boxes.
    """
    compiled([method_of(m) for m in METHODS])
    seeds = QUICK if quick else SEEDS
    return {
        m: {f: {n: _cell(m, f, n, seeds[n]) for n in sizes(quick)} for f in fractions(quick)}
        for m in METHODS
    }


def sizes(quick: bool) -> tuple[int, ...]:
    """Return the numbers of discs."""
    return tuple(QUICK) if quick else SIZES


def fractions(quick: bool) -> tuple[float, ...]:
    """Return the volume fractions."""
    return QUICK_FRACTIONS if quick else FRACTIONS


def select(quick: bool, *names: str) -> dict[str, Any]:
    """Return some of the indicators of all runs, and what there is."""
    cells = {
        m: {f"{f:g}": {str(n): {k: cell[k] for k in names} for n, cell in by.items()}
            for f, by in of.items()}
        for m, of in runs(quick).items()
    }  # fmt: skip
    seeds = QUICK if quick else SEEDS
    return {
        "cells": cells, "sizes": sizes(quick), "fractions": fractions(quick),
        "seeds": [seeds[n] for n in sizes(quick)],
    }  # fmt: skip


def values(data: dict[str, Any], method: str, fraction: float, discs: int, name: str) -> np.ndarray:
    """Return one indicator out of what `select` returned and a file may have kept."""
    return np.asarray(data["cells"][method][f"{fraction:g}"][str(discs)][name], float)


def ran(data: dict[str, Any]) -> str:
    """Say what was run."""
    seeds = ", ".join(f"{k} of N = {n}" for n, k in zip(data["sizes"], data["seeds"], strict=True))
    phi = ", ".join(f"{f:g}" for f in data["fractions"])
    return (
        "Discs on a lattice with unit speeds, reflecting walls, to one cluster; event-driven, and "
        "time steps of 0.5 and 0.2 radii with clusters that bend. Volume fractions "
        f"{phi}; seeds: {seeds}, for each."
    )


def _cell(method: str, fraction: float, discs: int, seeds: int) -> dict[str, Any]:
    found = [_indicators(_of(method, fraction, discs, seed)) for seed in range(seeds)]
    cell: dict[str, Any] = {
        k: np.array([one[k] for one in found]) for k in found[0] if k not in ("sides", "boxes")
    }
    for name in ("neighbours", "g"):
        cell[f"{name}_sd"] = cell[name].std(0, ddof=1)
        cell[name] = cell[name].mean(0)
    cell["r"] = found[0]["r"]
    # boxes are counted until nearly every disc has its own, which is not the same side in each run
    least = min(len(one["boxes"]) for one in found)
    boxes = np.array([one["boxes"][:least] for one in found])
    cell |= {"sides": found[0]["sides"][:least], "boxes": boxes.mean(0)}
    cell["boxes_sd"] = boxes.std(0, ddof=1)
    return cell


def _of(method: str, fraction: float, discs: int, seed: int) -> Finished:
    return run(method_of(method), sp.lattice(discs, fraction, seed=seed))


def _indicators(done: Finished) -> dict[str, Any]:
    s, n = done.snapshot, len(done.system)
    shape, pairs = sp.shapes(s), sp.pair_distribution(s)
    boxes = sp.box_dimension(s)
    near = sp.pair_distribution(s, s.diameter * np.array([0.0, *WITHIN]))["neighbours"].values
    merges = done.merges
    return {
        "contacts": contacts_within(s),
        "aspect": float(shape["aspect_ratio"][0]),
        "orientation": float(shape["orientation"][0]),
        "dimension": boxes.value,
        "sides": boxes.x / done.system.box.lengths[0],
        "boxes": boxes.y,
        "r": pairs["r"].values / s.diameter,
        "neighbours": pairs["neighbours"].values,
        "g": pairs["g"].values,
        "within": np.cumsum(near),
        "final": done.trace.time,
        # the merge that leaves one cluster of each hundred discs
        "hundredth": merges[n - n // 100 - 1],
        "seconds": done.seconds,
        "failures": done.trace.attributes.get("failures", 0),
        "events": len(merges),
    }


def contacts_within(s: sp.Snapshot) -> np.ndarray:
    """Contacts of a disc, on average, for each of `TOLERANCES`."""
    found = sp.contacts(s, TOLERANCES[-1])
    i, j = found.pairs.T
    gap = np.linalg.norm(s.position[j] - s.position[i], axis=1) / (s.radius[i] + s.radius[j]) - 1
    return np.array([2 * np.sum(gap <= t) / len(s) for t in TOLERANCES])


__all__ = [
    "EVENTS", "TOLERANCES", "WITHIN", "contacts_within", "fractions", "ran", "runs", "select",
    "sizes", "values",
]  # fmt: skip
