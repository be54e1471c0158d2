"""Random numbers: the published generator, and the laws of what is drawn from it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from smolux.core import rng, seeds
from smolux.jit.compile import entry

MASK = (1 << 64) - 1
#: first outputs of xoshiro256++ from the state 1, 2, 3, 4, as published with other implementations
PUBLISHED = [
    41943041, 58720359, 3588806011781223, 3591011842654386, 9228616714210784205,
    9973669472204895162, 14011001112246962877, 12406186145184390807, 15849039046786891736,
    10450023813501588000,
]  # fmt: skip


class Reference:
    """xoshiro256++ 1.0 by D. Blackman and S. Vigna, in whole numbers without an end."""

    def __init__(self, words: list[int]) -> None:
        self.s = list(words)

    def next(self) -> int:
        s = self.s
        result = (self.rotated(s[0] + s[3] & MASK, 23) + s[0]) & MASK
        shifted = s[1] << 17 & MASK
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= shifted
        s[3] = self.rotated(s[3], 45)
        return result

    @staticmethod
    def rotated(x: int, by: int) -> int:
        return (x << by | x >> (64 - by)) & MASK


def _draw(s, bits, uniform, below, n, exponential):
    """Fill each array in turn."""
    for k in range(bits.shape[0]):
        bits[k] = rng.bits(s)
    for k in range(uniform.shape[0]):
        uniform[k] = rng.uniform(s)
    for k in range(below.shape[0]):
        below[k] = rng.below(s, n)
    for k in range(exponential.shape[0]):
        exponential[k] = rng.exponential(s)


compiled = entry(_draw)


def draw(words, bits=0, uniform=0, below=0, n=1, exponential=0):
    """Return the numbers drawn, and the words that are left."""
    s = np.array(words, np.uint64)
    out = (np.empty(bits, np.uint64), np.empty(uniform), np.empty(below, np.int64))
    last = np.empty(exponential)
    compiled(s, *out, n, last)
    return *out, last, s


def seeded(seed: int) -> np.ndarray:
    return seeds.streams(seed, 0, 1)[0]


def test_the_reference_is_the_published_generator():
    reference = Reference([1, 2, 3, 4])
    assert [reference.next() for _ in PUBLISHED] == PUBLISHED


@pytest.mark.parametrize("seed", [None, 0, 1, 2**200])
def test_bits(seed):
    words = [1, 2, 3, 4] if seed is None else seeded(seed).tolist()
    reference = Reference(words)
    bits, *_, left = draw(words, bits=5000)
    assert bits.tolist() == [reference.next() for _ in range(5000)]
    assert left.tolist() == reference.s


def test_uniform_numbers_are_the_upper_53_bits():
    words = seeded(3)
    reference = Reference(words.tolist())
    _, uniform, *_ = draw(words, uniform=5000)
    assert uniform.tolist() == [(reference.next() >> 11) * 2.0**-53 for _ in range(5000)]
    assert stats.kstest(draw(seeded(4), uniform=1_000_000)[1], "uniform").pvalue > 1e-4


def test_ends_of_the_interval():
    least, most = [0, 1, 2, 0], [0, 1, 2, MASK]  # give 64 zeros, and 64 ones
    assert draw(least, bits=1)[0].tolist() == [0]
    assert draw(most, bits=1)[0].tolist() == [MASK]
    assert draw(least, uniform=1)[1].tolist() == [0.0]
    assert draw(most, uniform=1)[1].tolist() == [1 - 2.0**-53]
    for n in (1, 2, 3, 1000, 10**9, 2**53):
        assert draw(least, below=1, n=n)[2].tolist() == [0]
        assert draw(most, below=1, n=n)[2].tolist() == [n - 1]
    assert draw(least, exponential=1)[3].tolist() == [0.0]
    assert np.isfinite(draw(most, exponential=1)[3]).all()


@pytest.mark.parametrize("n", [1, 2, 7, 1000])
def test_below(n):
    found = draw(seeded(5), below=200_000, n=n)[2]
    counts = np.bincount(found, minlength=n)
    assert len(counts) == n
    assert n == 1 or stats.chisquare(counts).pvalue > 1e-4


def test_layers_of_the_ziggurat_have_equal_areas():
    x, y = rng._X, rng._Y
    assert len(x) == 257
    assert (np.diff(x) < 0).all()
    areas = x[1:-1] * np.diff(y)[1:]
    bottom = x[1] * y[1] + np.exp(-x[1])  # with the tail, as wide as x[0]
    np.testing.assert_allclose(areas, bottom, rtol=1e-8)
    assert x[0] * y[1] == pytest.approx(bottom, rel=1e-12)


def test_exponential_numbers():
    numbers = draw(seeded(6), exponential=4_000_000)[3]
    assert (numbers >= 0).all()
    assert stats.kstest(numbers[:1_000_000], "expon").pvalue > 1e-4
    # moments of all of them: the variance of x**k is (2k)! - k!**2
    for k, moment, variance in ((1, 1, 1), (2, 2, 20), (3, 6, 684)):
        error = np.sqrt(variance / len(numbers))
        assert abs(np.mean(numbers**k) - moment) < 4.5 * error, k
    # each layer of the ziggurat by itself, and beyond the last one
    edges = np.append(rng._X[:0:-1], np.inf)
    counts = np.histogram(numbers, edges)[0]
    expected = -np.diff(np.exp(-edges)) * len(numbers)
    assert stats.chisquare(counts, expected).pvalue > 1e-4


def test_tail_of_the_exponential_law():
    numbers = draw(seeded(7), exponential=8_000_000)[3]
    beyond = numbers[numbers > rng._EDGE] - rng._EDGE
    expected = len(numbers) * np.exp(-rng._EDGE)
    assert abs(len(beyond) - expected) < 4.5 * np.sqrt(expected)
    assert stats.kstest(beyond, "expon").pvalue > 1e-4
    assert beyond.max() > 5  # nothing is cut off


def test_a_draw_depends_on_the_words_alone():
    words = seeded(8)
    _, _, _, first, left = draw(words, exponential=100)
    _, _, _, half, between = draw(words, exponential=40)
    _, _, _, rest, end = draw(between, exponential=60)
    assert np.append(half, rest).tolist() == first.tolist()
    assert end.tolist() == left.tolist()


def test_streams_are_those_of_seed_sequence():
    spawned = np.random.SeedSequence(42).spawn(6)
    expected = np.array([s.generate_state(4, np.uint64) for s in spawned])
    np.testing.assert_array_equal(seeds.streams(42, 0, 6), expected)
    np.testing.assert_array_equal(seeds.streams(42, 4, 2), expected[4:])


def test_streams_are_distinct():
    words = np.concatenate([seeds.streams(seed, 0, 500) for seed in (0, 1, 2**128)])
    assert len(np.unique(words, axis=0)) == len(words)
    assert words.any(axis=1).all()  # all zeros would stay zeros
    firsts = [draw(w, uniform=2)[1] for w in words[:500]]
    assert stats.kstest(np.ravel(firsts), "uniform").pvalue > 1e-4
    assert abs(np.corrcoef(np.array(firsts).T)[0, 1]) < 4.5 / np.sqrt(500)
