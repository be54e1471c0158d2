"""Replicas until it is sure enough: a target for the interval of one observable."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smolux.confidence import Sample, enlarged, half_width
from smolux.errors import Problem, did_you_mean

Float = NDArray[np.float64]

#: fewest replicas from which an interval is judged, see `smolux.confidence`
FEWEST = 8
#: pilots for each replica that is needed
_PILOTS = 0.25
#: observables with a name of their own; M2 and n_5 stand for any order and size
TARGETS = ("number_density", "largest", "M2", "n_5")


@dataclass(frozen=True)
class Target:
    """An observable that intervals or efficiencies are of.

    Attributes
    ----------
    target : str
        ``number_density``, ``largest``, ``M<order>`` or ``n_<size>``.
    """

    target: str

    @property
    def order(self) -> float | None:
        """Order of the moment, if it is one."""
        return float(self.target[1:]) if self.target.startswith("M") else None

    @property
    def size(self) -> int | None:
        """Size of the clusters, if it is a density of one size."""
        return int(self.target[2:]) if self.target.startswith("n_") else None


@dataclass(frozen=True)
class StoppingRule(Target):
    """As many replicas as make the 95 % interval of an observable short enough.

    Attributes
    ----------
    error : float
        Half width of the interval over the mean that is wanted, at every output time.
    first, most : int
        Pilots at the start, and replicas of the result at the least; replicas at the most.
    """

    error: float
    first: int
    most: int


@dataclass(frozen=True)
class Assessment:
    """How near the target error is.

    Attributes
    ----------
    error : float
        The largest half width over the mean of all output times.
    at : int
        The output time of it.
    needed : float
        Replicas that will be about enough, of which no more than `StoppingRule.most` are run.
    following : int
        Replicas to have before the next look; as many as there are if it is over.
    """

    error: float
    at: int
    needed: float
    following: int


@dataclass(frozen=True)
class Trial:
    """What the pilot replicas say.

    Attributes
    ----------
    pilots : int
        How many pilots there should be; no more than there are if they are enough.
    replicas : int
        Replicas of the result.
    """

    pilots: int
    replicas: int


def plan_replicas(rule: StoppingRule, values: Float, moved: NDArray[np.bool_]) -> Trial:
    """Say how many replicas it takes, from pilots that will be no part of the result.

    Then their number does not depend on the values of the result, whose mean has no bias and whose
    interval is that of a fixed number of replicas. They are enough with a probability of 80 %. The
    pilots are a quarter of the replicas, so that the variance is known well enough for that.

    Parameters
    ----------
    rule : StoppingRule
    values : ndarray of shape (R, T)
        The observable in the pilots.
    moved : ndarray of bool, shape (T,)
        Whether anything has happened in any of them.

    References
    ----------
    C. Stein, Ann. Math. Stat. 16, 243 (1945), doi:10.1214/aoms/1177731088, for two stages.
    """
    pilots = len(values)
    assessment = assess(rule, values, moved)
    wanted = min(assessment.needed, rule.most)
    if math.isinf(assessment.error):  # too little was seen to say anything
        return Trial(min(2 * pilots, rule.most), rule.most)
    most = max(pilots, math.ceil(_PILOTS * rule.most))
    if pilots < math.floor(_PILOTS * wanted) and pilots < most:
        # few pilots overrate what it takes, so they are no more than doubled
        return Trial(min(math.ceil(_PILOTS * wanted), 2 * pilots, most), 0)
    return Trial(pilots, min(max(math.ceil(wanted), rule.first), rule.most))


def assess(rule: StoppingRule, values: Float, moved: NDArray[np.bool_]) -> Assessment:
    """Say how near the target error is, and with how many replicas to look again.

    Parameters
    ----------
    rule : StoppingRule
    values : ndarray of shape (R, T)
        The observable.
    moved : ndarray of bool, shape (T,)
        Whether anything has happened in any replica.
    """
    replicas, sample = len(values), Sample.of(values)
    scale = np.abs(sample.mean)
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.where(sample.variance > 0, half_width(sample) / scale, 0.0)
        needed = np.where(sample.variance > 0, enlarged(sample, rule.error * scale), 0.0)
    # the same count in every replica, above all none, is luck and no proof of certainty
    luck = moved & (sample.variance == 0) & ((sample.mean == 0) | (rule.size is not None))
    relative[luck] = needed[luck] = np.inf
    at = int(np.argmax(relative))
    error, most = float(relative[at]), float(needed.max())
    if error <= rule.error:
        return Assessment(error, at, max(most, float(FEWEST)), replicas)
    following = max(replicas + max(1, replicas // 4), math.ceil(min(most, 2 * replicas)))
    return Assessment(
        error, at, max(most, replicas + 1.0), max(replicas, min(following, rule.most))
    )


def shortfall(rule: StoppingRule, assessment: Assessment, replicas: int, time: float) -> str:
    """Warning of a run that ended before the target error was reached."""
    if math.isinf(assessment.error):
        return (
            f"target_error = {rule.error:g} was not reached with {replicas} replicas: of "
            f"{rule.target} too little was seen at t = {time:g} to give it an interval; use more "
            "particles, or leave out this time"
        )
    return (
        f"target_error = {rule.error:g} was not reached with {replicas} replicas: the 95 % "
        f"interval of {rule.target} is ±{100 * assessment.error:.2g} % at t = {time:g}; it takes "
        f"about {assessment.needed:.2g} replicas, or as many times more particles"
    )


def named(
    target: Any,
    orders: Sequence[float],
    sizes: int,
    problems: list[str],
    key: str = "target",
) -> str:
    """Return the name of an observable; add what is wrong with it to `problems`."""
    name = target if isinstance(target, str) else ""
    if name in ("number_density", "largest"):
        return name
    if re.fullmatch(r"M-?\d+(\.\d+)?", name):
        if float(name[1:]) in orders:
            return name
        listed = ", ".join(f"{p:g}" for p in orders)
        cure = f"this moment is not computed; orders has {listed}"
    elif re.fullmatch(r"n_\d+", name):
        if 1 <= int(name[2:]) <= sizes:
            return name
        cure = f"sizes = {sizes} is the last that is counted by itself"
    else:
        cure = f"is unknown{did_you_mean(name, TARGETS)} (any order in M2, any size in n_5)"
    problems.append(Problem(key, cure, target))
    return name
