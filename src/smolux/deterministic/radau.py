"""Radau IIA steps of order seven with an iteration that needs only a banded triangular solve."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.linalg import lapack

Float = NDArray[np.float64]

STAGES = 4
_MAX_ITERATIONS = 10
#: the iteration error may be this share of the tolerance
_ITERATION_SHARE = 0.05
#: mean contraction above which a step is given up, after so many iterations
_SLOW, _PATIENCE = 0.8, 6
#: ratio of two corrections above which iterates are mixed, of so many before
_MIXED, _DEPTH = 0.15, 5


@runtime_checkable
class Weighted(Protocol):
    """A norm that says what an entry counts."""

    def __call__(self, error: Float, n: Float) -> float:
        """Return the norm of `error` relative to the densities `n`."""

    def weights(self, n: Float) -> Float:
        """Return about what an entry of an error counts in the norm, shape (M,)."""


class Rates(Protocol):
    """The equations ``dn/dt = f(t, n)`` with quantities that are only integrated along."""

    def rates(self, times: Float, n: Float) -> tuple[Float, Float]:
        """Return f of shape (S, M) and rates of what is integrated along, shape (S, Q)."""

    def jacobian(self, t: float, n: Float, h: float) -> tuple[Float, Float]:
        """Return the stiff part of the Jacobian: minus its diagonal, and J bands below, (M, J)."""


@dataclass(frozen=True)
class Step:
    """A step that was solved for.

    Attributes
    ----------
    change : ndarray of shape (S, M)
        ``n(t + c_i h) - n(t)`` at the stages; the last is the end of the step.
    error : ndarray of shape (M,)
        Estimate of the local error, of lower order than the step.
    rates : ndarray of shape (S, M)
    along : ndarray of shape (Q,)
        Increase of what is integrated along.
    along_rates : ndarray of shape (Q,)
        The same for the densities of `rates`, which a last correction has changed since.
    iterations : int
    contraction : float
        The largest ratio of two changes in the iteration.
    """

    change: Float
    error: Float
    rates: Float
    along: Float
    along_rates: Float
    iterations: int
    contraction: float


class _Tableau:
    """Nodes, coefficients and their eigenvectors, for any number of stages."""

    def __init__(self, stages: int) -> None:
        polynomial = np.zeros(stages + 1)
        polynomial[[stages - 1, stages]] = -1.0, 1.0
        # they are real; from NumPy 2.5 on all roots come as complex numbers
        self.nodes = 0.5 * (np.sort(legendre.legroots(polynomial).real) + 1.0)
        self.nodes[-1] = 1.0
        powers = np.vander(self.nodes, increasing=True)
        order = np.arange(1, stages + 1)
        integrals = self.nodes[:, None] ** order / order
        self.matrix = integrals @ np.linalg.inv(powers)
        values, vectors = np.linalg.eig(self.matrix)
        # of a pair of conjugates one is enough
        half = values.imag >= -1e-12
        self.values, self.vectors = values[half], vectors[:, half]
        self.inverse = np.linalg.inv(vectors)[half]
        self.twice = np.where(np.abs(self.values.imag) > 1e-12, 2.0, 1.0)
        #: the polynomial through the stages at the beginning of the step
        self.at_start = np.linalg.solve(powers.T, np.eye(stages)[0])
        self.embedded = float(np.abs(values).min())
        self.through = np.linalg.inv(np.vander(np.append(0.0, self.nodes), increasing=True))


TABLEAU = _Tableau(STAGES)
ORDER = 2 * STAGES - 1
#: powers of the step length in the error of a step, and in its estimate
STEP_POWER, ESTIMATE_POWER = ORDER + 1, STAGES + 1


def extrapolate(change: Float, ratio: float) -> Float:
    """Continue the polynomial through the stages of a step to those of the next.

    Parameters
    ----------
    change : ndarray of shape (S, M)
        Of the previous step.
    ratio : float
        Length of the next step over that of the previous one.
    """
    powers = np.vander(1.0 + ratio * TABLEAU.nodes, STAGES + 1, increasing=True)
    weights = (powers @ TABLEAU.through)[:, 1:]
    return weights @ change - change[-1]


def radau_step(
    problem: Rates,
    t: float,
    n: Float,
    h: float,
    start: Float,
    guess: Float,
    norm: Callable[[Float, Float], float],
    tolerance: float,
    kept: Float | None = None,
) -> Step | None:
    """Solve for one step of the collocation method Radau IIA with four stages.

    The stages solve ``Z = h Q f(n + Z)``. The iteration ``Z <- Z + (1 - h Q x A)^{-1} r`` with the
    residual r takes for A the bands that `Rates.jacobian` gives, so that the linear systems are
    triangular and banded, one for each pair of conjugate eigenvalues of Q. Where the change
    of a weighted sum of the densities does not depend on them, A is completed by what makes this
    true of it, too: then every iterate has the sum to rounding, and the solution of the stages is
    what it was.

    Parameters
    ----------
    problem : Rates
    t, h : float
        Beginning and length of the step.
    n, start : ndarray of shape (M,)
        Densities and their rates at t.
    guess : ndarray of shape (S, M)
        Where the iteration begins.
    norm : callable
        ``norm(error, n)`` relative to the densities, of one error or the largest of several.
    tolerance : float
        For the error of the step; a twentieth of it is allowed to the iteration.
    kept : ndarray of shape (M,), optional
        Weights w for which ``w f(n)`` is the same for all n.

    Returns
    -------
    Step or None
        None if the iteration does not converge.

    References
    ----------
    E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, 2nd ed. (Springer, 1996),
    section IV.8, doi:10.1007/978-3-642-05221-7.
    """
    diagonal, band = problem.jacobian(t, n, h)
    systems = [_Triangular(diagonal, band, h, value) for value in TABLEAU.values]
    times = t + h * TABLEAU.nodes
    change, previous, first, contraction = guess.copy(), np.inf, 0.0, 0.0
    before: Float | None = None
    mixing = Mixing(norm.weights(n)) if isinstance(norm, Weighted) else None
    for iteration in range(1, _MAX_ITERATIONS + 1):
        rates, along = problem.rates(times, n + change)
        residual = h * (TABLEAU.matrix @ rates) - change
        correction = np.zeros_like(change)
        for s, system in enumerate(systems):
            part = system.solve(TABLEAU.inverse[s] @ residual)
            correction += TABLEAU.twice[s] * np.outer(TABLEAU.vectors[:, s], part).real
        if kept is not None:
            correction += np.outer(residual @ kept - correction @ kept, n / float(n @ kept))
        size = norm(correction, n)
        if not np.isfinite(size):
            return None
        ratio = size / previous if np.isfinite(previous) and previous > 0 else 0.0
        first = first or size
        change += correction if mixing is None else mixing(change, correction, ratio)
        # what is smaller than needed may be rounding, which does not contract
        enough = _ITERATION_SHARE * tolerance
        if size > enough and iteration > 1:
            contraction = (size / first) ** (1.0 / (iteration - 1))
            if iteration > _PATIENCE and contraction >= _SLOW:
                return None
        # without a ratio yet, a tenth is assumed
        ahead = min(ratio, _SLOW) / (1.0 - min(ratio, _SLOW)) if iteration > 1 else 10.0
        if ahead * size <= enough:
            break
        previous, before = size, along
    else:
        return None
    there, last = along, along
    if before is not None:
        # they are those before the last correction, which changes them as the one before it did
        last = along + min(ratio, 1.0) * (along - before)
    gamma = TABLEAU.embedded
    defect = gamma * h * (start - TABLEAU.at_start @ rates)
    error = _Triangular(diagonal, band, h, gamma).solve(defect).real
    weights = h * TABLEAU.matrix[-1]
    return Step(change, error, rates, weights @ last, weights @ there, iteration, contraction)


class Mixing:
    """Anderson's mixing of the iterates of ``Z <- Z + c(Z)``, for directions that hardly contract.

    The next iterate is that combination of the last ones for which the corrections, taken to be
    linear, come out least: as by GMRES, without further evaluations.

    Parameters
    ----------
    weights : ndarray of shape (M,)
        Of an entry in the norm.

    References
    ----------
    H. F. Walker and P. Ni, SIAM J. Numer. Anal. 49, 1715 (2011), doi:10.1137/10078356X.
    """

    def __init__(self, weights: Float) -> None:
        self._weights = weights
        self._iterates: list[Float] = []
        self._corrections: list[Float] = []

    def __call__(self, iterate: Float, correction: Float, ratio: float) -> Float:
        """Return what to add to an iterate, given its correction, the `ratio` of the last times."""
        self._iterates.append(iterate.copy())
        self._corrections.append(correction)
        if ratio < _MIXED:
            return correction
        del self._iterates[: -_DEPTH - 1], self._corrections[: -_DEPTH - 1]
        x, c = np.diff(self._iterates, axis=0), np.diff(self._corrections, axis=0)
        scaled = (c * self._weights).reshape(len(c), -1).T
        gamma = np.linalg.lstsq(scaled, (correction * self._weights).ravel(), rcond=1e-10)[0]
        return correction - np.tensordot(gamma, x + c, 1)


class _Triangular:
    """``1 - h value A`` for the banded lower-triangular A."""

    def __init__(self, diagonal: Float, band: Float, h: float, value: complex) -> None:
        self._real = abs(np.imag(value)) < 1e-12
        scale = h * (np.real(value) if self._real else value)
        dtype = float if self._real else complex
        matrix = np.empty((len(diagonal), band.shape[1] + 1), dtype)
        matrix[:, 0] = 1.0 + scale * diagonal
        np.multiply(band, -scale, out=matrix[:, 1:])
        self._matrix = matrix.T
        self._solve = lapack.dtbtrs if self._real else lapack.ztbtrs

    def solve(self, right: NDArray[np.complex128] | Float) -> NDArray[np.complex128] | Float:
        right = np.real(right) if self._real else right
        solution, _ = self._solve(self._matrix, right[:, None], uplo="L")
        return solution[:, 0]
