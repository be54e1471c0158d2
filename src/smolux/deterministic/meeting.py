"""How often particles of each size meet, and what pairs would weigh together."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .operator import Operator

Float = NDArray[np.float64]

#: the mass of what transforms give may be off by this share, as rounding
_ROUNDING = 1e-10


class Meeting:
    """Sums over pairs for S densities, found when first asked for.

    Parameters
    ----------
    operator : Operator
    sizes : ndarray of shape (M,)
    n : ndarray of shape (S, M)

    Attributes
    ----------
    beyond : ndarray of shape (S, M) or None
        Pairs that together have each size above the last one, if the operator found them with the
        gain.
    """

    def __init__(self, operator: Operator, sizes: Float, n: Float) -> None:
        self._operator, self._sizes, self._n = operator, sizes, n
        self.beyond: Float | None = None

    @cached_property
    def loss(self) -> Float:
        """``n_k sum_j K(k, j) n_j``, shape (S, M)."""
        return self._n * self._operator.loss(self._n)

    @cached_property
    def pairs(self) -> Float:
        """Pairs that meet, per unit volume and time, shape (S,)."""
        return 0.5 * self.loss.sum(axis=1)

    @cached_property
    def mass(self) -> Float:
        """Mass of the pairs that meet, shape (S,)."""
        return self.loss @ self._sizes

    @cached_property
    def gain(self) -> Float:
        """Pairs that together have each size, shape (S, M)."""
        return self._merged[0]

    @property
    def over(self) -> tuple[Float, Float]:
        """Number and mass of the pairs that together are larger than the last size."""
        return self._merged[1]

    @cached_property
    def _merged(self) -> tuple[Float, tuple[Float, Float]]:
        """Gain, and what is over, as the operator finds it, or as what the others leave.

        Transforms round: what they give has not exactly the mass of the pairs. As long as this is
        rounding, it is taken out by a factor, so that mass stays where it is; the number of pairs
        then still tells how large it is. More than that is left for the account to see.
        """
        gain, self.beyond = self._operator.gain_and_beyond(self._n)
        inside = gain @ self._sizes
        if self.beyond is None:
            number, mass = self.pairs - gain.sum(axis=1), self.mass - inside
            return gain, (np.maximum(number, 0.0), np.maximum(mass, 0.0))
        number = self.beyond.sum(axis=1)
        mass = self.beyond @ (self._sizes + self._sizes[-1])
        whole = inside + mass
        near = np.abs(whole - self.mass) < self.mass
        factor = np.divide(self.mass, whole, out=np.ones_like(whole), where=near)
        factor = np.where(np.abs(factor - 1.0) <= _ROUNDING, factor, 1.0)
        return factor[:, None] * gain, (factor * number, factor * mass)
