"""Advances densities in time: steps, their error, the window and the mass."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .equations import Equations
from .radau import ESTIMATE_POWER, STAGES, STEP_POWER, TABLEAU, Step, extrapolate, radau_step
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
#: what begins empty has no scale of its own: the share of the first output time that is skipped
_ENTRY = 1e-9
#: steps between two looks at how densities fall off
_PREPARE = 4


class SolverError(RuntimeError):
    """The rate equations could not be solved any further.

    Attributes
    ----------
    time : float
        How far the solution came.
    """

    def __init__(self, message: str, time: float) -> None:
        super().__init__(message)
        self.time = time


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
        """Return the norm of `error` relative to the densities `n`."""
        moments = self._weights @ np.abs(n)
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(np.max((self._weights @ np.abs(error)) / moments))


class Integrator:
    """Solution at one time, and the means to go on from there.

    Parameters
    ----------
    equations : Equations
    n : ndarray of shape (M,)
        Densities at time zero.
    window : Window
    tolerance : float
        Relative error of a step, in the norm of `Norm`.
    orders : ndarray
        Moments to be controlled besides 0 to 3.

    Attributes
    ----------
    t : float
    n : ndarray of shape (M,)
    collisions : ndarray of shape (Q,)
        What is integrated along, see `Equations.rates`: events of each process per unit volume.
    steps, rejected : int
    corrected : float
        Sum of the relative corrections of the mass, see `_conserve`.
    """

    def __init__(
        self, equations: Equations, n: Float, window: Window, tolerance: float, orders: Float
    ) -> None:
        self.equations, self.n, self.window, self.tolerance = equations, n, window, tolerance
        self._orders = orders
        self.t = 0.0
        self.collisions = np.zeros(equations.quantities)
        self.steps = self.rejected = 0
        self.corrected = 0.0
        #: the estimate is of lower order than the step (Hairer and Wanner 1996, section IV.8)
        self._allowed = 0.1 * tolerance ** (ESTIMATE_POWER / STEP_POWER)
        self._before: tuple[float, Float] | None = None
        self._norm = Norm(orders, equations.sizes)
        equations.operator.prepare(n)
        self._start = self._rates()
        self._h = self._smallest = 0.0
        self._careful = 0

    def advance(self, end: float, stop: Callable[[], None] = lambda: None) -> None:
        """Take steps up to the time `end`; `stop` is called after each.

        Raises
        ------
        SolverError
            If the step length falls to nothing, with the time reached.
        """
        if self._h == 0.0 and self.t < end:
            if not self.n.any():
                self._enter(end)
            self._h = self._first_step(end)
            self._smallest = 1e-12 * self._h
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
            stop()

    def _enter(self, end: float) -> None:
        """Go from no particles at all to the first ones, which do not meet yet."""
        rates, along = self.equations.rates(np.array([self.t]), self.n[None, :])
        self.t = _ENTRY * end
        self.n, self.collisions = self.t * rates[0], self.collisions + self.t * along[0]
        self._start = self._rates()

    def _first_step(self, end: float) -> float:
        change = self._norm(self._start, self.n)
        if not np.isfinite(change):
            raise self._failure()
        return min(end, _FIRST_CHANGE / change) if change > 0 else 0.01 * end

    def _failure(self) -> SolverError:
        finite = bool(np.isfinite(self._start).all())
        reason = (
            "steps became too short: do the rates jump, or grow without bound?"
            if finite
            else "the rates are not finite numbers: does the kernel overflow for large sizes?"
        )
        return SolverError(f"the solution ends at t = {self.t:.8g}: {reason}", self.t)

    def _rates(self) -> Float:
        return self.equations.rates(np.array([self.t]), self.n[None, :])[0][0]

    def _attempt(self, h: float, end: float) -> None:
        """Try a step of length h up to the time `end`; on success this is the new state."""
        guess = np.zeros((STAGES, len(self.n)))
        if self._before is not None:
            guess = extrapolate(self._before[1], h / self._before[0])
        step = radau_step(
            self.equations, self.t, self.n, h, self._start, guess, self._norm, self.tolerance
        )
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
        largest, again = self.window.next(n)
        if again:
            self.rejected += 1
            self._resize(largest)
            self._h = h
            return
        self._accept(step, n, h, end)
        proposed = h * float(np.clip(factor, _LEAST, _MOST))
        # a step cut short at an output time says little of longer ones
        self._h = max(proposed, self._h) if h < self._h and factor > 1 else proposed
        if largest > len(n):
            self._resize(largest)
        if self.steps % _PREPARE == 0:
            self.equations.operator.prepare(self.n)

    def _accept(self, step: Step, n: Float, h: float, end: float) -> None:
        self.n = self._conserve(n, step, h)
        self.t = end
        self.steps += 1
        self._careful = max(0, self._careful - 1)
        self.collisions = self.collisions + step.along
        self._before = h, step.change
        self._start = step.rates[-1]

    def _conserve(self, n: Float, step: Step, h: float) -> Float:
        """Give the densities the mass that they had, less what left the window.

        The iteration ends when its error is small in `Norm`; what is left of it in the mass is
        taken out by a factor. While the tail of the window is empty, nothing leaves.
        """
        sizes = self.equations.sizes
        mass, now = float(self.n @ sizes), float(n @ sizes)
        if not (self.equations.conserves(self.n) and self.window.empty(n)):
            mass += h * float(TABLEAU.matrix[-1] @ (step.rates @ sizes))
        if not (mass > 0 and now > 0):
            return n
        self.corrected += abs(mass / now - 1.0)
        return n * (mass / now)

    def _resize(self, largest: int) -> None:
        """Add sizes, all empty."""
        more = largest - len(self.n)
        if more == 0:
            return
        self.equations.resize(largest)
        self._norm = Norm(self._orders, self.equations.sizes)
        self.n = np.pad(self.n, (0, more))
        if self._before is not None:
            self._before = self._before[0], np.pad(self._before[1], ((0, 0), (0, more)))
        self.equations.operator.prepare(self.n)
        self._start = self._rates()
