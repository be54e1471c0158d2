"""Hypergeometric numbers: how many of one kind are among those that are drawn without return.

References
----------
E. Stadlober, J. Comput. Appl. Math. 31, 181 (1990), doi:10.1016/0377-0427(90)90349-5 (HRUA: a
table mountain as majorant, by a ratio of uniform numbers).
"""

from __future__ import annotations

import math

import numpy as np

from smolux.jit.compile import cold_piece, piece

from . import rng

#: draws up to this many are made one by one
_FEW = 12
# Width of the table mountain: 2 sqrt(2 / e), and 3 - 2 sqrt(3 / e).
_D1, _D2 = 1.7155277699214135, 0.8989161620588988
#: below this the logarithm of a factorial is taken as it is, above by its difference
_SMALL = 64


@piece
def _step(a, d):
    """Return ``log((a + d)! / a!)`` without the cancellation of two large numbers."""
    if a < _SMALL or a + d < _SMALL:
        return math.lgamma(a + d + 1.0) - math.lgamma(a + 1.0)
    x = a + 1.0
    y = x + d
    # Stirling's series; what is left out is below 1e-9 of a unit for x above 64
    tail = (1.0 / y - 1.0 / x) / 12.0 - (1.0 / (y * y * y) - 1.0 / (x * x * x)) / 360.0
    return (x - 0.5) * math.log1p(d / x) + d * (math.log(y) - 1.0) + tail


@piece
def _one_by_one(words, total, of, drawn):
    found = np.int64(0)
    for k in range(drawn):
        if rng.below(words, total - k) < of - found:
            found += 1
    return found


@cold_piece
def _by_rejection(words, total, of, drawn):
    """Draw with `of` and `drawn` at most half of the total: others follow by symmetry."""
    others = total - of
    p = of / total
    mean = drawn * p
    variance = (total - drawn) * mean * (1.0 - p) / (total - 1.0)
    width = math.sqrt(variance + 0.5)
    scale = _D1 * width + _D2
    mode = math.floor((drawn + 1.0) * (of + 1.0) / (total + 2.0))
    end = min(float(min(drawn, of)) + 1.0, math.floor(mean + 0.5 + 16.0 * width))
    while True:
        u, v = 1.0 - rng.uniform(words), rng.uniform(words)
        x = mean + 0.5 + scale * (v - 0.5) / u
        if x < 0.0 or x >= end:
            continue
        k = math.floor(x)
        d = k - mode
        # log of the probability of the mode over that of k
        above = (
            _step(mode, d)
            + _step(of - mode, -d)
            + _step(drawn - mode, -d)
            + _step(others - drawn + mode, d)
        )
        if 2.0 * math.log(u) <= -above:
            return np.int64(k)


@piece
def hypergeometric(words, total, of, drawn):
    """Draw how many of `of` marked ones are among `drawn` of `total`, without return."""
    if of == 0 or drawn == 0:
        return np.int64(0)
    if drawn == total or of == total:
        return min(of, drawn)
    # the fewer are drawn: the rest is what stays
    turned = 2 * drawn > total
    fewer = total - drawn if turned else drawn
    if fewer <= _FEW:
        found = _one_by_one(words, total, of, fewer)
    elif min(of, total - of) <= _FEW:
        # the marked ones are drawn from the places
        marked = of if 2 * of <= total else total - of
        found = _one_by_one(words, total, fewer, marked)
        found = found if 2 * of <= total else fewer - found
    elif 2 * of <= total:
        found = _by_rejection(words, total, of, fewer)
    else:
        found = fewer - _by_rejection(words, total, total - of, fewer)
    return of - found if turned else found
