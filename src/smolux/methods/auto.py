"""The choice of a method from a model of what an event costs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..processes.base import PairProcess
from .acceptance_rejection import AcceptanceRejection
from .base import Method, Rates
from .size_class import SizeClass

Float = NDArray[np.float64]

#: relative growth of the mean size in a step of the estimate, and the most steps
_GROWTH, _STEPS = 0.5, 60
#: quantiles of the sizes for which the kernel is evaluated
_QUANTILES = (np.arange(24) + 0.5) / 24
#: nanoseconds: a candidate of acceptance-rejection, and what an event costs besides; the same of
#: the size-class method, whose tables of pairs cost more for few particles
_TRIAL, _EVENT = 27.0, 35.0
_CLASS_EVENT, _CLASS_FEW = 75.0, 2.0e5


@dataclass(frozen=True)
class Auto(Method):
    """Stands for the method that `choose` finds, until a run is planned."""

    name: ClassVar[str] = "auto"
    title: ClassVar[str] = "chosen by an estimate of the cost"


def _sizes(mean: float, shares: Any) -> Float:
    """Quantiles of the geometric law, to which aggregation with a constant kernel leads."""
    if mean <= 1.0:
        return np.ones(np.shape(shares))
    return np.maximum(np.ceil(np.log1p(-np.asarray(shares)) / math.log1p(-1.0 / mean)), 1.0)


def _mean_rate(rates: Rates, mean: float) -> float:
    k = _sizes(mean, _QUANTILES)
    values = rates.arrays(k[:, None], k[None, :])
    return float(np.mean(np.where(np.isfinite(values), values, 0.0)))


def _gain(process: PairProcess, mean: float) -> int:
    """Particles that an encounter of two particles of mean size adds."""
    sizes, counts = np.zeros((2, process.entries), np.int64)
    size = max(round(mean), 1)
    return int(counts[: process.outcome(size, size, sizes, counts)].sum()) - 2


def candidates_per_event(
    rates: Rates,
    processes: Sequence[PairProcess],
    particles: int,
    density: float,
    mean: float,
    end: float,
) -> float:
    """Estimate the candidates that acceptance-rejection needs for an event, up to the time `end`.

    Sizes are taken for geometrically distributed, with the mean that the rate equation of their
    number gives.
    """
    t, mass = 0.0, density * mean
    course = []
    for _ in range(_STEPS):
        rate, number = _mean_rate(rates, mean), mass / mean
        factors = [float(process.factor(t)) for process in processes]
        gains = [_gain(process, mean) for process in processes]
        loss = -0.5 * rate * number * sum(f * g for f, g in zip(factors, gains, strict=True))
        step = min(_GROWTH / abs(loss) if loss else math.inf, end - t)
        course.append((mean, rate, 0.5 * rate * number * sum(factors) * step))
        mean = max(mean * (1.0 + loss * step), 1.0)
        t += step
        if t >= end or mean > 1e15:
            break
    means, average, events = np.array(course).T
    largest = np.array([float(_sizes(m, 1.0 - 1.0 / max(particles, 2))) for m in means])
    one = np.ones(len(means))
    bound = rates.bounds(one, largest, one, largest)[1]  # in one call: proofs are dear
    if not events.any():
        return 1.0
    with np.errstate(all="ignore"):
        candidates = np.where(events > 0.0, np.maximum(bound / average, 1.0), 0.0)
    found = float(candidates @ events / events.sum())
    return found if math.isfinite(found) else math.inf


def choose(
    rates: Rates,
    processes: Sequence[PairProcess],
    particles: int,
    density: float,
    mean: float,
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
    density, mean : float
        Number density and mean size at the start.
    end : float
        Last output time.

    Returns
    -------
    method : Method
    reason : str
    """
    candidates = candidates_per_event(rates, processes, particles, density, mean, end)
    plain = _EVENT + _TRIAL * candidates
    classes = _CLASS_EVENT + _CLASS_FEW / particles
    estimate = "more than a million" if candidates > 1e6 else f"about {candidates:.2g}"
    method: Callable[[], Method] = AcceptanceRejection if plain <= classes else SizeClass
    return method(), (
        f"acceptance-rejection would need {estimate} candidates an event, some "
        f"{min(plain, 1e9):.2g} ns; the size-class method some {classes:.2g} ns"
    )
