"""Steady states of the rate equations, and the eigenvalues that decide on their stability."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack
from scipy.sparse import linalg as krylov

from ..content import frozen
from ..errors import InputError
from ..model import Model
from ..processes import Aggregation
from .equations import Equations
from .integrate import SolverError
from .operator import OperatorFactory
from .terms import Totals
from .window import Window

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]

_LIMIT = 1 << 17
#: bands of the preconditioner
_BANDS = 32
_ITERATIONS = 120
#: relative residual of a linear system
_SOLVED = 1e-9
#: factor by which the time step of the continuation may grow or shrink at once
_FASTER, _SLOWER = 10.0, 0.3
#: sizes at the start, exponentially distributed
_MEAN, _FIRST = 8.0, 256
#: tolerance that decides on the number of sizes
_WINDOW_TOLERANCE = 1e-9
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


class Linearisation:
    """The rates near given densities: residual, products with the Jacobian, shifted systems.

    What would leave the window comes back as monomers, so that the mass is conserved exactly. The
    rates are quadratic in the densities, so the difference ``(f(n + v) - f(n - v)) / 2`` is the
    product of the Jacobian with v without an error but rounding.

    Parameters
    ----------
    equations : Equations
    n : ndarray of shape (M,)
    """

    def __init__(self, equations: Equations, n: Float) -> None:
        self.equations, self.n, self.sizes = equations, n, equations.sizes
        equations.operator.prepare(n)
        rates, along = equations.rates(np.zeros(1), n[None, :])
        # products are with vectors that do not fall off as the densities do
        equations.operator.prepare(None)
        self.rates = self._closed(rates[0])
        #: densities times these are of about the same size
        self.weight = self.sizes**2
        loss, gain = equations.shares(0.0)
        frequency = loss * equations.operator.loss(n[None, :])[0] + equations.lone_losses(0.0)
        #: collisions per time, of a particle and of the mass
        self.scale = 2.0 * float(Totals.of(along[0]).events.sum()) / float(n.sum())
        self.turnover = float((n * frequency) @ self.sizes)
        count = min(_BANDS, len(n))
        self._frequency = frequency
        self._band = gain * equations.operator.columns(count) * n[:count]

    def _closed(self, rates: Float) -> Float:
        rates[0] -= float(rates @ self.sizes)
        return rates

    def product(self, v: NDArray[Any]) -> NDArray[Any]:
        """Return the Jacobian times v."""
        parts = np.array([v.real, v.imag] if np.iscomplexobj(v) else [v])
        # of the size of the densities, so that neither drowns in the rounding of the other
        size = float((np.abs(parts) @ self.sizes).max()) / float(self.n @ self.sizes)
        if size == 0.0:
            return np.zeros_like(v)
        shifted = np.concatenate([self.n + parts / size, self.n - parts / size])
        rates = self.equations.rates(np.zeros(len(shifted)), shifted)[0]
        above, below = np.split(rates, 2)
        found = [self._closed(row) for row in (above - below) * (0.5 * size)]
        return found[0] + 1j * found[1] if len(found) == 2 else found[0]

    def solve(self, shift: complex, right: NDArray[Any], tolerance: float) -> NDArray[Any]:
        """Return ``(shift - J)^{-1} right``, by GMRES with the bands of J below the diagonal.

        The part of J that the bands leave out is nearly of low rank: few iterations are needed.
        """
        dtype: type = complex if np.iscomplexobj(right) or isinstance(shift, complex) else float
        matrix = np.empty((len(self.n), self._band.shape[1] + 1), dtype)
        matrix[:, 0] = shift + self._frequency
        matrix[:, 1:] = -self._band
        banded = lapack.ztbtrs if dtype is complex else lapack.dtbtrs

        def precondition(v: NDArray[Any]) -> NDArray[Any]:
            return banded(matrix.T, v.astype(dtype)[:, None], uplo="L")[0][:, 0]

        def act(z: NDArray[Any]) -> NDArray[Any]:
            v = z / self.weight
            return self.weight * precondition(shift * v - self.product(v))

        count = len(self.n)
        operator = krylov.LinearOperator((count, count), matvec=act, dtype=dtype)
        z, _ = krylov.gmres(
            operator,
            self.weight * precondition(right),
            rtol=tolerance,
            atol=0.0,
            restart=min(100, count),
            maxiter=3,
        )
        return z / self.weight


def steady_state(
    model: Model,
    *,
    largest: int | None = None,
    tolerance: float = 1e-11,
    guess: Float | None = None,
) -> SteadyState:
    """Find a steady state of a model, stable or not, with the mass of its initial condition.

    Implicit Euler steps, each one Newton iteration, that grow as the residual falls and end as
    Newton's method (pseudo-transient continuation).

    Parameters
    ----------
    model : Model
        With rates that do not depend on time.
    largest : int, optional
        Number of sizes; grows until the rest is negligible if left out.
    tolerance : float
        For the residual, see `SteadyState`.
    guess : ndarray of shape (M,), optional
        Densities to begin with.

    Returns
    -------
    SteadyState

    Raises
    ------
    InputError
        If a rate depends on time, or there is aggregation alone.
    SolverError
        If none is found: mass moves to ever larger sizes.

    References
    ----------
    C. T. Kelley and D. E. Keyes, SIAM J. Numer. Anal. 35, 508 (1998),
    doi:10.1137/S0036142996304796.
    """
    model = frozen(model)
    varying = [p.name for p in model.processes if p.factor.constant is None]
    if varying:
        raise InputError(
            f"process {varying[0]!r}: its rate depends on time, so there is no steady state; "
            "give it a number"
        )
    if all(isinstance(p, Aggregation) for p in model.processes):
        raise InputError(
            "processes: with aggregation alone there is no steady state; add one that brings back "
            "small sizes, such as smolux.processes.Shattering(0.01)"
        )
    if model.open:
        raise InputError(
            "processes: with sources or removal no mass is given that a steady state could have; "
            "solve up to a time when nothing changes any more"
        )
    start = model.initial.densities(model.initial.largest)
    mass = float(start @ np.arange(1.0, len(start) + 1.0))
    window = Window(largest or _LIMIT, 2.0, _WINDOW_TOLERANCE, largest is not None)
    n = _guess(guess, largest or _FIRST)
    equations = Equations(model, OperatorFactory(model.kernel, "auto", 1e-12), len(n), mass)
    step, before = np.inf, 0.0
    for iteration in range(_ITERATIONS):
        n = n * (mass / float(n @ equations.sizes))
        near = Linearisation(equations, n)
        residual = float(np.abs(near.rates) @ near.sizes) / near.turnover
        share = window.share(n, equations.beyond(0.0, n))
        count = window.next(len(n), share, 1.0 / near.scale, 0.0)[0]
        if residual <= tolerance and count == len(n):
            return SteadyState(model, n, residual, iteration)
        if not np.isfinite(residual):
            break
        if iteration == 0:
            step = (1.0 if guess is None else 1e3) / near.scale
        else:
            step *= float(np.clip(before / residual, _SLOWER, _FASTER))
        before = residual
        n = np.maximum(n + near.solve(1.0 / step, near.rates, _SOLVED), 0.0)
        if count > len(n):
            n = np.pad(n, (0, count - len(n)))
            equations.resize(len(n))
    raise SolverError(
        f"no steady state found with up to {len(n)} sizes: is there a process that brings back "
        "small sizes, such as shattering?",
        np.inf,
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
    factory = OperatorFactory(state.model.kernel, "auto", 1e-12)
    return Linearisation(Equations(state.model, factory, len(state.n), mass), state.n)
