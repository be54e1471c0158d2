"""Majorants of low rank: what a law is never above, as a few products of powers of the sizes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Majorant:
    """``K(i, j) <= A(i, j) + A(j, i)``, ``A(i, j) = sum_k weight_k i**left_k j**right_k >= 0``.

    Parameters
    ----------
    terms : tuple of (weight, left, right)
        A weight may be negative, as long as ``A`` is not.
    least : float
        Greatest known number with ``least (A(i, j) + A(j, i)) <= K(i, j)``: 1 for a law that is
        its own majorant, 0 if none is known. At least this share of the candidates is accepted.

    References
    ----------
    A. I. Osinsky, Low-rank Monte Carlo for Smoluchowski-class equations, arXiv:2312.02788 (2023),
    section 3.
    """

    terms: tuple[tuple[float, float, float], ...]
    least: float = 0.0

    def __call__(self, i: ArrayLike, j: ArrayLike) -> Float:
        """Evaluate ``A(i, j) + A(j, i)`` on arrays of sizes."""
        i, j = np.asarray(i, float), np.asarray(j, float)
        return np.asarray(sum(w * (i**p * j**q + j**p * i**q) for w, p, q in self.terms), float)

    @property
    def exponents(self) -> tuple[float, ...]:
        """The different powers of the sizes that occur; each needs a sum over the particles."""
        return tuple(dict.fromkeys(e for _, *pair in self.terms for e in pair))
