"""The rate equations once more: plain sums on a fixed window, and an integrator of SciPy.

Written from the equations alone and sharing no code with the solver. The gain is a convolution of
products that make up the kernel exactly, the loss the full matrix; from 1500 sizes on both are
Fourier transforms without any approximation. What passes the edge of the window is integrated too,
so every solution knows what its window costs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import fft, integrate, signal

Float = NDArray[np.float64]
OfTime = Callable[[float], float]

#: below this the kernel is a matrix and the gain a plain sum
_MATRIX = 1500
#: logarithm of the factor by which the largest size is lifted in transforms
_LIFT = 18.0
#: share of a moment that may pass the edge of the window
EDGE = 3e-11
#: relative error of a step of the integrator
RTOL = 1e-11
#: evaluations of the rates times sizes, of one window: minutes of processor time
MOST = 500_000_000


def one(t: float) -> float:
    return 1.0


@dataclass(frozen=True)
class Law:
    """A kernel as ``joint(i + j) sum_r left_r(i) right_r(j)``, and as it is usually written."""

    rate: Callable[[Float, Float], Float]
    products: Sequence[tuple[Callable[[Float], Float], Callable[[Float], Float]]]
    joint: Callable[[Float], Float] | None = None


class Sums:
    """Loss and gain on the sizes ``1 .. M``; `falls` if next to nothing is at the end of them."""

    def __init__(self, law: Law, largest: int, *, falls: bool = True) -> None:
        k = np.arange(1.0, largest + 1.0)
        self.largest = largest
        self._left = [np.broadcast_to(f(k), k.shape) for f, _ in law.products]
        self._right = [np.broadcast_to(g(k), k.shape) for _, g in law.products]
        both = np.arange(2.0, 2.0 * largest + 1.0)
        self._joint = None if law.joint is None else law.joint(both)
        self._matrix = law.rate(k[:, None], k[None, :]) if largest <= _MATRIX else None
        # transforms have the same error for all sizes: with the tail lifted it is less in the tail
        lift = _LIFT / largest if falls else 0.0
        self._lift, self._lower = np.exp(lift * k), np.exp(-lift * both)

    def loss(self, n: Float) -> Float:
        """Return ``sum_j K(k, j) n_j``."""
        if self._matrix is not None:
            return self._matrix @ n
        total = np.zeros(self.largest)
        for left, right in zip(self._left, self._right, strict=True):
            x = right * n
            total += left * (x.sum() if self._joint is None else self._hankel(x))
        return total

    def _hankel(self, x: Float) -> Float:
        """Return ``sum_j joint(i + j) x_j``, a correlation."""
        m = self.largest
        length = fft.next_fast_len(3 * m, real=True)
        found = fft.irfft(fft.rfft(self._joint, length) * fft.rfft(x[::-1], length), length)
        return found[m - 1 : 2 * m - 1]

    def gain(self, n: Float) -> Float:
        """Return ``sum_{i+j=k} K n_i n_j / 2`` of the sizes ``1 .. 2 M``."""
        terms = list(zip(self._left, self._right, strict=True))
        if self._matrix is not None:
            made = sum(np.convolve(left * n, right * n) for left, right in terms)
        else:
            x = self._lift * n
            made = self._lower * sum(signal.fftconvolve(f * x, g * x) for f, g in terms)
        made = 0.5 * (made if self._joint is None else self._joint * made)
        return np.concatenate(([0.0], made))


def slow_sums(law: Law, n: Float) -> tuple[Float, Float]:
    """Return loss and gain by two loops over all pairs: for a test of `Sums`."""
    m = len(n)
    loss, gain = np.zeros(m), np.zeros(2 * m)
    for i in range(1, m + 1):
        for j in range(1, m + 1):
            rate = float(law.rate(np.float64(i), np.float64(j))) * n[i - 1] * n[j - 1]
            loss[i - 1] += rate / n[i - 1]
            gain[i + j - 1] += 0.5 * rate
    return loss, gain


# What happens. Each adds its term to dn/dt, and says how often it happened.


@dataclass(frozen=True)
class Pairs:
    """Pairs meet at `factor` times the kernel; of the sum of two sizes becomes what `made` says.

    `made` is None for one particle, 0 for monomers, or shares of fragments drawn one by one.
    """

    name: str
    factor: OfTime = one
    made: Sequence[float] | None = None


@dataclass(frozen=True)
class Unary:
    """A particle vanishes at ``rate(k)``; `made` gives what appears from what vanishes."""

    name: str
    rate: Callable[[Float], Float]
    made: Callable[[Float, Float], Float] | None = None
    factor: OfTime = one


@dataclass(frozen=True)
class Inflow:
    """Particles of given sizes come in."""

    name: str
    rates: dict[int, float]
    factor: OfTime = one


@dataclass(frozen=True)
class Problem:
    """Everything that decides a solution.

    Attributes
    ----------
    start : callable
        Densities of the sizes ``1 .. M``.
    cut : int or None
        Particles above this size leave at once: M is this, and nothing is lost at the edge.
    largest : int
        The first M that is tried.
    breaks : sequence of float
        Times at which something jumps, has a kink, or is so short that it could be missed.
    """

    law: Law
    pairs: Sequence[Pairs]
    unary: Sequence[Unary]
    inflow: Sequence[Inflow]
    start: Callable[[int], Float]
    largest: int
    cut: int | None = None
    breaks: Sequence[float] = field(default=())


@dataclass(frozen=True)
class Solution:
    """What is compared, at each time; densities of shape ``(times, M)``.

    `edge` is the largest share of M0, M1, M2 or M3 that passed the edge of the window up to the
    end; it is part of the error.
    """

    n: Float
    moment: Float
    events: dict[str, Float]
    mass_in: Float
    mass_out: Float
    edge: float

    @property
    def window(self) -> int:
        """The number of sizes M."""
        return self.n.shape[1]


def fragments(shares: Sequence[float], largest: int) -> Float:
    """Return mean numbers of fragments of each size, of the masses ``1 .. largest``.

    The next fragment is drawn of those that fit, until nothing is left.
    """
    p = np.asarray(shares, float)
    found = np.zeros((largest + 1, len(p)))
    for mass in range(1, largest + 1):
        fits = p[: min(mass, len(p))]
        for k, share in enumerate(fits / fits.sum(), start=1):
            found[mass] += share * found[mass - k]
            found[mass, k - 1] += share
    return found[1:]


class TooLongError(RuntimeError):
    """Explicit steps would take too long."""


class _Rates:
    """The right-hand side: densities, events, mass in and out, and what passes the edge."""

    def __init__(self, problem: Problem, largest: int) -> None:
        self.problem, self.m = problem, largest
        self.left = MOST // largest
        self.k = np.arange(1.0, largest + 1.0)
        self.beyond = np.arange(largest + 1.0, 2.0 * largest + 1.0)
        self.sums = Sums(problem.law, largest, falls=problem.cut is None)
        self.rate = [np.broadcast_to(p.rate(self.k), self.k.shape) for p in problem.unary]
        self.debris = {p.name: fragments(p.made, 2 * largest) for p in problem.pairs if p.made}
        self.names = [p.name for p in (*problem.pairs, *problem.unary, *problem.inflow)]

    def __call__(self, t: float, y: Float) -> Float:
        self.left -= 1
        if self.left < 0:
            raise TooLongError(f"more than {MOST // self.m} evaluations for {self.m} sizes")
        n, m, k = y[: self.m], self.m, self.k
        dn, extra = np.zeros(m), np.zeros(len(y) - m)
        events, account = extra[: len(self.names)], extra[len(self.names) :]
        lost = n * self.sums.loss(n)
        made = self.sums.gain(n)
        at = 0
        for p in self.problem.pairs:
            f = p.factor(t)
            events[at] = f * 0.5 * lost.sum()
            at += 1
            dn -= f * lost
            if p.made is None:
                dn += f * made[:m]
                over = f * made[m:]
                if self.problem.cut:
                    account[1] += over @ self.beyond
                else:
                    account[2:] += [over @ self.beyond**q for q in range(4)]
            elif not p.made:
                dn[0] += f * (lost @ k)
            else:
                dn[: len(p.made)] += f * (made @ self.debris[p.name])
        for p, rate in zip(self.problem.unary, self.rate, strict=True):
            gone = p.factor(t) * rate * n
            events[at] = gone.sum()
            at += 1
            dn -= gone
            if p.made is None:
                account[1] += gone @ k
            else:
                dn += p.made(k, gone)
        for p in self.problem.inflow:
            for size, rate in p.rates.items():
                come = p.factor(t) * rate
                dn[size - 1] += come
                events[at] += come
                account[0] += come * size
            at += 1
        return np.concatenate((dn, extra))


def solve(
    problem: Problem, times: Sequence[float], *, rtol: float = RTOL, method: str = "DOP853"
) -> Solution:
    """Solve on a window that is made wider until next to nothing passes its edge.

    Raises
    ------
    TooLongError
        If that takes more than `MOST`.
    """
    largest = problem.cut or problem.largest
    while True:
        found = _solve(problem, times, largest, rtol, method)
        if problem.cut or found.edge <= EDGE:
            return found
        largest = int(1.4 * largest) + 1


def _solve(
    problem: Problem, times: Sequence[float], largest: int, rtol: float, method: str
) -> Solution:
    rates = _Rates(problem, largest)
    n = problem.start(largest)
    come = [(s, r) for p in problem.inflow for s, r in p.rates.items()]
    y = np.concatenate((n, np.zeros(len(rates.names) + 6)))
    k = rates.k
    # the scale below which a density is nothing: that of the mean size, less for larger ones
    there = n.sum() + sum(r for _, r in come) * times[-1]
    mass = n @ k + sum(s * r for s, r in come) * times[-1]
    atol = np.full(len(y), 1e-13 * there)
    atol[:largest] *= np.minimum(1.0, (mass / there / k) ** 3)
    atol[len(y) - 6 :] = 1e-13 * mass * (1.0 + mass / there) ** 2
    stops = sorted({0.0, *times, *(b for b in problem.breaks if 0.0 < b < times[-1])})
    found = []
    for a, b in pairwise(stops):
        # a jump at the end of a stretch belongs to the next one
        step = integrate.solve_ivp(
            lambda t, y, a=a, b=b: rates(min(max(t, a), np.nextafter(b, a)), y),
            (a, b), y, method=method, rtol=rtol, atol=atol,
        )  # fmt: skip
        if not step.success:
            raise RuntimeError(f"the reference ends at t = {step.t[-1]:g}: {step.message}")
        y = step.y[:, -1]
        if b in times:
            found.append(y)
    if times[0] == 0.0:
        found.insert(0, np.concatenate((n, np.zeros(len(rates.names) + 6))))
    return _solution(np.array(found), rates)


def _solution(found: Float, rates: _Rates) -> Solution:
    m, names = rates.m, rates.names
    n = found[:, :m]
    moment = np.array([n @ rates.k**q for q in range(4)]).T
    count = len(names)
    over, last = found[-1, m + count + 2 :], moment[-1]
    edge = float(np.max(np.abs(over) / np.where(last > 0, last, 1.0)))
    return Solution(
        n=n,
        moment=moment,
        events={name: found[:, m + at] for at, name in enumerate(names)},
        mass_in=found[:, m + count],
        mass_out=found[:, m + count + 1],
        edge=edge,
    )
