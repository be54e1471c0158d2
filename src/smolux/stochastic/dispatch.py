"""Functions of several processes or terms, bound into one that takes the number of one of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

from smolux.core import rng
from smolux.core.state import BOTH
from smolux.jit.compile import piece, user_piece


@lru_cache(maxsize=64)
def as_float(rate: Callable[..., Any]) -> Any:
    """Bind a rate, whatever kind of number it returns."""
    inner = user_piece(rate)

    @piece
    def value(i, j, *p):
        return float(inner(i, j, *p))

    return value


@lru_cache(maxsize=64)
def choice(rates: tuple[Callable[..., Any], ...], compiled: Callable[..., Any]) -> Any:
    """Bind functions into one of their number, of `x` and a tuple of the q of each.

    Each is ``compiled(rate)(x, *q)``.
    """
    first = compiled(rates[0])
    if len(rates) == 1:

        @piece
        def last(r, x, q):
            return float(first(x, *q[0]))

        return last
    others = choice(rates[1:], compiled)

    @piece
    def one_of(r, x, q):
        if r == 0:
            return float(first(x, *q[0]))
        return others(r - 1, x, q[1:])

    return one_of


@lru_cache(maxsize=64)
def _outcome(kind: Any) -> Any:
    """Bind ``outcome(i, j, s, q)`` of one process, `q` being its own parameters."""
    if kind.random:
        drawn = piece(kind.outcome(rng.uniform))

        @piece
        def random(i, j, s, q):
            return drawn(i, j, s.sizes, s.counts, s.rng, *q)

        return random
    plain = piece(kind.outcome)

    @piece
    def certain(i, j, s, q):
        return plain(i, j, s.sizes, s.counts)

    return certain


@lru_cache(maxsize=64)
def outcomes(kinds: tuple[Any, ...]) -> Any:
    """Bind the outcomes into one function of the number of the process."""

    def bound(kinds: tuple[Any, ...]) -> Any:
        first = _outcome(kinds[0])
        if len(kinds) == 1:

            @piece
            def last(r, i, j, s, q):
                return first(i, j, s, q[0])

            return last
        others = bound(kinds[1:])

        @piece
        def one_of(r, i, j, s, q):
            if r == 0:
                return first(i, j, s, q[0])
            return others(r - 1, i, j, s, q[1:])

        return one_of

    found = bound(kinds)

    @piece
    def outcome(r, i, j, s, p, q):
        return found(r, i, j, s, q.outcomes), BOTH

    return outcome


def factors(rates: tuple[Callable[..., Any], ...]) -> Any:
    """Bind the factors into one; `q` holds a tuple of parameters for each; 0 without any."""
    if rates:
        return choice(rates, user_piece)
    return _nothing


@piece
def _nothing(r, t, q):
    return 0.0


@lru_cache(maxsize=64)
def share_of(rate: Callable[..., Any]) -> Any:
    """Bind a share as a function of the pair."""
    inner = user_piece(rate)

    @piece
    def share(pair, *q):
        return inner(float(pair[0]), float(pair[1]), *q)

    return share


@lru_cache(maxsize=64)
def mixture_of(terms: tuple[tuple[Callable[..., Any], Callable[..., Any]], ...]) -> Any:
    """Bind what a kernel that varies is at a time, as a multiple of what it is without factors.

    Of each term the factor and the rate are given, and `q` holds a tuple of parameters for each of
    both.
    """
    if len(terms) == 1:
        factor = user_piece(terms[0][0])

        @piece
        def common(i, j, t, q):
            return float(factor(t, *q[0][0]))

        return common
    added = _added(terms)

    @piece
    def mixture(i, j, t, q):
        varied, whole = added(float(i), float(j), t, q)
        return varied / whole if whole > 0.0 else 0.0

    return mixture


@lru_cache(maxsize=64)
def _added(terms: tuple[tuple[Callable[..., Any], Callable[..., Any]], ...]) -> Any:
    """Bind the sums of terms, with and without the factor of each."""
    factor, rate = user_piece(terms[0][0]), as_float(terms[0][1])
    if len(terms) == 1:

        @piece
        def last(i, j, t, q):
            value = rate(i, j, *q[0][1])
            return factor(t, *q[0][0]) * value, value

        return last
    others = _added(terms[1:])

    @piece
    def added(i, j, t, q):
        value = rate(i, j, *q[0][1])
        varied, whole = others(i, j, t, q[1:])
        return factor(t, *q[0][0]) * value + varied, value + whole

    return added
