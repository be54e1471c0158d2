"""The axes of the matrix: starts, processes, kernels and what varies in time, each in two forms.

One is given to the solver, the other to the reference; they share numbers and nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import special

import smolux as sx

from .reference import Float, Inflow, Law, OfTime, Pairs, Unary, one

P = sx.processes


@dataclass(frozen=True)
class Start:
    """Sizes at time zero.

    Attributes
    ----------
    scale, density : float
        A typical size, weighted by mass, and the number density.
    largest : int
        Beyond it next to nothing lies.
    turnovers : float
        Up to the last time the typical size meets its like about so often.
    """

    name: str
    initial: Any
    densities: Callable[[int], Float]
    scale: float
    largest: int
    turnovers: float
    density: float = 1.0


def _given(name: str, sizes: dict[int, float], scale: float, turnovers: float) -> Start:
    def densities(largest: int) -> Float:
        n = np.zeros(largest)
        for size, density in sizes.items():
            n[size - 1] = density
        return n

    return Start(
        name, sx.initial.from_sizes(sizes), densities, scale, max(sizes), turnovers,
        sum(sizes.values()),
    )  # fmt: skip


def _lognormal(name: str, median: float, sigma: float, turnovers: float) -> Start:
    width = math.log(sigma)

    def densities(largest: int) -> Float:
        # rounded to whole sizes, what lies below 1/2 counts as 1; upper tails have all digits
        edges = np.log((np.arange(largest + 1) + 0.5) / median) / width
        edges[0] = -np.inf
        above = special.ndtr(-edges)
        return np.where(edges[1:] > 0, above[:-1] - above[1:], np.diff(special.ndtr(edges)))

    scale, largest = median * math.exp(1.5 * width**2), int(median * math.exp(8.3 * width)) + 1
    return Start(name, sx.initial.lognormal(median, sigma), densities, scale, largest, turnovers)


def _exponential(name: str, mean: float, turnovers: float) -> Start:
    def densities(largest: int) -> Float:
        return (1 - 1 / mean) ** np.arange(largest) / mean

    largest = int(37 * mean)
    return Start(name, sx.initial.exponential(mean), densities, 2 * mean, largest, turnovers)


_EVEN = dict.fromkeys(range(95, 106), 1 / 11)
STARTS = (
    _given("monomers", {1: 1.0}, 1, 8.0),
    _given("2", {2: 1.0}, 2, 4.0),
    _given("20", {20: 1.0}, 20, 1.0),
    _given("32", {32: 1.0}, 32, 0.7),
    _given("33", {33: 1.0}, 33, 0.7),
    _given("47", {47: 1.0}, 47, 0.6),
    _given("100", {100: 1.0}, 100, 0.5),
    _given("1000", {1000: 1.0}, 1000, 0.4),
    _given("1 and 100", {1: 0.5, 100: 0.5}, 99, 0.5),
    _given("1, few of 60", {1: 1.0, 60: 1e-3}, 4.5, 1.0),
    _given("3, 7 and 50", {3: 0.5, 7: 0.3, 50: 0.2}, 38, 0.6),
    _given("95 to 105", _EVEN, 100, 0.5),
    _exponential("exponential 10", 10.0, 1.0),
    _lognormal("lognormal 100, 1.05", 100.0, 1.05, 0.5),
    _lognormal("lognormal 20, 2", 20.0, 2.0, 0.5),
    Start("empty", sx.initial.empty(), np.zeros, 1.0, 1, 8.0),
)


@dataclass(frozen=True)
class Kernel:
    """A kernel; `pace` and `most` say how many turnovers a window of moderate size allows."""

    name: str
    kernel: Any
    law: Law
    pace: float = 1.0
    most: float = 100.0


def _power(p: float) -> Callable[[Float], Float]:
    return lambda k: k**p


_ROOTS = "1 + 0.2*(sqrt(i) + sqrt(j)) + 0.1*(i*j)**0.25"
KERNELS = (
    Kernel(
        "constant", sx.kernels.Constant(),
        Law(lambda i, j: np.ones(np.broadcast_shapes(i.shape, j.shape)), [(_power(0), _power(0))]),
    ),
    Kernel(
        "additive", sx.kernels.Additive(),
        Law(lambda i, j: i + j, [(_power(1), _power(0)), (_power(0), _power(1))]),
        0.6, 1.4,
    ),
    Kernel(
        "multiplicative", sx.kernels.Multiplicative(),
        Law(lambda i, j: i * j, [(_power(1), _power(1))]), 0.25, 0.5,
    ),
    Kernel(
        "Brownian", sx.kernels.Brownian(),
        Law(
            lambda i, j: (np.cbrt(i) + np.cbrt(j)) * (1 / np.cbrt(i) + 1 / np.cbrt(j)),
            [(_power(0), lambda k: 2.0), (_power(1 / 3), _power(-1 / 3)),
             (_power(-1 / 3), _power(1 / 3))],
        ),
    ),
    Kernel(
        "ballistic", sx.kernels.Ballistic(),
        Law(
            lambda i, j: (np.cbrt(i) + np.cbrt(j)) ** 2 * np.sqrt(1 / i + 1 / j),
            [(_power(1 / 6), _power(-1 / 2)), (_power(-1 / 2), _power(1 / 6)),
             (_power(-1 / 6), lambda k: 2.0 * k ** (-1 / 6))],
            np.sqrt,
        ),
    ),
    Kernel(
        "formula", sx.kernels.formula(_ROOTS),
        Law(
            lambda i, j: 1 + 0.2 * (np.sqrt(i) + np.sqrt(j)) + 0.1 * (i * j) ** 0.25,
            [(_power(0), lambda k: 1 + 0.2 * np.sqrt(k)), (lambda k: 0.2 * np.sqrt(k), _power(0)),
             (lambda k: 0.1 * k**0.25, _power(0.25))],
        ),
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Scale:
    """What rates are made of: a typical size, the largest, the number density and the time."""

    size: float
    largest: int
    density: float
    time: float


@dataclass(frozen=True)
class Varying:
    """A factor of mean one over the time: what the solver takes, a plain function, its breaks."""

    name: str
    given: Callable[[float], Any]
    plain: Callable[[float], OfTime]
    breaks: Callable[[float], Sequence[float]]


def _box(time: float) -> OfTime:
    low, high = 0.42 * time, 0.78 * time

    def box(t: float) -> float:
        return 1 / 0.36 if low <= t < high else 0.0

    return box


#: centre and width of the pulse, in units of the time
_CENTRE, _WIDTH = 0.37, 0.003
_PERIODS = 6


def _pulse(time: float) -> str:
    height = 1 / (_WIDTH * math.sqrt(math.pi))
    return f"{height!r}*exp(-((t - {_CENTRE * time!r})/{_WIDTH * time!r})**2)"


def _plain_pulse(time: float) -> OfTime:
    height = 1 / (_WIDTH * math.sqrt(math.pi))

    def pulse(t: float) -> float:
        apart = (t / time - _CENTRE) / _WIDTH
        return height * math.exp(-(apart**2)) if abs(apart) < 9 else 0.0

    return pulse


VARYING = (
    Varying("none", lambda T: 1.0, lambda T: one, lambda T: ()),
    Varying("ramp", lambda T: f"{2 / T!r}*t", lambda T: lambda t: 2 * t / T, lambda T: ()),
    Varying(
        "pulse", _pulse, _plain_pulse,
        lambda T: [(_CENTRE + q * _WIDTH) * T for q in (-9, -6, -3, 0, 3, 6, 9)],
    ),
    Varying("box", _box, _box, lambda T: (0.42 * T, 0.78 * T)),
    Varying(
        "periodic",
        lambda T: f"pi*max(0, sin({2 * math.pi * _PERIODS / T!r}*t))",
        lambda T: lambda t: math.pi * max(0.0, math.sin(2 * math.pi * _PERIODS / T * t)),
        lambda T: [0.5 * q / _PERIODS * T for q in range(1, 2 * _PERIODS)],
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Process:
    """A process beside aggregation.

    Attributes
    ----------
    family : str
        Only one of a family can be in a model.
    given : callable
        ``given(scale, varying)`` makes what the solver takes.
    plain : callable
        ``plain(scale, factor)`` makes what the reference takes.
    cut : callable or None
        The size above which particles leave at once.
    """

    name: str
    family: str
    given: Callable[[Scale, Any], Any]
    plain: Callable[[Scale, OfTime], Any]
    cut: Callable[[Scale], int] | None = None


def _times(number: float, varying: Any) -> Any:
    """Return a rate that is a function of time: for processes whose rate takes no other factor."""
    if isinstance(varying, str):
        return f"{number!r}*({varying})"
    if callable(varying):
        return lambda t: number * varying(t)
    return number * varying


def _broken(k: Float, gone: Float) -> Float:
    """Return what appears if all ways to break a particle in two are equally frequent."""
    each = np.where(k > 1, gone / np.maximum(k - 1, 1), 0.0)
    return 2 * np.append(np.cumsum(each[::-1])[::-1][1:], 0.0)


def _evaporated(k: Float, gone: Float) -> Float:
    made = np.append(gone[1:], 0.0)
    made[0] += gone.sum()
    return made


def _sources(*which: str) -> Callable[[Scale], dict[int, float]]:
    def rates(s: Scale) -> dict[int, float]:
        few = {1: 0.5 * s.density / s.time}
        large = {int(3.3 * s.size) + 60: 0.02 * s.density / s.time}
        return (few if "few" in which else {}) | (large if "large" in which else {})

    return rates


def _source(name: str, *which: str) -> Process:
    rates = _sources(*which)
    return Process(
        name, "source", lambda s, v: P.Source(rates(s), varying=v),
        lambda s, f: Inflow("source", rates(s), f),
    )  # fmt: skip


def _above(s: Scale) -> int:
    return max(int(2.6 * s.size) + 1, s.largest, int(3.3 * s.size) + 60)


PROCESSES = (
    Process(
        "shattering", "shattering", lambda s, v: P.Shattering(_times(0.3, v)),
        lambda s, f: Pairs("shattering", lambda t: 0.3 * f(t), made=()),
    ),
    Process(
        "debris", "debris", lambda s, v: P.CollisionalFragmentation(_times(0.3, v), [3, 2, 1]),
        lambda s, f: Pairs("collisional-fragmentation", lambda t: 0.3 * f(t), made=(3, 2, 1)),
    ),
    Process(
        "scission", "fragmentation",
        lambda s, v: P.Fragmentation(0.8 / (s.size * s.time), varying=v),
        lambda s, f: Unary(
            "fragmentation", lambda k: 0.4 / (s.size * s.time) * (k - 1), _broken, f
        ),
    ),
    Process(
        "breakage", "fragmentation",
        lambda s, v: P.Fragmentation(f"{1 / s.time!r}/(i + j)", varying=v),
        lambda s, f: Unary("fragmentation", lambda k: 0.5 / s.time * (k - 1) / k, _broken, f),
    ),
    Process(
        "evaporation", "evaporation",
        lambda s, v: P.Evaporation(f"{0.8 / s.time!r}*(k/{s.size!r})**(1/3)", varying=v),
        lambda s, f: Unary(
            "evaporation",
            lambda k: np.where(k > 1, 0.8 / s.time * (k / s.size) ** (1 / 3), 0.0),
            _evaporated, f,
        ),
    ),
    Process(
        "dilution", "removal", lambda s, v: P.Removal(0.5 / s.time, varying=v),
        lambda s, f: Unary("removal", lambda k: 0.5 / s.time, None, f),
    ),
    Process(
        "deposition", "removal",
        lambda s, v: P.Removal(f"{0.5 / s.time!r}*sqrt(k/{s.size!r})", varying=v),
        lambda s, f: Unary("removal", lambda k: 0.5 / s.time * np.sqrt(k / s.size), None, f),
    ),
    Process(
        "removal above", "removal", lambda s, v: P.Removal(above=_above(s)),
        lambda s, f: None, _above,
    ),
    _source("source", "few"),
    _source("source of large", "large"),
    _source("source of both", "few", "large"),
)  # fmt: skip
