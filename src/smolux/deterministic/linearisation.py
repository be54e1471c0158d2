"""The rate equations near given densities: products with the Jacobian, and shifted systems."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack
from scipy.sparse import linalg as krylov

from smolux.processes import Evaporation

from .equations import Equations
from .terms import Totals

Float = NDArray[np.float64]

#: bands of the preconditioner, and numbers in them, at most
_BANDS, _NUMBERS = 128, 1 << 24
#: how far it is kept from being singular, relative to the rate of collisions
_APART = 0.1


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
        equations.encounters.prepare(n)
        rates, along = equations.rates(np.zeros(1), n[None, :])
        # products are with vectors that do not fall off as the densities do
        equations.encounters.prepare(None)
        self.rates = self._closed(rates[0])
        #: densities times these are of about the same size
        self.weight = self.sizes**2
        frequency = equations.loss(0.0, n)
        #: collisions per time, of a particle and of the mass
        self.scale = 2.0 * float(Totals.of(along[0]).events.sum()) / float(n.sum())
        self.turnover = float((n * frequency) @ self.sizes)
        count = min(_BANDS, max(_NUMBERS // len(n), 16), len(n))
        self._frequency = frequency
        self._above = _evaporation(equations)
        self._band = equations.gain_by(0.0, n, count)

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

    def _preconditioner(
        self, shift: complex, dtype: type
    ) -> Callable[[NDArray[Any]], NDArray[Any]]:
        """Return what solves a shifted system of the bands of J."""
        count, bands = self._band.shape
        above = int(self._above is not None)
        matrix = np.empty((above + bands + 1, count), dtype)
        if self._above is not None:
            matrix[0, 0], matrix[0, 1:] = 0.0, -self._above
        matrix[above] = shift + self._frequency
        matrix[above + 1 :] = -self._band.T
        if self._above is None:
            banded = lapack.ztbtrs if dtype is complex else lapack.dtbtrs
            return lambda v: banded(matrix, v.astype(dtype)[:, None], uplo="L")[0][:, 0]
        room: NDArray[Any] = np.zeros((bands, count), dtype)
        factor, use = (
            (lapack.zgbtrf, lapack.zgbtrs) if dtype is complex else (lapack.dgbtrf, lapack.dgbtrs)
        )
        lu, pivots, _ = factor(np.concatenate([room, matrix]), bands, above)
        return lambda v: use(lu, bands, above, v.astype(dtype)[:, None], pivots)[0][:, 0]

    def solve(
        self, shift: complex, right: NDArray[Any], tolerance: float, *, mass: bool = False
    ) -> NDArray[Any]:
        """Return ``(shift - J)^{-1} right``, by GMRES with the bands of J near the diagonal.

        The part of J that the bands leave out is nearly of low rank: few iterations are needed. J
        has the eigenvalue zero, of states with another mass. If `right` holds no `mass`, nor does
        the solution: then it is that of a system in which this eigenvalue is moved away.
        """
        dtype: type = complex if np.iscomplexobj(right) or isinstance(shift, complex) else float
        # the bands alone may be nearly singular, too
        precondition = self._preconditioner(shift + (_APART * self.scale if mass else 0.0), dtype)

        def act(z: NDArray[Any]) -> NDArray[Any]:
            v = z / self.weight
            image = shift * v - self.product(v)
            if mass:
                image += self.scale * float(v @ self.sizes) / float(self.n @ self.sizes) * self.n
            return self.weight * precondition(image)

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


def _evaporation(equations: Equations) -> Float | None:
    """Return the rates at which sizes ``2 .. M`` become the next smaller, if they do."""
    evaporating = [p for p in equations.processes if isinstance(p, Evaporation)]
    if not evaporating:
        return None
    return np.asarray(sum(p.factor(0.0) * p.rates(equations.sizes)[1:] for p in evaporating))
