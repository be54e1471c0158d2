"""Table 2: whether the printed deviations can be those of some number of runs of this process.

The paper prints rms deviations with one digit, mostly, and does not say of how many runs. Few runs
give a scattered value, and as the deviations are skewed, mostly one that is too small. So the
number of runs is estimated, for every N, from how far the printed values scatter; then they are
judged with the scatter that so many runs have.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from verification.outcome import Check, Table, worst

#: numbers of runs the paper may have taken
_COUNTS = (2, 3, 4, 6, 8, 10, 15, 20, 30, 50, 100, 200)
_DRAWS = 4000


@dataclass(frozen=True)
class Judged:
    """The printed values of one N.

    Attributes
    ----------
    runs, low, high : int
        Likeliest number of runs of the paper, and those within 2 of its log-likelihood.
    scores : ndarray
        Deviations of log(printed / ours), as normal scores.
    shift, spread : float
        Mean of log(printed / ours), less what it is expected to be, and its standard error.
    """

    runs: int
    low: int
    high: int
    scores: np.ndarray
    shift: float
    spread: float


def unit(printed: np.ndarray) -> np.ndarray:
    """Return the unit of the last digit of what is printed in per cent."""
    digits = [len(f"{100 * v:.6g}".partition(".")[2]) for v in printed]
    return 10.0 ** (-np.array(digits) - 2.0)


def _rms(blocks: list[np.ndarray], runs: int | None, rng: np.random.Generator) -> np.ndarray:
    """Draw rms deviations over so many of our runs, or as many as there are: (draws, cells).

    What a run gives at t = 1 and t = 10, and for all moments, stays together; t = 100 is drawn
    apart, as fewer runs go so far.
    """
    return np.concatenate(
        [
            np.sqrt(
                (block**2)[rng.integers(len(block), size=(_DRAWS, runs or len(block)))].mean(axis=1)
            )
            for block in blocks
        ],
        axis=1,
    )


def judge(blocks: list[np.ndarray], printed: np.ndarray) -> Judged:
    """Judge the printed values of one N by our runs: `blocks` of shape (runs, cells)."""
    rng = np.random.default_rng(2)
    units = unit(printed)
    ours = np.concatenate([np.sqrt((block**2).mean(axis=0)) for block in blocks])
    seen = np.log(printed / ours)
    ours_drawn = _rms(blocks, None, rng)
    likely, drawn = [], []
    for runs in _COUNTS:
        rounded = np.maximum(np.round(_rms(blocks, runs, rng) / units), 1) * units
        x = np.log(rounded / ours_drawn)
        drawn.append(x)
        likely.append(stats.norm.logpdf(seen, x.mean(axis=0), x.std(axis=0)).sum())
    best = int(np.argmax(likely))
    near = [runs for runs, value in zip(_COUNTS, likely, strict=True) if value > likely[best] - 2]
    x = drawn[best]
    below = ((x < seen).sum(axis=0) + 0.5 * (x == seen).sum(axis=0) + 0.5) / (_DRAWS + 1)
    means = x.mean(axis=1)
    return Judged(
        _COUNTS[best],
        near[0],
        near[-1],
        stats.norm.ppf(below),
        float(seen.mean() - means.mean()),
        float(means.std()),
    )


def checks(judged: dict[int, Judged]) -> list[Check]:
    """Check single values, and whether they are larger or smaller on the whole."""
    error = np.array([j.spread for j in judged.values()])
    shift = np.array([j.shift for j in judged.values()])
    weight = error**-2 / (error**-2).sum()
    mean, sigma = float(weight @ shift), float((error**-2).sum() ** -0.5)
    sizes = ", ".join(str(n) for n in judged)
    return [
        worst(
            f"printed rms deviations, acceptance-rejection, N = {sizes}, as of the likeliest "
            "numbers of runs",
            np.concatenate([j.scores for j in judged.values()]),
            3.5,
        ),
        Check(
            "the same on the whole: printed over ours, geometric mean, over what is expected",
            f"{np.exp(mean):.2f} ± {sigma * np.exp(mean):.2f}",
            "1",
            "≤ 3.5 σ",
            abs(mean) <= 3.5 * sigma,
        ),
    ]


def table(judged: dict[int, Judged]) -> Table:
    """Tabulate the likeliest numbers of runs."""
    rows: list[list[Any]] = [
        [
            str(n),
            str(len(j.scores)),
            str(j.runs),
            f"{j.low} to {j.high}",
            f"{np.exp(j.shift):.2f} ± {j.spread * np.exp(j.shift):.2f}",
            f"{np.abs(j.scores).max():.1f} σ",
        ]
        for n, j in judged.items()
    ]
    head = [
        "N", "values", "likeliest number of runs", "as likely within e²",
        "printed / ours, geometric mean over the expected one", "farthest value",
    ]  # fmt: skip
    return Table(
        "Over how many runs the paper may have taken its deviations (acceptance-rejection)",
        head,
        rows,
    )
