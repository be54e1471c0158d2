"""Steady states of the rate equations, and the eigenvalues that decide on their stability."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import linalg as krylov

from smolux.errors import InputError, SolverError
from smolux.functions.content import frozen
from smolux.model import Model
from smolux.runtime.progress import Progress

from .arguments import renamed
from .encounters import Encounters
from .equations import Equations
from .linearisation import Linearisation
from .window import Window

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]

_LIMIT = 1 << 19
#: iterations in all, and so many without a smaller residual
_ITERATIONS, _STALLED = 300, 40
#: relative residual of a linear system, and of one far from the steady state
_SOLVED, _ROUGHLY = 1e-9, 1e-4
#: residual above which the state is far from steady
_FAR = 1e-4
#: what a step changes of the number or the mass: aimed at, and at most
_AIM, _MOST = 0.4, 0.8
#: mass of negative densities that a step may leave, to be set to zero
_NEGATIVE = 0.02
#: factor by which the time step of the continuation grows, at least and at most, and shrinks
_SLOWEST, _FASTEST, _SHORTER = 1.3, 10.0, 0.3
_TRIES = 30
#: sizes at the start, exponentially distributed
_MEAN, _FIRST = 8.0, 256
#: tolerance that decides on the number of sizes, and far from the steady state
_WINDOW_TOLERANCE, _ROUGH_TOLERANCE = 1e-8, 1e-4
#: an eigenvalue smaller than this, relative to the rate of collisions, is that of the mass
_ZERO = 1e-6


@dataclass(frozen=True)
class SteadyState:
    """Densities at which gains and losses balance.

    Attributes
    ----------
    model : Model
    n : ndarray of shape (M,)
        Densities of the sizes ``1 .. M``.
    residual : float
        ``sum_k k |dn_k/dt|`` over the mass that collides per time.
    iterations : int
    """

    model: Model
    n: Float
    residual: float
    iterations: int

    @property
    def sizes(self) -> Float:
        """The sizes ``1 .. M``."""
        return np.arange(1.0, len(self.n) + 1.0)

    def moment(self, order: float) -> float:
        """Return ``sum_k k**order n_k``."""
        return float(self.n @ self.sizes**order)


def steady_state(
    model: Model,
    *,
    window: int | None = None,
    tolerance: float = 1e-11,
    guess: Float | None = None,
    progress: Callable[[Progress], None] | None = None,
    largest: int | None = None,
) -> SteadyState:
    """Find a steady state of a model, stable or not, with the mass of its initial condition.

    Implicit Euler steps, each one Newton iteration, as long as the change in each allows, that end
    as Newton's method (pseudo-transient continuation).

    Parameters
    ----------
    model : Model
        With rates that do not depend on time.
    window : int, optional
        Number of sizes; grows until the rest is negligible if left out.
    tolerance : float
        For the residual, see `SteadyState`.
    guess : ndarray of shape (M,), optional
        Densities to begin with.
    progress : callable, optional
        Called with a `Progress` before each step.
    largest : int, optional
        Former name of `window`.

    Returns
    -------
    SteadyState

    Raises
    ------
    InputError
        If a rate depends on time, or there is aggregation alone.
    SolverError
        If there is none: mass moves to ever larger sizes.

    References
    ----------
    C. T. Kelley and D. E. Keyes, SIAM J. Numer. Anal. 35, 508 (1998),
    doi:10.1137/S0036142996304796.
    """
    window = renamed("window", window, "largest", largest)
    model = frozen(model)
    if model.varying:
        raise InputError(
            f"{model.varying[0]}: its rate depends on time, so there is no steady state; "
            "give it a number"
        )
    if model.only_aggregates:
        raise InputError(
            "processes: with aggregation alone there is no steady state; add one that brings back "
            "small sizes, such as smolux.processes.Shattering(0.01)"
        )
    if model.open:
        raise InputError(
            "processes: with sources or removal no mass is given that a steady state could have; "
            "solve up to a time when nothing changes any more"
        )
    return _Search(model, window, guess, progress).run(tolerance)


class _Search:
    """Pseudo-transient continuation on a window that grows."""

    def __init__(
        self,
        model: Model,
        window: int | None,
        guess: Float | None,
        progress: Callable[[Progress], None] | None,
    ) -> None:
        start = model.initial.densities(model.initial.largest)
        self.model, self.progress, self.window = model, progress, window
        physics = model.reduced
        self.mass = float(start @ np.arange(1.0, len(start) + 1.0))
        self.n = _guess(guess, window or _FIRST)
        encounters = Encounters(physics, "auto", 1e-12)
        self.equations = Equations(physics, encounters, len(self.n), self.mass)
        self.started = time.perf_counter()
        self.near_steady = guess is not None
        #: whether there is no room for what moves to larger sizes
        self.full = False

    def run(self, tolerance: float) -> SteadyState:
        """Return the steady state."""
        step, best = 0.0, (np.inf, 0)
        for iteration in range(_ITERATIONS):
            self.n *= self.mass / float(self.n @ self.equations.sizes)
            near = Linearisation(self.equations, self.n)
            self.residual = residual = float(np.abs(near.rates) @ near.sizes) / near.turnover
            self._tell(iteration)
            best = min(best, (residual, iteration))
            if not np.isfinite(residual) or iteration - best[1] > _STALLED or self.full:
                break
            done = residual <= tolerance and not self._grow(_WINDOW_TOLERANCE, near.scale)
            if done and not self.full:
                return SteadyState(self.model, self.n, residual, iteration)
            step = step or (1e3 if self.near_steady else 1.0) / near.scale
            if residual > tolerance:
                # no better than Newton's method can make of it, nor than is needed
                enough = max(residual, min(0.03 * tolerance / residual, 1e-6))
                step = self._advance(near, step, float(np.clip(enough, _SOLVED, _ROUGHLY)))
                rough = residual > _FAR
                self._grow(_ROUGH_TOLERANCE if rough else _WINDOW_TOLERANCE, near.scale)
        raise self._failure()

    def _advance(self, near: Linearisation, step: float, tolerance: float) -> float:
        """Take a step, shorter if it changes too much; return the length of the next one."""
        number, mass = float(self.n.sum()), self.mass
        for _ in range(_TRIES):
            change = near.solve(1.0 / step, near.rates, tolerance, mass=True)
            new = self.n + change
            share = max(
                float(np.abs(change).sum()) / number, float(np.abs(change) @ near.sizes) / mass
            )
            negative = -float(np.minimum(new, 0.0) @ near.sizes) / mass
            if share <= _MOST and negative <= _NEGATIVE:
                break
            step *= _SHORTER
        else:
            raise self._failure()
        self.n = np.maximum(new, 0.0)
        return step * float(np.clip(_AIM / max(share, 1e-300), _SLOWEST, _FASTEST))

    def _grow(self, tolerance: float, scale: float) -> bool:
        """Add sizes if too much flows over the edge in a time ``1 / scale``; return whether so."""
        window = Window(self.window or 2 * _LIMIT, 2.0, tolerance, self.window is not None)
        self.equations.encounters.prepare(self.n)
        share = window.share(self.n, self.equations.overflow(0.0, self.n))
        count = window.next(len(self.n), share, 1.0 / scale, 0.0)[0]
        self.full = count > len(self.n) >= _LIMIT
        count = count if self.window else min(count, _LIMIT)
        more = count - len(self.n)
        if more > 0:
            self.n = np.pad(self.n, (0, more))
            self.equations.resize(count)
        return more > 0

    def _tell(self, iteration: int) -> None:
        if self.progress is not None:
            seconds = time.perf_counter() - self.started
            self.progress(
                Progress(
                    np.nan,
                    "looking for a steady state",
                    iteration,
                    "steps",
                    iteration / seconds if seconds > 0 else 0.0,
                    note=f"residual {self.residual:.2g}",
                    counts={
                        "iteration": iteration, "residual": self.residual,
                        "window": len(self.n), "seconds": seconds,
                    },
                )
            )  # fmt: skip

    def _failure(self) -> SolverError:
        reason = (
            "mass moves to ever larger sizes: is there a process that brings back enough of it to "
            "small ones?"
            if self.full
            else f"the residual stays at {self.residual:.2g}: raise tolerance, or give a guess"
        )
        return SolverError(
            f"no steady state found with up to {len(self.n)} sizes; {reason}", np.inf
        )


def _guess(guess: Float | None, largest: int) -> Float:
    if guess is not None:
        return np.array(guess, float)
    return np.exp(-np.arange(1.0, largest + 1.0) / _MEAN)


def eigenvalues(state: SteadyState, count: int = 6) -> Complex:
    """Return eigenvalues of the Jacobian at a steady state: those that decide on its stability.

    Parameters
    ----------
    state : SteadyState
    count : int
        How many, at least; those nearest to a shift a little to the right of zero.

    Returns
    -------
    ndarray of complex
        By real part, largest first; a pair is given as both. The eigenvalue zero, which a change of
        the mass has, is left out. The state is unstable if the first has a positive real part.

    Notes
    -----
    Shifted and inverted, by the implicitly restarted Arnoldi method (ARPACK).
    """
    near = linearisation(state)
    shift = 0.1 * near.scale
    m = len(state.n)
    operator = krylov.LinearOperator(
        (m, m),
        matvec=lambda z: -near.weight * near.solve(shift, z / near.weight, _SOLVED),
        dtype=float,
    )
    values = krylov.eigs(
        operator,
        k=min(count + 2, m - 2),
        ncv=min(max(20, 3 * count), m - 1),
        v0=near.weight * state.n * np.cos(near.sizes),
        tol=1e-8,
        return_eigenvectors=False,
    )
    found = shift + 1.0 / values
    found = found[np.abs(found) > _ZERO * near.scale]
    return found[np.argsort(-found.real, kind="stable")]


def linearisation(state: SteadyState) -> Linearisation:
    """Return the rates near a steady state."""
    mass = state.moment(1.0)
    model = state.model.reduced
    encounters = Encounters(model, "auto", 1e-12)
    return Linearisation(Equations(model, encounters, len(state.n), mass), state.n)
