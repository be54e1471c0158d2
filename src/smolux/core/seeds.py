"""Seeds of many streams at once, those that ``numpy.random.SeedSequence`` makes one by one.

The children of a sequence differ in the last words of what is mixed, so their pools of four words
are computed as columns of arrays. The law is that of M. E. O'Neill, "Developing a seed_seq
Alternative" (2015), https://www.pcg-random.org/posts/developing-a-seed_seq-alternative.html.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.uint32]

_POOL = 4
_MASK = 0xFFFFFFFF
_INIT_A, _MULT_A = 0x43B0D7E5, 0x931E8875
_INIT_B, _MULT_B = 0x8B51F9DD, 0x58F38DED
_LEFT, _RIGHT = np.uint32(0xCA01F9DD), np.uint32(0x4973F715)
_SHIFT = np.uint32(16)


def _constants(start: int, factor: int) -> Iterator[tuple[np.uint32, np.uint32]]:
    while True:
        following = start * factor & _MASK
        yield np.uint32(start), np.uint32(following)
        start = following


def _hashed(value: Words, constants: Iterator[tuple[np.uint32, np.uint32]]) -> Words:
    before, after = next(constants)
    value = (value ^ before) * after
    return value ^ (value >> _SHIFT)


def _mixed(x: Words, y: Words) -> Words:
    result = x * _LEFT - y * _RIGHT
    return result ^ (result >> _SHIFT)


def _digits(number: int) -> list[int]:
    """Words of 32 bits, the least significant first."""
    words = [number & _MASK]
    while number := number >> 32:
        words.append(number & _MASK)
    return words


def spawned(entropy: int, children: NDArray[np.int64]) -> NDArray[np.uint64]:
    """Return four words of 64 bits for each child: an array of shape (children, 4).

    They are those of ``SeedSequence(entropy, spawn_key=(child,)).generate_state(4, np.uint64)``.
    """
    if len(children) and int(children.max()) > _MASK:
        raise ValueError("more than 2**32 streams")
    words = _digits(entropy)
    words += [0] * (_POOL - len(words))
    given = [np.full(1, word, np.uint32) for word in words] + [children.astype(np.uint32)]
    constants = _constants(_INIT_A, _MULT_A)
    pool = [_hashed(word, constants) for word in given[:_POOL]]
    for source in range(_POOL):
        for target in range(_POOL):
            if source != target:
                pool[target] = _mixed(pool[target], _hashed(pool[source], constants))
    for word in given[_POOL:]:
        for target in range(_POOL):
            pool[target] = _mixed(pool[target], _hashed(word, constants))
    constants = _constants(_INIT_B, _MULT_B)
    state = np.stack([_hashed(pool[k % _POOL], constants) for k in range(2 * _POOL)], axis=-1)
    return np.ascontiguousarray(state).astype("<u4").view("<u8").astype(np.uint64)


def streams(entropy: int, first: int, count: int) -> np.ndarray:
    """Seed the streams of the replicas from `first` on: a uint64 array of shape (count, 4).

    The words are those of ``numpy.random.SeedSequence(entropy).spawn(...)[replica]``.
    """
    return spawned(entropy, np.arange(first, first + count))


def stream(entropy: int, *key: int) -> np.ndarray:
    """Seed a stream that is told from others by its key."""
    return np.random.SeedSequence(entropy, spawn_key=key).generate_state(4, np.uint64)
