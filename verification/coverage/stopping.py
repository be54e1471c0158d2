"""Runs with a target error: coverage, and the bias of stopping."""

from __future__ import annotations

from typing import Any

import numpy as np

from smolux.confidence import Sample, mean_interval
from smolux.settings.target_error import StoppingRule, assess, plan_replicas
from verification.outcome import Check, Item, Outcome, Table

from .common import REPLICAS, sampled

#: kernel, observable and target
CASES = (
    ("constant", "M0, t = 10", "number_density", 0.03),
    ("constant", "M0, t = 10", "number_density", 0.01),
    ("constant", "n_30, t = 10", "n_30", 0.3),
    ("additive", "M2, t = 1", "M2", 0.05),
    ("additive", "M3, t = 1", "M3", 0.2),
    ("additive", "M3, t = 1", "M3", 0.1),
)
_TRIALS = 400
_MOST = 20_000


def _until(
    rule: StoppingRule, values: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, int]:
    """Return what `smolux.simulate` would end with, and the number of pilots."""
    moved = np.array([True])

    def draw(count: int) -> np.ndarray:
        return rng.choice(values, count)[:, None]

    pilots = draw(rule.first)
    while (trial := plan_replicas(rule, pilots, moved)).pilots > len(pilots):
        pilots = np.concatenate([pilots, draw(trial.pilots - len(pilots))])
    found = draw(trial.replicas)
    while (assessment := assess(rule, found, moved)).following > len(found):
        found = np.concatenate([found, draw(assessment.following - len(found))])
    return found, len(pilots)


def _compute(quick: bool) -> dict[str, Any]:
    rows = []
    for name, key, target, error in CASES[: 1 if quick else None]:
        values = sampled(name, 3200 if quick else REPLICAS)[key]
        true, rng = float(values.mean()), np.random.default_rng(5)
        held, counts, pilots, means = 0, [], [], []
        trials = 50 if quick else _TRIALS
        for _ in range(trials):
            found, many = _until(StoppingRule(target, error, 8, _MOST), values, rng)
            lower, upper = mean_interval(Sample.of(found))
            held += int(lower[0] <= true <= upper[0])
            counts.append(len(found))
            pilots.append(many)
            means.append(float(found.mean()) / true - 1.0)
        rows.append(
            [name, key, error, np.mean(pilots), np.mean(counts), held / trials, np.mean(means),
             np.std(means) / np.sqrt(trials), np.mean(np.abs(means) <= error)]
        )  # fmt: skip
    return {"rows": rows, "trials": trials}


def _present(data: dict[str, Any]) -> Outcome:
    rows, bad, biased = [], [], []
    for name, key, target, pilots, count, held, bias, error, within in data["rows"]:
        rows.append(
            [name, key, f"±{100 * target:g} %", f"{pilots:.0f}", f"{count:.0f}",
             f"{100 * held:.1f}", f"{100 * bias:+.2f} ± {100 * error:.2f}", f"{100 * within:.1f}"]
        )  # fmt: skip
        chance = 4 * np.sqrt(0.95 * 0.05 / data["trials"])
        bad += [] if 0.93 - chance <= held <= 0.98 + chance else [f"{name}, {key}"]
        biased += [] if abs(bias) <= 0.1 * target + 4 * error else [f"{name}, {key}"]
    head = ["kernel", "observable", "target", "pilots", "replicas", "holds, %", "bias, %",
            "within the target, %"]  # fmt: skip
    checks = [
        Check("intervals after stopping", f"{len(bad)} rows outside", "93 % or more",
              "four standard deviations", not bad),
        Check("bias of the mean", f"{len(biased)} rows beyond", "0",
              "a tenth of the target and four standard errors", not biased),
    ]  # fmt: skip
    return Outcome(
        f"{data['trials']} runs of each row, with replicas drawn from those of the other items.",
        checks=checks,
        tables=[Table("Runs with a target error", head, rows)],
    )


ITEM = Item("stopping", "Runs with a target error", _compute, _present)
