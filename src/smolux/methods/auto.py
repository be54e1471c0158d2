"""The choice of a method from a model of what an event costs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ..processes.base import PairProcess
from .acceptance_rejection import AcceptanceRejection
from .base import Method, Rates
from .low_rank import LowRank
from .size_class import SizeClass

Float = NDArray[np.float64]

#: relative growth of the mean size in a step of the estimate, and the most steps
_GROWTH, _STEPS = 0.5, 60
#: quantiles of the sizes for which the kernel is evaluated
_SHARES = (np.arange(16) + 0.5) / 16
#: nanoseconds: a candidate of acceptance-rejection, and what an event costs besides; the same of
#: the size-class method, whose tables of pairs cost more for few particles
_TRIAL, _EVENT = 27.0, 35.0
_CLASS_EVENT, _CLASS_FEW = 68.0, 2.2e5
#: the low-rank method, for a kernel that is one product of factors, or the sum of such a product
#: and its transpose; with more products it is never the best
_ONE_PRODUCT = 83.0


@dataclass(frozen=True)
class Auto(Method):
    """Stands for the method that `choose` finds, until a run is planned."""

    name: ClassVar[str] = "auto"
    title: ClassVar[str] = "chosen by an estimate of the cost"


def _quantiles(mean: float, heavy: float, shares: Any, by_mass: bool = False) -> Float:
    """Sizes of a gamma law with a mean, and a mean by mass; the self-similar laws are near one."""
    excess = heavy / mean - 1.0
    if excess < 1e-9:
        return np.full(np.shape(shares), max(round(mean), 1), float)
    shape = 1.0 / excess
    found = special.gammaincinv(shape + by_mass, shares) * mean / shape
    return np.maximum(np.round(found), 1.0)


def _changes(processes: Sequence[PairProcess], t: float, sizes: Float) -> tuple[Float, Float]:
    """Return what an encounter of each pair of sizes adds to the number and the second moment."""
    n = len(sizes)
    number, square = np.zeros((2, n, n))
    for process in processes:
        factor = float(process.factor(t))
        out, counts = np.zeros((2, process.entries), np.int64)
        for a in range(n):
            for b in range(a, n):
                i, j = int(sizes[a]), int(sizes[b])
                made = process.outcome(i, j, out, counts)
                new = [(float(k), float(c)) for k, c in zip(out[:made], counts[:made], strict=True)]
                number[a, b] += factor * (sum(c for _, c in new) - 2.0)
                square[a, b] += factor * (sum(c * k * k for k, c in new) - i * i - j * j)
    upper = np.triu(np.ones((n, n)), 1)
    return number + (number * upper).T, square + (square * upper).T


def _course(
    rates: Rates,
    processes: Sequence[PairProcess],
    density: float,
    mean: float,
    heavy: float,
    end: float,
) -> Float:
    """Follow the mean sizes, by number and by mass: rows of both, the mean rate, and encounters.

    The two moment equations, closed by a gamma law.
    """
    t, mass = 0.0, density * mean
    course = []
    for _ in range(_STEPS):
        k = _quantiles(mean, heavy, _SHARES)
        rate = _rates(rates, k)
        gain = float((_changes(processes, t, k)[0] * rate).mean())
        m = _quantiles(mean, heavy, _SHARES, by_mass=True)
        by_mass = _rates(rates, m) / (m[:, None] * m)
        spread = float((_changes(processes, t, m)[1] * by_mass).mean())
        # relative changes of the number of particles and of the second moment
        down, up = 0.5 * gain * mass / mean, 0.5 * spread * mass / heavy
        fastest = max(abs(down), abs(up))
        step = min(_GROWTH / fastest if fastest else math.inf, end - t)
        total = sum(float(process.factor(t)) for process in processes)
        met = 0.5 * float(rate.mean()) * mass / mean * total * step
        course.append((mean, heavy, float(rate.mean()), met))
        mean = max(mean * math.exp(-down * step), 1.0)
        heavy = max(heavy * math.exp(up * step), mean)
        t += step
        if t >= end or heavy > 1e12:
            break
    return np.array(course)


def _rates(rates: Rates, sizes: Float) -> Float:
    values = rates.arrays(sizes[:, None], sizes[None, :])
    return np.where(np.isfinite(values), values, 0.0)


def candidates_per_event(
    rates: Rates,
    processes: Sequence[PairProcess],
    particles: int,
    density: float,
    sizes: tuple[float, float],
    end: float,
) -> float:
    """Estimate the candidates that acceptance-rejection needs for an event, up to the time `end`.

    Parameters
    ----------
    rates, processes, particles, density, end
        As for `choose`.
    sizes : tuple of float
        Mean sizes at the start, by number and by mass.
    """
    mean, heavy, average, met = _course(rates, processes, density, *sizes, end).T
    if not met.any():
        return 1.0
    last = 1.0 - 1.0 / max(particles, 2)
    largest = np.array([_quantiles(m, h, last) for m, h in zip(mean, heavy, strict=True)])
    largest = np.minimum(largest, particles * mean)
    one = np.ones(len(mean))
    bound = rates.bounds(one, largest, one, largest)[1]  # in one call: proofs are dear
    with np.errstate(all="ignore"):
        candidates = np.where(met > 0.0, np.maximum(bound / average, 1.0), 0.0)
    # encounters are weighed by their number for each particle present
    found = float(candidates @ met / met.sum())
    return found if math.isfinite(found) else math.inf


def choose(
    rates: Rates,
    processes: Sequence[PairProcess],
    particles: int,
    density: float,
    sizes: tuple[float, float],
    end: float,
) -> tuple[Method, str]:
    """Choose a method and say why.

    Parameters
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

    Returns
    -------
    method : Method
    reason : str
    """
    candidates = candidates_per_event(rates, processes, particles, density, sizes, end)
    plain = _EVENT + _TRIAL * candidates
    classes = _CLASS_EVENT + _CLASS_FEW / particles
    costs: dict[type[Method], float] = {AcceptanceRejection: plain, SizeClass: classes}
    known = rates.majorant
    if known is not None and len(known.terms) == 1 and known.least == 1.0:
        costs[LowRank] = _ONE_PRODUCT
    estimate = "more than a million" if candidates > 1e6 else f"about {candidates:.2g}"
    others = "".join(
        f"; the {method.title} method some {cost:.2g} ns"
        for method, cost in costs.items()
        if method is not AcceptanceRejection
    )
    return min(costs, key=costs.__getitem__)(), (
        f"acceptance-rejection would need {estimate} candidates an event, some "
        f"{min(plain, 1e9):.2g} ns{others}"
    )
