"""The generating function of the constant kernel with shattering, and its coefficients.

``G(t; z) = sum_k n_k(t) z**k`` obeys the Riccati equation
``G' = G**2 / 2 - (1 + lam) M0 G + lam M0 z``. With ``x = exp(-lam t) / (1 + 2 lam)``,
``theta = x d/dx``, ``nu = 2 / (1 + 2 lam)`` and ``a = 1 + lam``, the substitution
``G = 2 lam theta w / w`` makes it linear,

    ``(1 - x) theta**2 w - a nu theta w + (nu z / 2) w = 0``,

a hypergeometric equation with the exponents ``r = (a nu -+ sqrt(a**2 nu**2 - 2 nu z)) / 2`` at
``x = 0`` and a singular point at ``x = 1``. The variable runs from ``1 / (1 + 2 lam)`` down to 0,
so a small ``lam`` starts close to the singular point. The solution is carried by Taylor series
from point to point, and for small ``x`` by the two series of Frobenius.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from smolux.errors import InputError

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: below this value of x the series about x = 0 is used
_SMALL = 0.1
#: aliasing is exp(-_OVER * _DEPTH); rounding is magnified by exp(_DEPTH)
_OVER, _DEPTH = 8, 4.5
_CHUNK = 1 << 12
#: sample points of the entire functions on the circle, twice the terms of their series
_TERMS = 128


def _taylor(
    rho: Complex, w: Complex, p: Complex, x: float, gap: float, h: float, drift: float
) -> tuple[Complex, Complex]:
    """Carry ``w`` and ``p = theta w`` from `x` to ``x (1 + h)``; `gap` is ``1 - x``."""
    a, b, before = w, p, np.zeros_like(p)  # the terms, powers of h included
    sum_w, sum_p = w.copy(), p.copy()
    for n in range(400):
        next_b = (drift * b - rho * a + x * (n * b + (n - 1) * h * before)) / gap - n * b
        a, b, before = (b - n * a) * (h / (n + 1)), next_b * (h / (n + 1)), b
        sum_w += a
        sum_p += b
        if n % 6 == 5:  # the check costs as much as a term
            size = max(np.max(np.abs(a / sum_w)), np.max(np.abs(b / sum_p)))
            if size < 1e-18:
                return sum_w, sum_p
    raise InputError(
        "the generating function did not converge: shattering rate or time out of range"
    )


def _frobenius(
    rho: Complex, w: Complex, p: Complex, x: float, decay: float, drift: float
) -> tuple[Complex, Complex]:
    """Carry ``w`` and ``p`` from `x` to ``x exp(-decay)``, up to a common factor above 0."""
    root = np.sqrt(drift * drift - 4 * rho)
    values = []
    for exponent, other in (((drift - root) / 2, -root), ((drift + root) / 2, root)):
        ends = []
        for end in (x, x * math.exp(-decay)):
            term = np.ones_like(w)
            sum_w, sum_p = term.copy(), exponent * term
            for n in range(1, 80):
                term = term * ((n - 1 + exponent) ** 2 * (end / n) / (n + other))
                sum_w += term
                sum_p += (n + exponent) * term
                if np.max(np.abs(term) * n / np.abs(sum_w)) < 1e-18:
                    break
            ends.append((sum_w, sum_p))
        values.append(ends)
    (slow, slow_end), (fast, fast_end) = values
    wronskian = slow[0] * fast[1] - slow[1] * fast[0]
    share_slow = (w * fast[1] - p * fast[0]) / wronskian
    share_fast = (p * slow[0] - w * slow[1]) / wronskian * np.exp(-decay * root)
    phase = np.exp(0.5j * decay * root.imag)
    return (
        phase * (share_slow * slow_end[0] + share_fast * fast_end[0]),
        phase * (share_slow * slow_end[1] + share_fast * fast_end[1]),
    )


def _advance(z: Complex, lam: float, t: float) -> tuple[Complex, Complex, float, float]:
    """Carry ``w`` and ``theta w`` by Taylor series, to the time `t` or to where x is small.

    Returns
    -------
    w, p : ndarray of complex
        Up to a common factor above 0: entire functions of `z`.
    x, left : float
        Where the series stopped, and ``lam`` times the time that is left.
    """
    nu = 2 / (1 + 2 * lam)
    rho = z * (nu / 2)
    x, gap, left = 1 / (1 + 2 * lam), 2 * lam / (1 + 2 * lam), lam * t
    w, p = np.ones_like(z), z / (2 * lam)
    frequency = math.sqrt(float(np.max(np.abs(rho))))
    while left > 0 and not (x <= _SMALL and frequency < 5):
        h = -min(0.45 * min(1.0, gap / x), 0.75, 2 * math.sqrt(gap) / frequency)
        if math.log1p(h) < -left:
            h = math.expm1(-left)
            left = 0.0
        else:
            left += math.log1p(h)
        w, p = _taylor(rho, w, p, x, gap, h, (1 + lam) * nu)
        scale = np.max(np.abs(w)) + np.max(np.abs(p))
        w, p = w / scale, p / scale
        x, gap = x * (1 + h), gap - x * h
    return w, p, x, left


@dataclass(frozen=True)
class GeneratingFunction:
    """The generating function at one time; see `generating_function`.

    Both ``w`` and ``theta w`` are entire in `z`: their Taylor coefficients about a point near the
    first pole of G follow from few values on a circle, and serve everywhere inside it.

    Attributes
    ----------
    lam : float
        Shattering rate.
    centre, span : float
        Centre and radius of the circle.
    w, p : ndarray
        Taylor coefficients in ``(z - centre) / span``.
    x, left : float
        Where the Taylor series in x stopped, and ``lam`` times the time that is left.
    """

    lam: float
    centre: float
    span: float
    w: Float
    p: Float
    x: float
    left: float

    def solve(self, z: Complex) -> tuple[Complex, Complex]:
        """Return ``w`` and ``theta w``, up to a common factor above 0.

        Parameters
        ----------
        z : ndarray of complex
            Inside the circle; if real, at least the radius of convergence of the steady state.
        """
        u = (z - self.centre) / self.span
        w = np.asarray(np.polynomial.polynomial.polyval(u, self.w), complex)
        p = np.asarray(np.polynomial.polynomial.polyval(u, self.p), complex)
        if self.left == 0:
            return w, p
        nu = 2 / (1 + 2 * self.lam)
        drift = (1 + self.lam) * nu
        return _frobenius(z * (nu / 2), w, p, self.x, self.left, drift)

    def __call__(self, z: Complex) -> Complex:
        """Evaluate ``G``; see `solve`."""
        w, p = self.solve(z)
        return 2 * self.lam * p / w

    @cached_property
    def radius(self) -> float:
        """Radius of convergence in `z`, to one part in 1e9: the pole nearest to the origin.

        It lies on the positive axis and falls with time to ``(1 + lam)**2 / (1 + 2 lam)``.
        """
        steady = (1 + self.lam) ** 2 / (1 + 2 * self.lam)
        # The zeros of w lie at excesses of about 1 : 4 : 9 : ..., and w is positive before.
        excess = np.geomspace(1e-9, 1.5 * self.centre / steady - 1, 400)
        while True:
            value = self.solve((steady * (1 + excess)).astype(complex))[0].real
            beyond = np.flatnonzero(~(value > 0))
            first = int(beyond[0]) if beyond.size else excess.size - 1
            if first == 0:
                return steady
            low, high = float(excess[first - 1]), float(excess[first])
            if high - low <= 1e-9 * (1 + low):
                return steady * (1 + low)
            excess = np.linspace(low, high, 100)

    def coefficients(self, largest: int) -> Float:
        """Densities ``n_0 = 0, n_1, ..., n_largest``; the upper half accurate relative to each.

        Cauchy's integral over a circle just inside the pole, by the trapezoidal rule (a Fourier
        transform). Its points avoid the real axis, where the exponents may differ by a whole
        number.

        Parameters
        ----------
        largest : int
        """
        circle = self.radius * math.exp(-_DEPTH / largest)
        points = _OVER * largest
        g = np.empty(points // 2, complex)
        for start in range(0, g.size, _CHUNK):
            index = np.arange(start, min(start + _CHUNK, g.size))
            g[index] = self(circle * np.exp(2j * np.pi / points * (index + 0.5)))
        k = np.arange(largest + 1)
        # G at conjugate points is conjugate: the real part of the sum over the upper half
        sums = np.fft.fft(g, points)[: largest + 1]
        sums = 2 * (sums * np.exp(-1j * np.pi * k / points)).real / points
        return sums * np.exp(-k * math.log(circle))


@lru_cache(maxsize=1024)
def generating_function(lam: float, t: float) -> GeneratingFunction:
    """Prepare ``G(t; z)`` for unit density and kernel.

    Parameters
    ----------
    lam : float
        Shattering rate.
    t : float
        Time, above 0 and finite.
    """
    # The pole lies within 1 % above this, or below.
    centre = (1 + lam) ** 2 / (1 + 2 * lam) + 2 / t
    span = 2.1 * centre
    angle = 2 * np.pi / _TERMS * np.arange(_TERMS)
    w, p, x, left = _advance(centre + span * np.exp(1j * angle), lam, t)
    w, p = (np.fft.fft(f)[: _TERMS // 2] / _TERMS for f in (w, p))
    return GeneratingFunction(lam, centre, span, w.real, p.real, x, left)
