"""The rate equations near given densities: products with the Jacobian, and shifted systems."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack
from scipy.sparse import linalg as krylov

from .equations import Equations
from .terms import Totals

Float = NDArray[np.float64]

#: bands of the preconditioner, and numbers in them, at most
_BANDS, _NUMBERS = 128, 1 << 24


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
        count = min(_BANDS, max(_NUMBERS // len(n), 16), len(n))
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
