"""Means and variances over a given number of replicas."""

from __future__ import annotations

from typing import Any

import numpy as np

from smolux.analysis.rare import Rare
from smolux.confidence import (
    Sample,
    mean_interval,
    quantile,
    vague,
    variance_interval,
    variance_vague,
)
from verification.outcome import Check, Item, Outcome, Table

from .common import MODELS, PARTICLES, REPLICAS, groups, sampled

SIZES = (4, 8, 16, 32)
#: shares in which the intervals of 8 replicas must hold, and of groups that must say if they do not
_LOWEST, _HIGHEST, _SAID = 0.93, 0.97, 0.25
#: of 2000 groups: four standard deviations of a share of 95 %
_CHANCE = 4 * np.sqrt(0.95 * 0.05 / 2000)
#: of so many replicas the goal is
_GOAL = 8


def _share(ends: tuple[np.ndarray, np.ndarray], value: float) -> float:
    lower, upper = ends
    known = np.isfinite(lower)
    return float(np.mean(((lower <= value) & (value <= upper))[known]))


def _mean(x: np.ndarray, true: float, density: bool) -> list[float]:
    """Return the shares that hold and are called doubtful, and that of Student's interval."""
    sample = Sample.of(x)
    half = quantile(len(x)) * sample.error
    plain = _share((sample.mean - half, sample.mean + half), true)
    lower, upper = mean_interval(sample)
    doubtful = vague(sample)
    if density:  # as `smolux.summary` does it
        rare = Rare.counted(x, np.full(x.shape, float(PARTICLES)))
        low, high = rare.interval()
        lower, upper = np.where(rare.few, low, lower), np.where(rare.few, high, upper)
        lower = np.where(sample.mean == 0, np.nan, lower)
        doubtful = np.where(rare.few, rare.doubtful, doubtful)[sample.mean > 0]
    return [_share((lower, upper), true), float(doubtful.mean()), plain]


def _variance(x: np.ndarray, true: float, density: bool) -> list[float]:
    """Return the shares that hold and are called doubtful, and that of the chi-square interval."""
    x = x[:, x.std(axis=0) > 0]
    sample = Sample.of(x)
    n = len(x)
    square = np.sum((x - x.mean(axis=0)) ** 4, axis=0) / n / sample.variance**2
    relative = np.sqrt(np.maximum(square - (n - 3) / (n - 1), 0) / n)
    ratio = np.exp(quantile(n) * relative)
    plain = _share((sample.variance / ratio, sample.variance * ratio), true)
    return [
        _share(variance_interval(sample), true), float(variance_vague(sample).mean()), plain
    ]  # fmt: skip


def _computed(quick: bool, measure: Any, true: Any, wanted: Any) -> dict[str, Any]:
    replicas = 3200 if quick else REPLICAS
    rows = []
    for name in list(MODELS)[: 1 if quick else None]:
        for key, values in sampled(name, replicas).items():
            if not wanted(key):
                continue
            density = key.startswith("n_")
            known = float(true(values))
            found = [measure(groups(values, size), known, density) for size in SIZES]
            rows.append([name, key, float(values.std() / values.mean()), found])
    return {"rows": rows, "replicas": replicas, "particles": PARTICLES}


def _means(quick: bool) -> dict[str, Any]:
    return _computed(quick, _mean, np.mean, lambda key: True)


def _variances(quick: bool) -> dict[str, Any]:
    return _computed(quick, _variance, np.var, lambda key: not key.startswith("n_30"))


def _cell(found: list[float]) -> str:
    held, doubtful, _ = found
    said = f" ({100 * doubtful:.0f} %)" if round(100 * doubtful) else ""
    return f"{100 * held:.1f}{said}"


def _good(found: list[float]) -> bool:
    held, doubtful, _ = found
    low, high = _LOWEST - _CHANCE, _HIGHEST + _CHANCE
    return low <= held <= high or doubtful >= _SAID


def _presented(data: dict[str, Any], what: str, before: str) -> Outcome:
    at = SIZES.index(_GOAL)
    rows = [
        [name, key, f"{spread:.2g}", *map(_cell, found), f"{100 * found[at][2]:.1f}"]
        for name, key, spread, found in data["rows"]
    ]
    bad = [f"{name}, {key}" for name, key, _, found in data["rows"] if not _good(found[at])]
    strict = sum(_LOWEST <= found[at][0] <= _HIGHEST for *_, found in data["rows"])
    head = ["kernel", "observable", "σ/mean", *(f"R = {s}, %" for s in SIZES), f"{before}, R = 8"]
    check = Check(
        f"intervals of {what} over 8 replicas",
        f"{len(bad)} rows outside" + (f": {'; '.join(bad)}" if bad else ""),
        f"{_LOWEST:.0%} to {_HIGHEST:.0%}",
        f"four standard deviations, or {_SAID:.0%} of the groups say that they are too few",
        not bad,
    )
    return Outcome(
        f"{data['replicas']} replicas of {data['particles']} particles of each kernel, "
        "in a fixed volume, in groups of R.",
        checks=[check],
        tables=[Table(f"Share of the 95 % intervals of {what} that hold", head, rows)],
        notes=[f"{strict} of {len(rows)} rows are between 93 and 97 % at R = 8 as measured."],
    )


MEANS = Item(
    "means",
    "Intervals of means",
    _means,
    lambda data: _presented(data, "a mean", "Student's t"),
)
VARIANCES = Item(
    "variances",
    "Intervals of the variance of a replica",
    _variances,
    lambda data: _presented(data, "a variance", "the fourth moment alone"),
)
