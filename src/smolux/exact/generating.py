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
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

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


def _finish(
    z: Complex, lam: float, w: Complex, p: Complex, x: float, left: float
) -> tuple[Complex, Complex]:
    """Carry ``w`` and ``theta w`` over what `_advance` left."""
    if left == 0:
        return w, p
    nu = 2 / (1 + 2 * lam)
    return _frobenius(z * (nu / 2), w, p, x, left, (1 + lam) * nu)


def generating_function(z: Complex, lam: float, t: float) -> Complex:
    """Evaluate ``G(t; z)`` for unit density and kernel.

    Parameters
    ----------
    z : ndarray of complex
        Points, off the real axis or above the radius of convergence of the steady state.
    lam : float
        Shattering rate.
    t : float
        Time, above 0 and finite.

    Returns
    -------
    ndarray of complex
        Of the shape of `z`.
    """
    w, p = _finish(z, lam, *_advance(z, lam, t))
    return 2 * lam * p / w


@lru_cache(maxsize=64)
def radius(lam: float, t: float) -> float:
    """Radius of convergence of the series in `z`: the pole of G nearest to the origin.

    It lies on the positive axis and falls with time to ``(1 + lam)**2 / (1 + 2 lam)``.

    Parameters
    ----------
    lam, t : float

    Returns
    -------
    float
        From below, to one part in 1e9.
    """
    steady = (1 + lam) ** 2 / (1 + 2 * lam)
    # The poles of G, zeros of w, lie at excesses of about 1 : 4 : 9 : ...; w is positive at first.
    excess = np.geomspace(1e-9, 4 * (1 + 2 / t) / steady, 400)
    while True:
        z = (steady * (1 + excess)).astype(complex)
        value = _finish(z, lam, *_advance(z, lam, t))[0].real
        beyond = np.flatnonzero(~(value > 0))
        first = int(beyond[0]) if beyond.size else excess.size - 1
        if first == 0:
            return steady
        low, high = excess[first - 1], excess[first]
        if high - low <= 1e-9 * (1 + low):
            return steady * (1 + float(low))
        excess = np.linspace(low, high, 33)


def coefficients(lam: float, t: float, largest: int) -> Float:
    """Densities ``n_0 = 0, n_1, ..., n_largest``, accurate relative to each for the upper half.

    Cauchy's integral over a circle just inside the pole, by the trapezoidal rule (a Fourier
    transform); its points avoid the real axis, where the exponents may differ by a whole number.

    Parameters
    ----------
    lam : float
        Shattering rate.
    t : float
        Time, above 0 and finite.
    largest : int
        Largest size.
    """
    circle = radius(lam, t) * math.exp(-_DEPTH / largest)
    points = _OVER * largest
    # w and theta w as power series in z: few terms, evaluated at all points by a transform
    w, p, x, left = _advance(circle * np.exp(2j * np.pi / _TERMS * np.arange(_TERMS)), lam, t)
    j = np.arange(_TERMS // 2)
    shift = np.exp(1j * np.pi / points * j)
    w, p = (
        np.fft.ifft(np.fft.fft(f)[: _TERMS // 2].real * shift, points)[: points // 2]
        for f in (w, p)
    )
    g = np.empty(points // 2, complex)
    for start in range(0, g.size, _CHUNK):
        part = slice(start, start + _CHUNK)
        angle = 2 * np.pi / points * (np.arange(start, min(start + _CHUNK, g.size)) + 0.5)
        top, bottom = _finish(circle * np.exp(1j * angle), lam, w[part], p[part], x, left)[::-1]
        g[part] = 2 * lam * top / bottom
    k = np.arange(largest + 1)
    # G at conjugate points is conjugate: the real part of the sum over the upper half
    sums = np.fft.fft(g, points)[: largest + 1]
    sums = 2 * (sums * np.exp(-1j * np.pi * k / points)).real / points
    return sums * np.exp(-k * math.log(circle))
