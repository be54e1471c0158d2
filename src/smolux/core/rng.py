"""Random numbers: xoshiro256++ on four words of the state, one stream for each replica.

References
----------
D. Blackman, S. Vigna, ACM Trans. Math. Softw. 47, 36 (2021), doi:10.1145/3460772.
G. Marsaglia, W. W. Tsang, J. Stat. Softw. 5(8) (2000), doi:10.18637/jss.v005.i08 (ziggurat).
"""

from __future__ import annotations

import math

import numpy as np

from smolux.jit.compile import cold_piece, piece

_R17, _R23, _R45 = np.uint64(17), np.uint64(23), np.uint64(45)
_R19, _R41 = np.uint64(19), np.uint64(41)
_S11 = np.uint64(11)
_TO_UNIT = 2.0**-53
_LAYER = np.uint64(255)
_ONE = np.uint64(1)


@piece
def step(s0, s1, s2, s3):
    """64 random bits, and the state after them."""
    x = s0 + s3
    word = ((x << _R23) | (x >> _R41)) + s0
    t = s1 << _R17
    s2 ^= s0
    s3 ^= s1
    s1 ^= s2
    s0 ^= s3
    s2 ^= t
    s3 = (s3 << _R45) | (s3 >> _R19)
    return word, s0, s1, s2, s3


@piece
def bits(s):
    """64 random bits."""
    word, s[0], s[1], s[2], s[3] = step(s[0], s[1], s[2], s[3])
    return word


@piece
def unit(word):
    """Uniform number in [0, 1) of 64 random bits, a multiple of 2**-53."""
    return np.int64(word >> _S11) * _TO_UNIT


@piece
def uniform_of(s0, s1, s2, s3):
    """As `uniform`, for words that the caller holds; and the words after it."""
    word, s0, s1, s2, s3 = step(s0, s1, s2, s3)
    return unit(word), s0, s1, s2, s3


@piece
def uniform(s):
    """Uniform number in [0, 1), a multiple of 2**-53."""
    return unit(bits(s))


@piece
def below(s, n):
    """Uniform whole number in ``0 .. n - 1``; the bias is below ``n * 2**-53``."""
    return np.int64(uniform(s) * n)


def _ziggurat(layers: int = 256) -> tuple[np.ndarray, np.ndarray]:
    """Abscissae and ordinates of layers of equal area under ``exp(-x)``."""
    r, v = 7.697117470131487, 0.0039496598225815571993  # for 256 layers, Marsaglia and Tsang
    x = np.empty(layers + 1)
    x[0], x[1] = v / math.exp(-r), r
    for k in range(2, layers):
        x[k] = -math.log(v / x[k - 1] + math.exp(-x[k - 1]))
    x[layers] = 0.0
    return x, np.exp(-x)


_X, _Y = _ziggurat()
_EDGE = float(_X[1])


@cold_piece
def _outside(s, k, x):
    """Exponential number of mean 1, given that `x` in layer `k` is not surely below the curve."""
    shift = 0.0
    while True:
        if k == 0:  # beyond the last layer the law repeats itself
            shift += _EDGE
        elif _Y[k] + uniform(s) * (_Y[k + 1] - _Y[k]) < math.exp(-x):
            return shift + x
        word = bits(s)
        k = np.int64(word & _LAYER)
        x = unit(word) * _X[k]
        if x < _X[k + 1]:
            return shift + x


@piece
def exponential_of(s, s0, s1, s2, s3):
    """As `exponential`, for a state of which the caller holds the words; and the words after it."""
    word, s0, s1, s2, s3 = step(s0, s1, s2, s3)
    k = word & _LAYER
    x = unit(word) * _X[k]
    if x >= _X[k + _ONE]:
        s[0], s[1], s[2], s[3] = s0, s1, s2, s3
        x = _outside(s, np.int64(k), x)
        s0, s1, s2, s3 = s[0], s[1], s[2], s[3]
    return x, s0, s1, s2, s3


@piece
def exponential(s):
    """Exponential number of mean 1."""
    x, s[0], s[1], s[2], s[3] = exponential_of(s, s[0], s[1], s[2], s[3])
    return x
