"""The bilinear kernel, until gelation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from smolux.errors import InputError

from .base import Float, Solution

#: the coefficients cost O(k**2): under a second for 20,000 sizes, a minute for the most
MOST = 200_000


@lru_cache(maxsize=8)
def _coefficients(A: float, B: float, radius: float, largest: int) -> Float:
    """Coefficients ``c_k radius**(k - 1)`` for ``k = 0 .. largest``, all of order one or less.

    ``(k - 1) c_k = 1/2 sum_i K(i, k - i) c_i c_{k-i}`` with ``c_1 = 1``: sums of positive terms.
    """
    d = np.zeros((2, largest + 1))  # d_k and k d_k at k
    back = np.zeros((2, largest + 1))  # the same at largest - k, for products of contiguous parts
    d[:, 1] = back[:, largest - 1] = 1.0
    for k in range(2, largest + 1):
        half = (k + 1) // 2  # i below k / 2, and again as k - i
        # einsum, unlike a dot product, starts no threads, which cost more than they bring here
        pairs = 2 * np.einsum(
            "si,si->s", d[:, 1:half], back[:, largest - k + 1 : largest - k + half]
        )
        if k % 2 == 0:
            pairs += d[:, k // 2] ** 2
        value = 0.5 * radius * ((1 + A * k) * pairs[0] + B * pairs[1]) / (k - 1)
        d[:, k] = back[:, largest - k] = value, k * value
    d.setflags(write=False)
    return d[0]


@dataclass(frozen=True)
class Bilinear(Solution):
    """Bilinear kernel ``K = scale (1 + A (i + j) + B i j)``, monomers at the start.

    ``n_k = c_k phi psi**(k - 1)`` with numbers ``c_k`` that do not depend on time. With
    ``D**2 = A**2 - B``, ``c = cosh(D t)``, ``s = sinh(D t) / D``, ``u = c + (1 + A) s`` and
    ``v = c - (A + B) s``: ``M2 = u / v``, and ``M0(t) = 1 / M2(t / 2)``. The gel time is the
    zero of ``v``. Known until then; NaN afterwards.

    Parameters
    ----------
    A, B : float
        Zero or more.

    References
    ----------
    J. L. Spouge, J. Phys. A 16, 767 (1983), doi:10.1088/0305-4470/16/4/014. Derivation in the
    manual, page "Exact solutions".
    """

    A: float = 0.0
    B: float = 0.0
    name: ClassVar[str] = "bilinear kernel"
    formula: ClassVar[str] = "K = scale (1 + A (i + j) + B i j)"
    reference: ClassVar[str] = "J. L. Spouge, J. Phys. A 16, 767 (1983)"

    def _problems(self) -> list[str]:
        return [
            f"{key} = {value!r}: must be a finite number, zero or more"
            for key, value in (("A", self.A), ("B", self.B))
            if not (np.isfinite(value) and value >= 0)
        ]

    @property
    def _discriminant(self) -> float:
        return self.A**2 - self.B

    def _gel_time(self) -> float:
        if self.B == 0:
            return math.inf
        total, square = self.A + self.B, self._discriminant
        if abs(square) < 1e-10 * total**2:  # the series of both branches
            return (1 + square / total**2 / 3) / total
        D = math.sqrt(abs(square))
        if square < 0:
            return math.atan(D / total) / D
        # artanh(D / total), as total**2 - D**2 = B (1 + 2 A + B)
        return math.log((total + D) / math.sqrt(self.B * (1 + 2 * self.A + self.B))) / D

    def _exponentials(self) -> tuple[float, float, float, float]:
        """Return a1, a2, b1, b2: ``u = a1 e + a2 / e``, ``v = b1 e + b2 / e``, ``e = exp(D t)``."""
        square = self._discriminant
        D = math.sqrt(square)
        a, b = (1 + self.A) / D, (self.A + self.B) / D
        falling = -self.B * (1 + 2 * self.A + self.B) / (square * (1 + b))  # 1 - b
        return 0.5 * (1 + a), 0.5 * (1 - a), 0.5 * falling, 0.5 * (1 + b)

    def _late(self, t: float) -> bool:
        """Whether hyperbolic functions would cancel or overflow."""
        return self._discriminant > 0 and math.sqrt(self._discriminant) * t > 1

    def _uv(self, t: float) -> tuple[float, float, float]:
        """Return ``u f``, ``v f`` and ``ln f`` for a convenient factor f."""
        if not self._late(t):
            c, s = _cosine(self._discriminant, t)
            return c + (1 + self.A) * s, c - (self.A + self.B) * s, 0.0
        a1, a2, b1, b2 = self._exponentials()
        exponent = math.sqrt(self._discriminant) * t
        q = math.exp(-2 * exponent)
        return a1 + a2 * q, b1 + b2 * q, -exponent

    def _third(self, t: float) -> float:
        """Return ``M3 v**3 f**3 = f**3 (1 + 3 int u v u' dt)`` with the factor of `_uv`."""
        square, a, b = self._discriminant, 1 + self.A, self.A + self.B
        if not self._late(t):
            c, s = _cosine(square, t)
            e = 2 * _cosine(square, t / 2)[1] ** 2  # (c - 1) / D**2
            return (
                1
                + a * (3 * s + square * s**3)
                + (square + a * (a - b)) * e * (c * c + c + 1)
                + ((a - b) * square - a * a * b) * s**3
                - a * b * square * e * e * (c + 2)
            )
        a1, a2, b1, b2 = self._exponentials()
        q = math.exp(-math.sqrt(square) * t)
        growing = b1 * (1 - q**3) + 3 * b2 * (q**2 - q**3)
        falling = 3 * b1 * (q**4 - q**3) + b2 * (q**6 - q**3)
        return q**3 + a1 * a1 * growing + a2 * a2 * falling

    def _moments(self, t: float) -> tuple[float, float, float, float]:
        if t > self._gel_time():
            return math.nan, math.nan, math.nan, math.nan
        if math.isinf(t):
            return 0.0, 1.0, math.inf, math.inf
        u0, v0, _ = self._uv(t / 2)
        u, v, _ = self._uv(t)
        if t == self._gel_time() or v**3 <= 0:
            return v0 / u0, 1.0, math.inf, math.inf
        return v0 / u0, 1.0, u / v, self._third(t) / v**3

    def _log_phi_psi(self, t: float) -> tuple[float, float]:
        square = self._discriminant
        if square > 0:  # the large terms of both logarithms cancel by hand
            D = math.sqrt(square)
            gap = 1 + self.B / (self.A + D)  # 1 + A - D
            s = -math.expm1(-D * t) / D
            log_u = math.log1p(0.5 * gap * s)  # less D t / 2
            log_phi = -D * t * gap - 2 * (1 + self.A) * log_u
            return log_phi, math.log(s) + D * t + log_u + log_phi
        log_u = math.log(self._uv(t / 2)[0])
        log_phi = -2 * (1 + self.A) * log_u + square * t
        return log_phi, math.log(2 * _cosine(square, t / 2)[1]) + log_u + log_phi

    def _log_radius(self) -> float:
        """Logarithm of the largest ``psi``: at the gel time, or as time goes on."""
        if self.B > 0:
            return self._log_phi_psi(self._gel_time())[1]
        if self.A == 0:
            return math.log(2.0)
        return -math.log(self.A) - (1 + 2 * self.A) * math.log1p(0.5 / self.A)

    def _densities(self, t: float, k: Float) -> Float:
        if t == 0:
            return (k == 1).astype(float)
        if t > self._gel_time():
            return np.full(k.shape, np.nan)
        if math.isinf(t):
            return np.zeros(k.shape)
        largest = int(k.max(initial=1))
        if largest > MOST:
            raise InputError(
                f"size {largest}: the exact solution of the bilinear kernel reaches {MOST} sizes"
            )
        log_radius = self._log_radius()
        table = _coefficients(self.A, self.B, math.exp(log_radius), 1 << (largest - 1).bit_length())
        log_phi, log_psi = self._log_phi_psi(t)
        return table[k.astype(int)] * np.exp(log_phi + (k - 1) * (log_psi - log_radius))


def _cosine(square: float, t: float) -> tuple[float, float]:
    """Return ``cosh(D t)`` and ``sinh(D t) / D`` for ``D**2 = square`` of any sign."""
    D = math.sqrt(abs(square))
    x = D * t
    if x < 1e-4:
        y = square * t * t
        return 1 + y / 2 * (1 + y / 12), t * (1 + y / 6 * (1 + y / 20))
    if square > 0:
        return math.cosh(x), math.sinh(x) / D
    return math.cos(x), math.sin(x) / D
