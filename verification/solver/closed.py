"""Closed forms that hold for any start; no numerical integration but of plain functions of time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from .reference import Float, OfTime

#: of Gauss's rule between two breaks
_NODES = 40


def constant_number(density: float, t: float) -> float:
    """Return M0 for K = 1 from any start."""
    return 2.0 * density / (2.0 + density * t)


def constant_densities(start: Float, t: float) -> Float:
    """Return the densities for K = 1, of the sizes of `start`.

    The generating function over the number density obeys ``dphi/ds = (phi**2 - phi)`` in
    ``s = log(1 + M0 t / 2)``, so with ``q = exp(-s)`` it is ``q phi_0 / (1 - (1 - q) phi_0)``: a
    geometric number of the first particles make one.
    """
    density = float(start.sum())
    q = 1.0 / (1.0 + 0.5 * density * t)
    first = start / density
    found = q * first
    for k in range(1, len(start)):
        found[k] += (1.0 - q) * (first[:k] @ found[k - 1 :: -1])
    return constant_number(density, t) * found


def additive_number(density: float, mass: float, t: float) -> float:
    """Return M0 for K = i + j from any start."""
    return density * math.exp(-mass * t)


def second_moment(kernel: str, mass: float, second: float, t: float) -> float:
    """Return M2 for K = 1, i + j and i j from any start, before gelation."""
    if kernel == "constant":
        return second + mass**2 * t
    if kernel == "additive":
        return second * math.exp(2.0 * mass * t)
    return second / (1.0 - second * t)


def riccati(density: float, a: float, b: float, c: float, t: float) -> float:
    """Return the solution of ``dN/dt = a + b N - c N**2``, c above zero.

    For K = 1 from any start: c is 1/2; a source J adds J to a, removal at the rate r takes r from
    b; shattering at λ adds λ M1 to b and λ to c; scission at F adds F M1 / 2 to a and takes F / 2
    from b.
    """
    root = math.sqrt(b * b + 4.0 * a * c)
    if root == 0.0:
        return density / (1.0 + c * density * t)
    high, low = (b + root) / (2.0 * c), (b - root) / (2.0 * c)
    decay = math.exp(-root * t)
    above = (density - high) * decay
    return (high * (density - low) - low * above) / ((density - low) - above)


def diluted_number(density: float, rate: OfTime, t: float, breaks: Sequence[float] = ()) -> float:
    """Return M0 for K = 1 with removal of all sizes at ``rate(t)``."""
    inside = sorted({0.0, t, *(b for b in breaks if 0.0 < b < t)})
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    left, grown = 1.0, 0.0

    def integral(a: float, b: float) -> float:
        x = 0.5 * (b - a) * (nodes + 1.0) + a
        return 0.5 * (b - a) * float(weights @ [rate(float(s)) for s in x])

    for a, b in pairwise(inside):
        x = 0.5 * (b - a) * (nodes + 1.0) + a
        gone = np.array([integral(a, float(s)) for s in x])
        grown += left * 0.5 * (b - a) * float(weights @ np.exp(-gone))
        left *= math.exp(-integral(a, b))
    return density * left / (1.0 + 0.5 * density * grown)
