"""What an item of a verification yields: checks, tables, notes and a figure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike
from scipy import stats


@dataclass(frozen=True)
class Check:
    """One statement that a measurement can refute.

    Attributes
    ----------
    what : str
        What is compared.
    measured, target, limit : str
        As they are printed; `limit` says what deviation is allowed, and why.
    passed : bool
    """

    what: str
    measured: str
    target: str
    limit: str
    passed: bool


@dataclass(frozen=True)
class Table:
    """A table of texts."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]

    def markdown(self) -> str:
        """Return the table in Markdown."""
        head = [list(self.header), ["---"] * len(self.header)]
        lines = ["| " + " | ".join(row) + " |" for row in [*head, *self.rows]]
        return "\n".join([f"**{self.caption}**", "", *lines])


@dataclass
class Outcome:
    """What is shown of an item; `ran` says in a sentence what was computed."""

    ran: str
    checks: list[Check] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    figure: Figure | None = None
    caption: str = ""


@dataclass(frozen=True)
class Item:
    """One table or figure of a paper.

    Attributes
    ----------
    name, title : str
    compute : callable
        ``compute(quick)`` runs the simulations and returns plain data, which are stored.
    present : callable
        ``present(data)`` makes an `Outcome` of them.
    """

    name: str
    title: str
    compute: Callable[[bool], dict[str, Any]]
    present: Callable[[dict[str, Any]], Outcome]


def normal_sigmas(score: ArrayLike, runs: float) -> Any:
    """Convert a score by Student's t of `runs` runs to one of the normal law, same probability.

    With few runs a score of 4 is nothing rare; stated limits hold for any number of runs.
    """
    tail = stats.t.sf(np.abs(score), runs - 1)
    return np.sign(score) * stats.norm.isf(np.maximum(tail, 1e-300))


def mean_sigmas(values: ArrayLike, target: ArrayLike, axis: int = 0) -> np.ndarray:
    """Deviations of means over runs from targets, in standard errors, as normal scores."""
    x = np.asarray(values, float)
    runs = x.shape[axis]
    error = x.std(axis=axis, ddof=1) / np.sqrt(runs)
    scores = (x.mean(axis=axis) - np.asarray(target, float)) / error
    return normal_sigmas(scores, runs)


def rms(values: ArrayLike, axis: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Root mean square over runs and its standard error."""
    square = np.asarray(values, float) ** 2
    mean = square.mean(axis=axis)
    runs = square.shape[axis]
    with np.errstate(invalid="ignore", divide="ignore"):
        error = square.std(axis=axis, ddof=1) / np.sqrt(runs) if runs > 1 else np.nan * mean
        return np.sqrt(mean), error / (2 * np.sqrt(mean))


def at_most(what: str, value: float, limit: float, why: str, target: str = "0") -> Check:
    """Check that a deviation is small enough; `why` names its unit and the reason of the limit."""
    return Check(what, f"{value:.3g}", target, f"≤ {limit:g} {why}".strip(), bool(value <= limit))


def worst(what: str, sigmas: ArrayLike, limit: float = 4.5) -> Check:
    """Check the largest of several deviations given in sigmas."""
    x = np.abs(np.asarray(sigmas, float)).ravel()
    x = x[np.isfinite(x)]
    plural = f"largest of {x.size}" if x.size > 1 else "deviation"
    return Check(what, f"{x.max():.2f} σ ({plural})", "0", f"≤ {limit:g} σ", bool(x.max() <= limit))
