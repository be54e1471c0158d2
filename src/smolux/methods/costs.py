"""The choice of a method from a model of what an event costs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from smolux.model import Model
from smolux.processes.base import PairProcess

from .acceptance_rejection.method import AcceptanceRejection
from .base import Method, Rates
from .low_rank.method import LowRank
from .size_class.method import SizeClass

Float = NDArray[np.float64]

#: pivots of the rough rate equations: per octave of sizes, and up to how many times the particles
_PER_OCTAVE, _BEYOND = 2, 1000.0
#: share of the particles that meet in a step; that of the first step, and its growth; most steps
_CHANGE, _FIRST, _RAMP, _STEPS = 0.04, 1e-4, 1.4, 300
#: change of the sizes in a step, as a share of the particles, below which they are steady
_STEADY = 1e-3
#: particles present, as a share of those at the start, with doubling
_PRESENT = 0.72
#: quantiles that stand for the sizes at the start
_SHARES = (np.arange(64) + 0.5) / 64
#: nanoseconds of acceptance-rejection: an event but for its candidates, a candidate by whether its
#: rate is read or computed, and what a group of replicas costs besides, for its start and bounds
_EVENT, _TRIAL, _CHEAP_TRIAL, _START = 5.0, 30.0, 20.0, 2.3e6
#: of the size-class method, for which nearly every candidate is an event: an event, what tables add
#: to it for few particles, and the start
_CLASS_EVENT, _CLASS_FEW, _CLASS_START = 40.0, 8.0e4, 1.7e6
#: of the low-rank method, for a kernel that is one product of factors, or the sum of such a product
#: and its transpose; with more products it is never the best
_PRODUCT_EVENT, _PRODUCT_START = 155.0, 0.85e6


@dataclass(frozen=True)
class Auto(Method):
    """Stands for the method that `choose` finds, until a run is planned."""

    name: ClassVar[str] = "auto"
    title: ClassVar[str] = "chosen by an estimate of the cost"


def _start(mean: float, heavy: float) -> Float:
    """Sizes of a gamma law with a mean, and a mean by mass."""
    excess = heavy / mean - 1.0
    if excess < 1e-9:
        return np.array([mean])
    # by a sample, which needs no special functions: these take longer to load than all of this
    sample = np.random.default_rng(0).standard_gamma(1.0 / excess, 4096)
    return np.asarray(np.maximum(np.quantile(sample, _SHARES) * mean * excess, 1.0))


class Circumstances(NamedTuple):
    """What the cost of a run is estimated from.

    Attributes
    ----------
    rates : Rates
        Of the kernel, weighted.
    processes : sequence of PairProcess
    particles : int
        Simulated particles at the start.
    density : float
        Number density at the start.
    sizes : tuple of float
        Mean sizes at the start, by number and by mass.
    end : float
        Last output time.
    replicas : int
        That share a start.
    doubles : bool
        Whether the volume is doubled when few particles are left.
    """

    rates: Rates
    processes: Sequence[PairProcess]
    particles: int
    density: float
    sizes: tuple[float, float]
    end: float
    replicas: int = 1
    doubles: bool = True


class _Grid:
    """Rate equations on pivots 1, 2, 3, 4, 6, 8, ...

    What appears between two pivots is shared by them, so that number and mass are kept.
    """

    def __init__(self, rates: Rates, processes: Sequence[PairProcess], largest: float) -> None:
        steps = np.arange(int(_PER_OCTAVE * math.log2(max(largest, 8.0))) + 2)
        self.size = np.unique(np.round(2.0 ** (steps / _PER_OCTAVE)))
        self.i, self.j = np.triu_indices(len(self.size))
        half = np.where(self.i == self.j, 0.5, 1.0)
        pairs = self.size[self.i], self.size[self.j]

        def table(law: Callable[[Any, Any], Float]) -> Float:
            rate = law(*pairs)
            return np.where(np.isfinite(rate), half * rate, 0.0)

        self.rate = table(rates.physical or rates.arrays)
        #: simulated particles for a particle of each size, and the rate of their pairs
        self.weight = np.ones(len(self.size)) if rates.weights is None else rates.weights(self.size)
        self.simulated = self.rate if rates.weights is None else table(rates.arrays)
        self.processes = processes
        self.gain = [self._gain(process) for process in processes]

    def _gain(self, process: PairProcess) -> tuple[Any, Any, Float]:
        """Return pairs, the pivots where something appears when they meet, and how much."""
        sizes, counts = np.zeros((2, process.entries), np.int64)
        whole = [int(size) for size in self.size]
        made = []
        for pair, (i, j) in enumerate(zip(self.i.tolist(), self.j.tolist(), strict=True)):
            for e in range(process.outcome(whole[i], whole[j], sizes, counts)):
                made.append((pair, sizes[e], counts[e]))
        pair, size, number = np.array(made, float).T
        place, number = self._spread(size, number)
        return np.tile(pair.astype(int), 2), place, number

    def _spread(self, size: Float, number: Float) -> tuple[Any, Float]:
        over = np.maximum(size / self.size[-1], 1.0)
        size, number = size / over, number * over
        right = np.clip(np.searchsorted(self.size, size), 1, len(self.size) - 1)
        low, high = self.size[right - 1], self.size[right]
        up = (size - low) / (high - low)
        return (
            np.concatenate((right - 1, right)),
            np.concatenate((number * (1.0 - up), number * up)),
        )

    def _sum(self, place: Any, number: Float) -> Float:
        return np.asarray(np.bincount(place, number, len(self.size)), float)

    def course(self, density: float, start: Float, end: float) -> list[tuple[Float, float, float]]:
        """Follow the densities; with the mean rate, and the events for each particle present.

        One entry a step, all as the simulated particles have them.
        """
        one = np.full(len(start), density / len(start))
        n = self._sum(*self._spread(start, one))
        mass, t, found = float(n @ self.size), 0.0, []
        for k in range(_STEPS):
            factors = [float(process.factor(t)) for process in self.processes]
            total = sum(factors)
            met = self.rate * n[self.i] * n[self.j]
            number, events = float(n.sum()), float(met.sum()) * total
            if not events > 0.0:
                break
            z = n * self.weight
            mean = float((self.simulated * z[self.i] * z[self.j]).sum()) / float(z.sum()) ** 2
            share = min(_CHANGE, _FIRST * _RAMP**k)
            step = min(share * number / events, end - t)
            gain = sum(
                f * self._sum(place, met[pair] * made)
                for f, (pair, place, made) in zip(factors, self.gain, strict=True)
            )
            lost = self._sum(self.i, met) + self._sum(self.j, met)
            lost = np.divide(lost, n, out=np.zeros_like(n), where=n > 0.0)
            # implicit in the loss: no density gets negative, however long the step
            new = (n + step * gain) / (1.0 + step * total * lost)
            new *= mass / (new @ self.size)
            found.append((new * self.weight, 2.0 * mean, mean * float(z.sum()) * total * step))
            steady = share == _CHANGE and np.abs(new - n).sum() < _STEADY * number
            n, t = new, t + step
            if t >= end or steady:
                break
        if found and t < end:  # the rest at the last state
            z = n * self.weight
            found.append((z, found[-1][1], found[-1][1] * 0.5 * float(z.sum()) * total * (end - t)))
        return found


def effort(run: Circumstances) -> tuple[float, float]:
    """Estimate the candidates that acceptance-rejection needs for an event, and all events.

    By a rough solution of the rate equations, and the largest size to be expected of so many
    particles.
    """
    largest_of_all = min(_BEYOND * run.particles * run.sizes[0], 1e15)
    grid = _Grid(run.rates, run.processes, largest_of_all)
    course = grid.course(run.density, _start(*run.sizes), run.end)
    if not course:
        return 1.0, 0.0
    densities = np.array([entry[0] for entry in course])
    total = densities.sum(axis=1)
    # few are left in a fixed volume, and none of them is larger than all
    number = run.particles * (np.full(len(course), _PRESENT) if run.doubles else total / total[0])
    above = np.cumsum(densities[:, ::-1], axis=1)[:, ::-1] / total[:, None]
    present = np.maximum((above * number[:, None] >= 1.0).sum(axis=1) - 1, 0)
    largest = grid.size[present]
    average, met = np.array([entry[1:] for entry in course]).T
    if not run.doubles:
        largest = np.minimum(largest, max(run.particles * run.sizes[0], 1.0))
        met = np.where(number >= 2.0, met, 0.0)
    top, place = np.unique(largest, return_inverse=True)
    one = np.ones(len(top))
    bound = run.rates.bounds(one, top, one, top)[1][place]  # in one call: proofs are dear
    with np.errstate(all="ignore"):
        candidates = np.where(met > 0.0, np.maximum(bound / average, 1.0), 0.0)
    events = float(met @ number)
    found = float(candidates @ (met * number)) / events if events > 0.0 else 1.0
    return found if math.isfinite(found) else math.inf, events


def unforeseen(model: Model) -> tuple[Method, str] | None:
    """Choose for systems that the estimate does not cover: not for encounters alone."""
    pairs = [p for p in model.processes if isinstance(p, PairProcess)]
    if model.kernel.in_time:
        what = "a kernel that varies in time"
    elif pairs == list(model.processes) and not any(p.random or p.shared for p in pairs):
        return None
    else:
        what = "these processes"
    return SizeClass(), f"sizes are not foreseen for {what}, and its cost depends on them least"


def costs(run: Circumstances) -> tuple[dict[type[Method], float], float]:
    """Estimate what an event costs by the methods that may be chosen.

    Returns
    -------
    costs : dict
        Nanoseconds for each method.
    candidates : float
        Of acceptance-rejection for an event.
    """
    candidates, events = effort(run)
    together = max(run.replicas * events, 1.0)
    trial = _CHEAP_TRIAL if run.rates.cheap else _TRIAL
    found: dict[type[Method], float] = {
        AcceptanceRejection: _EVENT + trial * candidates + _START / together,
        SizeClass: _CLASS_EVENT + _CLASS_FEW / run.particles + _CLASS_START / together,
    }
    known = run.rates.majorant
    if known is not None and len(known.terms) == 1 and known.least == 1.0:
        found[LowRank] = _PRODUCT_EVENT + _PRODUCT_START / together
    return found, candidates


def choose(run: Circumstances) -> tuple[Method, str]:
    """Choose a method and say why.

    Returns
    -------
    method : Method
    reason : str
    """
    found, candidates = costs(run)
    estimate = "more than a million" if candidates > 1e6 else f"about {candidates:.2g}"
    others = "".join(
        f"; the {method.title} method some {cost:.2g} ns"
        for method, cost in found.items()
        if method is not AcceptanceRejection
    )
    return min(found, key=found.__getitem__)(), (
        f"acceptance-rejection would need {estimate} candidates an event, some "
        f"{min(found[AcceptanceRejection], 1e9):.2g} ns{others}"
    )
