"""Splitting the particles of one size-class store among several, at random, in compiled code."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from smolux.core.rng import below
from smolux.jit.compile import entry

from .lists import append, is_list, place_of, size_at
from .state import BITS, SINGLE, WIDEST, view


class Part(NamedTuple):
    """What one store gives to another.

    Attributes
    ----------
    number : int64 array of shape (G,)
        Particles of each class.
    sizes : int64 array
        Of the particles of all lists, class by class.
    bits, widest : int
        Of the store, see `smolux.methods.size_class.state`.
    """

    number: NDArray[np.int64]
    sizes: NDArray[np.int64]
    bits: int
    widest: int


@lru_cache(maxsize=1)
def _compiled() -> tuple[Any, Any]:
    """Compile, or load, when first needed."""

    def split(work, words, s, copies, number, next_free, sizes):
        # the same random numbers twice: first to count, then to write without a gap
        w, parts = view(work, 0), number.shape[0]
        for k in range(4):
            s[k] = words[k]
        for g in range(w.number.shape[0]):
            if is_list(w, g):
                for _ in range(copies * w.number[g]):
                    number[below(s, parts), g] += 1
        total = np.int64(0)
        for k in range(parts):
            for g in range(w.number.shape[0]):
                if is_list(w, g):
                    next_free[k, g] = total
                    total += number[k, g]
        for k in range(4):
            s[k] = words[k]
        for g in range(w.number.shape[0]):
            if is_list(w, g):
                for m in range(copies * w.number[g]):
                    k = below(s, parts)
                    sizes[next_free[k, g]] = size_at(w, g, place_of(w, g, m // copies))
                    next_free[k, g] += 1

    def collect(work, number, sizes):
        w, n = view(work, 0), np.int64(0)
        for g in range(number.shape[0]):
            if not is_list(w, g):
                w.number[g] += number[g]
            else:
                for _ in range(number[g]):
                    append(w, g, np.int64(sizes[n]))
                    n += 1

    return entry(split), entry(collect)


def split(work: Any, parts: int, copies: int, words: NDArray[np.uint64]) -> list[Part]:
    """Put every particle `copies` times into one of several parts, each as likely as the other."""
    bits = int(work.meta[0, BITS])
    listed = np.arange(work.number.shape[1]) >= work.meta[0, SINGLE]
    number = np.zeros((parts, len(listed)), np.int64)
    rng = np.random.default_rng(words)
    counts = copies * work.number[0, ~listed]
    number[:, ~listed] = rng.multinomial(counts, np.full(parts, 1 / parts)).T
    sizes = np.empty(copies * int(work.number[0, listed].sum()), work.pool.dtype)
    _compiled()[0](work, words, words.copy(), copies, number, np.zeros_like(number), sizes)
    ends = np.cumsum(number[:, listed].sum(axis=1))[:-1]
    return [
        Part(mine, part, bits, int(work.meta[0, WIDEST]))
        for mine, part in zip(number, np.split(sizes, ends), strict=True)
    ]


def collect(work: Any, parts: list[Part]) -> None:
    """Put parts into an empty store with room for them."""
    for part in parts:
        _compiled()[1](work, part.number, part.sizes)
