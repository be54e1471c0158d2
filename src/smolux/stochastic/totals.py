"""What many replicas come to together, and the warnings that follow from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from smolux.core.splits import EXACT
from smolux.core.state import (
    AT,
    BY_FACTOR,
    BY_KERNEL,
    BY_SPLITS,
    CLOCKS,
    EVENTS,
    EXTINCT,
    FLOOR,
    RAISED,
    REPAIRS,
    TRIALS,
    WORST_I,
    WORST_J,
)
from smolux.processes.base import PairProcess, UnaryProcess, text_of

from .plan import Plan
from .replicas import Group
from .subvolumes import SubvolumeReplica

Float = NDArray[np.float64]

#: share of candidates that become events, below which a run of so many of them warns
_RARE, _MANY = 1e-3, 1e5


def attempts_of(plan: Plan, groups: Sequence[Group | SubvolumeReplica]) -> Float:
    """Candidates for each process, of shape (R, P).

    Which process an encounter belongs to is decided last: its candidates are shared among the
    processes of pairs in the ratio of their events.
    """
    found = np.concatenate([g.state.attempts for g in groups]).astype(float)
    pairs = sum(isinstance(process, PairProcess) for process in plan.model.processes)
    alone = pairs + sum(isinstance(process, UnaryProcess) for process in plan.model.processes)
    if pairs:
        trials = np.concatenate([g.state.count[:, TRIALS] for g in groups])
        events = np.concatenate([g.state.events[:, :pairs] for g in groups]).astype(float)
        total = events.sum(axis=1, keepdims=True)
        share = np.divide(events, total, out=np.full(events.shape, 1 / pairs), where=total > 0)
        found[:, :pairs] = share * (trials - found[:, pairs:alone].sum(axis=1))[:, None]
    return found


@dataclass(frozen=True)
class Totals:
    """Sums over replicas; those of two parts add up to those of the whole.

    Attributes
    ----------
    replicas, unfinished, collisions, trials, repairs : int
        Unfinished are those that did not reach the last output time; trials are candidates.
    events, attempts : ndarray of shape (P,)
    missed : ndarray
        As in `smolux.core.state.State`.
    splits_raised : int
    factors_raised : ndarray of shape (P,)
        Replicas in which a bound of splits, or of the factor of a process, was raised.
    worst : tuple
        The highest bound that the kernel was found to need, and the sizes there.
    extinct, first : int, float
        Replicas that ended as one cluster at most, and when the first did; infinite if none.
    """

    replicas: int
    unfinished: int
    collisions: int
    trials: int
    repairs: int
    events: NDArray[np.int64]
    attempts: Float
    missed: Float
    splits_raised: int
    factors_raised: NDArray[np.int64]
    worst: tuple[float, int, int]
    extinct: int
    first: float

    @classmethod
    def of(cls, groups: Sequence[Group | SubvolumeReplica], attempts: Float) -> Totals:
        """Add up groups; the `attempts` are those of `attempts_of`."""
        clock = np.concatenate([g.state.clock for g in groups])
        count = np.concatenate([g.state.count for g in groups])
        recorded = np.concatenate([g.tally.scalars[..., AT] for g in groups])
        worst = int(clock[:, FLOOR].argmax())
        extinct = clock[np.isfinite(clock[:, EXTINCT]), EXTINCT]
        return cls(
            len(clock),
            int(np.isnan(recorded).any(axis=1).sum()),
            int(count[:, EVENTS].sum()),
            int(count[:, TRIALS].sum()),
            int(count[:, REPAIRS].sum()),
            np.concatenate([g.state.events for g in groups]).sum(axis=0),
            attempts.sum(axis=0),
            np.concatenate([g.state.missed for g in groups]).sum(axis=0),
            int((clock[:, RAISED] > 0.0).sum()),
            (clock[:, CLOCKS:] > 0.0).sum(axis=0),
            (float(clock[worst, FLOOR]), int(count[worst, WORST_I]), int(count[worst, WORST_J])),
            len(extinct),
            float(extinct.min(initial=np.inf)),
        )

    def __add__(self, other: Totals) -> Totals:
        """Take both parts together."""
        mine, others = vars(self), vars(other)
        both = {name: mine[name] + others[name] for name in mine if name not in ("worst", "first")}
        worst = max(self.worst, other.worst, key=lambda one: one[0])
        return Totals(**both, worst=worst, first=min(self.first, other.first))

    def warnings(self, plan: Plan) -> list[str]:
        """Return what a user should know of replicas of this plan."""
        found = [*plan.model.initial.remarks, *self._broken_bounds(plan)]
        found += self._rarely_accepted(plan)
        if self.extinct:
            left = "one cluster or none" if plan.model.open else "one cluster"
            found.append(
                f"{self.extinct} of {self.replicas} replicas ended as {left} (extinction), "
                f"the first at t = {self.first:.6g}: more particles, or population='doubling', "
                "put this off"
            )
        if self.unfinished:
            found.append(f"{self.unfinished} replicas did not reach the last output time")
        return found

    def _broken_bounds(self, plan: Plan) -> list[str]:
        """Say which bounds did not hold, and how many events did not take place till a repair."""
        found = []
        if self.repairs:
            _, i, j = self.worst
            lacking = _lacking(self.missed[BY_KERNEL], self.collisions)
            found.append(
                f"the kernel was found above its bound {self.repairs} times in {self.trials} "
                f"candidates, for example at the sizes {i} and {j}: {lacking}, give or take "
                f"{1.0 / np.sqrt(self.repairs):.0%} of that, before the bound was raised, besides "
                "what no candidate has met. A kernel written as a formula, or bounds= of "
                "from_function that hold, have no such error"
            )
        splits = [isinstance(p, UnaryProcess) and p.splits for p in plan.model.processes]
        cure = "A formula in i and j has proved bounds; of a function, from_function takes them"
        name = f"fragmentation, for a size above {EXACT},"
        lacking = _lacking(self.missed[BY_SPLITS], int(self.events[splits].sum()))
        found += self._raised(name, self.splits_raised, lacking, cure)
        cure = "A formula in t has proved bounds; of a function, smolux.law states them"
        for k, process in enumerate(plan.model.processes):
            name = f"{process.called}, {text_of(process, plan.model.kernel)},"
            lacking = _lacking(self.missed[BY_FACTOR + k], int(self.events[k]))
            found += self._raised(name, int(self.factors_raised[k]), lacking, cure)
        return found

    def _raised(self, name: str, replicas: int, lacking: str, cure: str) -> list[str]:
        """Warn of a rate of which the bound was raised in so many of the replicas."""
        if not replicas:
            return []
        return [
            f"the rate of {name} was found above its sampled bound in {replicas} of "
            f"{self.replicas} replicas: {lacking} before the bound was raised, besides what no "
            f"candidate has met. {cure}"
        ]

    def _rarely_accepted(self, plan: Plan) -> list[str]:
        """Warn of processes for which nearly all candidates come to nothing."""
        found = []
        for process, tried, done in zip(
            plan.model.processes, self.attempts, self.events, strict=True
        ):
            # after every event of any kind a candidate for an encounter is drawn afresh
            each = self.events.sum() if isinstance(process, PairProcess) else done
            if tried >= _MANY and each < _RARE * tried:
                cure = (
                    "another method, or 'auto', may be much faster"
                    if isinstance(process, PairProcess)
                    else "its rate differs much among sizes or splits that are nearly the same"
                )
                found.append(
                    f"{process.called}: {tried:.3g} candidates for {done} events, fewer than 1 in "
                    f"{1 / _RARE:g}; the result is right, but took long: {cure}"
                )
        return found


def _lacking(missed: float, events: int) -> str:
    """Say how many events did not take place, by the estimate of `smolux.core.bounds.repair`."""
    share = missed / max(events + missed, 1.0)
    return f"an estimated {missed:.3g} of its events, {share:.2g} of all, did not take place"
