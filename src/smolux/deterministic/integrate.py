"""Advances densities in time: steps, their error, the window and the mass."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from smolux.errors import SolverError

from .account import Account, Entry
from .equations import Equations
from .radau import ESTIMATE_POWER, STAGES, STEP_POWER, TABLEAU, Step, extrapolate, radau_step
from .terms import MASS_OUT, OVER_MASS, Totals
from .timemesh import TimeMesh, within
from .window import Window

Float = NDArray[np.float64]

_SAFETY = 0.9
_LEAST, _MOST = 0.2, 4.0
#: the next step is kept so short that the iteration contracts by this factor
_CONTRACTION = 0.35
_AFTER_FAILURE = 0.4
#: after an iteration that failed, so many steps may grow by no more than this factor each
_CAREFUL_STEPS, _CAREFUL = 8, 1.15
#: first step: so much may change
_FIRST_CHANGE = 0.02
#: what begins empty has no scale of its own: the share of the time that is entered with, and of
#: the change that is not looked at then
_ENTRY, _ENTRIES = 1e-9, 32
#: share of the most particles that were ever there, below which there are none
_NOTHING = 1e-100
#: steps after which the sums are adapted to the densities again, at the latest
_PREPARE = 8
#: no moment is smaller
_LEAST = float(np.finfo(float).tiny)


class Norm:
    """Size of an error, relative: the largest of ``sum_k k**p |e_k| / M_p`` over several orders p.

    A bound for the relative error of each of these moments and, by Hölder's inequality, of all in
    between; `orders` are 0 to 3 and what lies outside of that among those asked for.
    """

    def __init__(self, orders: Float, sizes: Float) -> None:
        low, high = min(0.0, orders.min(initial=0.0)), max(3.0, orders.max(initial=3.0))
        kept = np.unique([low, 0.0, 1.0, 2.0, 3.0, high])
        self._weights = (sizes / len(sizes)) ** kept[:, None]

    def __call__(self, error: Float, n: Float) -> float:
        """Return the norm of `error`, or the largest of several, relative to the densities `n`."""
        moments = self._weights @ np.abs(n)
        found = np.max(np.abs(error) @ self._weights.T / np.maximum(moments, _LEAST))
        return float(found)

    def weights(self, n: Float) -> Float:
        """Return what an entry of an error counts at most."""
        moments = self._weights @ np.abs(n)
        return np.asarray((self._weights / np.maximum(moments, _LEAST)[:, None]).max(axis=0))


class Integrator:
    """Solution at one time, and the means to go on from there.

    Parameters
    ----------
    equations : Equations
    n : ndarray of shape (M,)
        Densities at time zero.
    window : Window
    mesh : TimeMesh
        Where steps must end.
    tolerance : float
        Relative error of a step, in the norm of `Norm`.
    orders : ndarray
        Moments to be controlled besides 0 to 3.

    Attributes
    ----------
    t : float
    n : ndarray of shape (M,)
    along : ndarray of shape (Q,)
        What is integrated along, see `smolux.deterministic.terms.Totals`.
    account : Account
    steps, rejected : int
    """

    def __init__(
        self,
        equations: Equations,
        n: Float,
        window: Window,
        mesh: TimeMesh,
        tolerance: float,
        orders: Float,
    ) -> None:
        self.equations, self.n, self.window, self.mesh = equations, n, window, mesh
        self.tolerance, self._orders = tolerance, orders
        self.t = 0.0
        self.along = np.zeros(equations.quantities)
        self.steps = self.rejected = 0
        self.account = Account(tolerance, float(n.sum()), float(n @ equations.sizes))
        #: the estimate is of lower order than the step (Hairer and Wanner 1996, section IV.8)
        self._allowed = 0.1 * tolerance ** (ESTIMATE_POWER / STEP_POWER)
        self._norm = Norm(orders, equations.sizes)
        self._h = self._smallest = 0.0
        self._careful = 0
        #: share of the highest moment that flows over the edge per time
        self._flow = 0.0
        self._most = float(n.sum())
        equations.encounters.prepare(n)
        self._begin()

    @property
    def totals(self) -> Totals:
        """What was integrated along, by name."""
        return Totals.of(self.along)

    def advance(self, end: float, stop: Callable[[], None] = lambda: None) -> None:
        """Take steps up to the time `end`; `stop` is called after each.

        Raises
        ------
        SolverError
            If the step length falls to nothing, or if number and mass do not come out as what the
            processes make and take, with the time reached.
        """
        while self.t < end:
            low, high = self.mesh.piece(self.t)
            if self.t == low:
                self._begin()
            self._cross(min(end, high), stop)
        problem = self.account.problem
        if problem is not None:
            raise SolverError(
                f"the solution ends at t = {self.t:.8g}: {problem}: take a smaller tolerance, or "
                "method='direct'",
                self.t,
            )

    def _begin(self) -> None:
        """Begin a piece of time at the present time: the rates may have jumped."""
        self.equations.span = within(*self.mesh.piece(self.t))
        self._before: tuple[float, Float] | None = None
        self._start = self._rates()

    def _cross(self, end: float, stop: Callable[[], None]) -> None:
        """Take steps up to a time before which the factors do not jump."""
        if not self.n.any() and not self._enter(end):
            self.t = end
        if self.t < end and not 0.0 < self._h < np.inf:
            self._h = self._first_step(end)
        while self.t < end:
            left = end - self.t
            if self._h >= left * (1 - 1e-9):
                self._attempt(left, end)
            else:
                # two equal steps rather than a long one and a rest
                h = min(self._h, 0.5 * left)
                self._attempt(h, self.t + h)
            if self._h < max(self._smallest, 1e-14 * self.t):
                raise self._failure()
            if not self.n.any():
                return
            stop()

    def _enter(self, end: float) -> bool:
        """Go from no particles at all to the first ones, which hardly meet yet.

        Return False if nothing comes in up to `end`.
        """
        h = _ENTRY * (end - self.t)
        for _ in range(_ENTRIES):
            times = self.t + h * TABLEAU.nodes
            come, along = self.equations.rates(times, np.zeros((STAGES, len(self.n))))
            n = h * (TABLEAU.matrix[-1] @ come)
            if not n.any():
                # nothing at the beginning of the piece: at its end?
                if h >= 0.5 * (end - self.t):
                    return False
                h = min(1e3 * h, end - self.t)
                continue
            rates, _ = self.equations.rates(times[-1:], n[None, :])
            ignored = self._norm(h * (rates[0] - come[-1]), n)
            if ignored <= _ENTRY:
                break
            h *= max(_ENTRY / ignored, 1e-6)
        self.t += h
        self.n, self.along = n, self.along + h * (TABLEAU.matrix[-1] @ along)
        self._most = max(self._most, float(n.sum()))
        self._start, self._h = self._rates(), 0.0
        return True

    def _first_step(self, end: float) -> float:
        change = self._norm(self._start, self.n)
        if not np.isfinite(change):
            raise self._failure()
        left = end - self.t
        h = min(left, _FIRST_CHANGE / change) if change > 0 else 0.01 * left
        self._smallest = 1e-12 * h
        return h

    def _failure(self) -> SolverError:
        finite = bool(np.isfinite(self._start).all())
        reason = (
            "steps became too short: do the rates jump, or grow without bound?"
            if finite
            else "the rates are not finite numbers: does the kernel overflow for large sizes?"
        )
        return SolverError(f"the solution ends at t = {self.t:.8g}: {reason}", self.t)

    def _open(self, text: str) -> SolverError:
        """Return what is raised if the account does not close."""
        return SolverError(
            f"the solution ends at t = {self.t:.8g}: number and mass of the terms do not add up: "
            f"{text}, on {len(self.n)} sizes with a {self.equations.encounters.name} sum over "
            "pairs; "
            "take method='direct', or a larger tolerance",
            self.t,
        )

    def _rates(self) -> Float:
        return self.equations.rates(np.array([self.t]), self.n[None, :])[0][0]

    def _attempt(self, h: float, end: float) -> None:
        """Try a step of length h up to the time `end`; on success this is the new state."""
        guess = np.zeros((STAGES, len(self.n)))
        if self._before is not None:
            guess = extrapolate(self._before[1], h / self._before[0])
        step = radau_step(
            self.equations, self.t, self.n, h, self._start, guess, self._norm, self.tolerance,
            self._kept,
        )  # fmt: skip
        if step is None:
            self.rejected += 1
            self._h, self._careful = _AFTER_FAILURE * h, _CAREFUL_STEPS
            return
        n = self.n + step.change[-1]
        error = self._norm(step.error, n) / self._allowed
        factor = _SAFETY * max(error, 1e-10) ** (-1.0 / ESTIMATE_POWER)
        if step.contraction > 0:
            factor = min(factor, max(0.5, _CONTRACTION / step.contraction))
        if self._careful:
            factor = min(factor, _CAREFUL)
        if not error <= 1.0:
            self.rejected += 1
            self._h = h * float(np.clip(factor, _LEAST, 1.0)) if np.isfinite(error) else 0.1 * h
            return
        self._flow = self.window.share(n, self.equations.beyond(end, n))
        count, again = self.window.next(len(n), self._flow, end, h)
        if again:
            self.rejected += 1
            self._resize(count)
            self._h = h
            return
        along = self._settled(step, n)
        if not self._entered(step, along, n, h):
            return
        self.along = self.along + along
        self._accept(step, n, h, end)
        proposed = h * float(np.clip(factor, _LEAST, _MOST))
        # a step cut short at an output time says little of longer ones
        self._h = max(proposed, self._h) if h < self._h and factor > 1 else proposed
        if count > len(n):
            self._resize(count)
        elif self.steps % _PREPARE == 0:
            self.equations.encounters.prepare(self.n)

    @property
    def _kept(self) -> Float | None:
        """Weights of densities whose sum does not depend on them: the sizes, while none leave."""
        stays = self._flow <= self.tolerance and self.equations.conserves(self.n)
        return self.equations.sizes if stays else None

    def _entered(self, step: Step, along: Float, n: Float, h: float) -> bool:
        """Enter a step into the account; False if its sums over pairs are to be found anew."""
        sizes, totals = self.equations.sizes, Totals.of(along)
        of_rates = Totals.of(step.along_rates)
        flow = h * (TABLEAU.matrix[-1] @ step.rates)
        number, mass = (
            Entry(float(self.n @ w), float(n @ w), float(flow @ w), there, last)
            for w, there, last in (
                (np.ones_like(sizes), of_rates.number, totals.number),
                (sizes, of_rates.mass, totals.mass),
            )
        )
        if not self.account.closes(number, mass):
            if self.equations.refine(self.n):
                self.rejected += 1
                self._begin()
                return False
            raise self._open(f"{max(number.apart, mass.apart):.1e} in a step")
        self.account.add(number, mass)
        self.equations.encounters.closed()
        return True

    def _accept(self, step: Step, n: Float, h: float, end: float) -> None:
        self.n, self.t = n, end
        self.steps += 1
        self._careful = max(0, self._careful - 1)
        self._before = h, step.change
        self._start = step.rates[-1]
        number = float(np.abs(n).sum())
        self._most = max(self._most, number)
        if number < _NOTHING * self._most:  # below it nothing is told from rounding any more
            self.n = np.zeros_like(n)

    def _settled(self, step: Step, n: Float) -> Float:
        """Return what was integrated along, with the mass that leaves as the densities have it.

        It is that of the last iterate but one; the mass of the densities tells what the last
        correction changed of it.
        """
        along, totals = step.along.copy(), Totals.of(step.along)
        sizes = self.equations.sizes
        missing = float((n - self.n) @ sizes) - totals.mass
        if abs(missing) <= self.tolerance * float(n @ sizes):
            along[MASS_OUT if self.equations.leaves else OVER_MASS] -= missing
        return along

    def _resize(self, count: int) -> None:
        """Add sizes, all empty."""
        more = count - len(self.n)
        if more == 0:
            return
        self.equations.resize(count)
        self._norm = Norm(self._orders, self.equations.sizes)
        self.n = np.pad(self.n, (0, more))
        if self._before is not None:
            self._before = self._before[0], np.pad(self._before[1], ((0, 0), (0, more)))
        self.equations.encounters.prepare(self.n)
        self._start = self._rates()
