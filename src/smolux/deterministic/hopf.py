"""Where a steady state loses its stability to oscillations: the shattering rate at the onset."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from smolux.errors import InputError, SolverError
from smolux.initial import monodisperse
from smolux.kernels.base import Kernel
from smolux.model import Model
from smolux.processes import Aggregation, Shattering

from .steady import SteadyState, eigenvalues, linearisation, steady_state

Complex = NDArray[np.complex128]

_ITERATIONS = 30
_START = 0.03, 0.02
#: farthest step of the search, in the logarithm of the rate
_STRIDE = 0.7
#: below this ratio of real part to size a pair is followed by itself
_NEAR = 0.05


@dataclass(frozen=True)
class HopfThreshold:
    """A Hopf bifurcation of aggregation with shattering.

    Attributes
    ----------
    rate : float
        The shattering rate λ at the onset; below it the system oscillates.
    period : float
        Of the oscillation at the onset, for unit mass; for another mass divide by it.
    eigenvalue : complex
        Of the Jacobian there; its real part is what is left of the search.
    state : SteadyState
    """

    rate: float
    period: float
    eigenvalue: complex
    state: SteadyState


def hopf_threshold(
    kernel: Kernel, *, low: float = 1e-3, high: float = 0.5, tolerance: float = 1e-7
) -> HopfThreshold:
    """Find the shattering rate at which steady oscillations set in.

    The steady state of aggregation with shattering is followed in the rate λ by the secant method
    until the leading pair of eigenvalues of its Jacobian lies on the imaginary axis.

    Parameters
    ----------
    kernel : Kernel
    low, high : float
        Bounds of the search in λ.
    tolerance : float
        Relative, for λ.

    Returns
    -------
    HopfThreshold

    Raises
    ------
    InputError
        If the bounds are wrong.
    SolverError
        If the steady state is stable, or unstable, within all the bounds.

    References
    ----------
    S. A. Matveev et al., Phys. Rev. Lett. 119, 260601 (2017), doi:10.1103/PhysRevLett.119.260601
    (the oscillations, for ``(i/j)**a + (j/i)**a``).
    """
    if not 0 < low < high:
        raise InputError(f"low = {low!r}, high = {high!r}: must be positive and ascending")
    rates = list(_START)
    if not low <= min(rates) < max(rates) <= high:
        rates = [low ** (1 / 3) * high ** (2 / 3), low ** (2 / 3) * high ** (1 / 3)]
    branch = _Branch(kernel)
    growth = [branch(rate).real for rate in rates]
    for _ in range(_ITERATIONS):
        new = _next(rates, growth, low, high)
        if new == rates[-1]:
            side = "stable" if growth[-1] < 0 else "unstable"
            raise SolverError(
                f"no onset of oscillations: the steady state is {side} at the shattering rate "
                f"{new:g}; searched from {low:g} to {high:g}",
                np.inf,
            )
        rates.append(new)
        if abs(new / rates[-2] - 1.0) <= tolerance:
            break
        growth.append(branch(new).real)
    else:
        raise SolverError(f"the onset of oscillations was not found; last tried {new:g}", np.inf)
    leading = _leading(branch.state)
    if leading.real > branch.value.real + 1e-6 * abs(branch.value):
        raise SolverError(
            f"at the shattering rate {rates[-1]:g} another pair of eigenvalues, {leading:.4g}, is "
            "unstable already: give other bounds",
            np.inf,
        )
    period = 2.0 * np.pi / abs(branch.value.imag)
    return HopfThreshold(rates[-1], float(period), complex(branch.value), branch.state)


def _next(rates: list[float], growth: list[float], low: float, high: float) -> float:
    """Return the next rate: by the secant in ``log λ``, or a stride if that says nothing."""
    x = np.log(rates[-2:])
    slope = (growth[-1] - growth[-2]) / (x[1] - x[0])
    step = -growth[-1] / slope if slope < 0 else np.copysign(_STRIDE, growth[-1])
    return float(np.clip(np.exp(x[1] + np.clip(step, -_STRIDE, _STRIDE)), low, high))


def _leading(state: SteadyState) -> complex:
    """Return the pair with the largest real part, the one above the real axis."""
    values = eigenvalues(state, 6)
    pairs = values[values.imag > 1e-9 * np.abs(values)]
    if not pairs.size:
        raise SolverError("no pair of eigenvalues found: the steady state does not oscillate", 0.0)
    return complex(pairs[0])


class _Branch:
    """A pair of eigenvalues of the steady state, followed in the shattering rate."""

    def __init__(self, kernel: Kernel) -> None:
        self.kernel = kernel
        self.state: SteadyState
        self.value = 0j
        self._vector: Complex | None = None

    def __call__(self, rate: float) -> complex:
        """Return the eigenvalue at a shattering rate."""
        model = Model(self.kernel, (Aggregation(), Shattering(rate)), monodisperse())
        guess = None if self._vector is None else self.state.n
        self.state = steady_state(model, guess=guess)
        if self._vector is None or abs(self.value.real) > _NEAR * abs(self.value):
            # far from the onset another pair may come to lead
            self.value = _leading(self.state)
            self._vector = self.state.n * np.exp(1j * self.state.sizes)
        else:
            self._follow()
        return self.value

    def _follow(self) -> None:
        """Inverse iteration from the last eigenvalue and its vector."""
        near = linearisation(self.state)
        weight = near.weight
        vector = np.zeros(len(weight), complex)
        count = min(len(weight), len(self._vector))  # type: ignore[arg-type]
        vector[:count] = self._vector[:count]  # type: ignore[index]
        vector /= np.linalg.norm(weight * vector)
        shift = self.value * (1.0 + 1e-4)
        value = self.value
        for _ in range(12):
            image = -near.solve(shift, vector, 1e-9)
            quotient = complex(np.vdot(weight * vector, weight * image))
            vector = image / np.linalg.norm(weight * image)
            new = shift + 1.0 / quotient
            if abs(new - value) <= 1e-11 * abs(new):
                break
            value = new
        self.value, self._vector = new, vector
