"""Pieces of time: what varies is neither stepped over nor bridged."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from smolux.deterministic.timemesh import TimeMesh, within
from smolux.errors import InputError
from smolux.functions.stated import law
from smolux.functions.time import TimeFunction


def mesh(given, end, tolerance=1e-8):
    return TimeMesh.of([TimeFunction.of(given)], end, tolerance)


def by_pieces(given, end, tolerance=1e-8):
    """Integrate on each piece by the Gauss rule of degree 7, as exact as a step can be."""
    function = TimeFunction.of(given)
    x, w = np.polynomial.legendre.leggauss(4)
    edges = mesh(given, end, tolerance).edges
    total = 0.0
    for low, high in itertools.pairwise(edges):
        first, last = within(low, high)
        t = np.clip(low + (high - low) * 0.5 * (x + 1), first, last)
        total += 0.5 * (high - low) * float(w @ function(t))
    return total, len(edges) - 1


def window(t):
    return 2.0 if 42.0 < t < 78.0 else 0.0


def day(t):
    return 1.0 if t % 1 > 0.5 else 0.0


def stairs(t):
    return float(math.floor(t))


def saw(t):
    return t % 1


def flash(t):
    return 1000.0 if 30 < t < 30.001 else 0.0


def table(t):
    return np.interp(t, [0.0, 1.0, 2.5, 7.0], [0.0, 3.0, 1.0, 1.0])


@pytest.mark.parametrize(
    ("given", "end", "exact"),
    [
        ("1000*exp(-((t-50)/0.01)**2)", 100.0, 10 * math.sqrt(math.pi)),
        ("1 + 0.5*exp(-((t-31)/0.003)**2)", 100.0, 100 + 0.0015 * math.sqrt(math.pi)),
        ("max(0, sin(2*pi*t))", 20.0, 20 / math.pi),
        (stairs, 10.0, 45.0),
        (saw, 12.0, 6.0),
        ("abs(t - 3.3)", 10.0, (3.3**2 + 6.7**2) / 2),
        (window, 100.0, 72.0),
        (day, 64.0, 32.0),
        (flash, 100.0, 1.0),
        (table, 7.0, 1.5 + 3.0 + 4.5),
        ("0.01*(1 - t/400)", 100.0, 0.875),
    ],
)
def test_integral_on_the_pieces(given, end, exact):
    assert by_pieces(given, end)[0] == pytest.approx(exact, rel=1e-7)


def test_what_does_not_vary_has_one_piece():
    assert list(mesh(3.0, 10.0).edges) == [0.0, 10.0]
    assert list(mesh("1 + t**3", 10.0).edges) == [0.0, 10.0]


def test_jumps_are_found_to_the_last_bit():
    edges = mesh(window, 100.0).edges
    for jump in (42.0, 78.0):
        assert np.min(np.abs(edges - jump)) < 1e-13
    assert len(edges) <= 5


def test_pieces_of_several_functions():
    even = TimeFunction.of(lambda t: math.floor(t / 2) + 0.0)
    odd = TimeFunction.of(lambda t: math.floor((t + 1) / 2) + 0.0)
    both = TimeMesh.of([even, odd], 4.0, 1e-8)
    np.testing.assert_allclose(both.edges, [0, 1, 2, 3, 4], rtol=1e-14)
    assert both.piece(0.5) == pytest.approx((0.0, 1.0))
    assert both.piece(4.0) == pytest.approx((3.0, 4.0))


def test_what_is_stated_is_found():
    place = 1234.5 * 1e-3

    def hidden(t):  # the numbers it reads do not tell where it is
        return 1.0 if abs(math.sin(t * 0.5) - math.sin(place * 0.5)) < 1e-6 else 0.0

    stated = law(hidden, breakpoints=[place - 5e-6, place, place + 5e-6])
    found = mesh(stated, 3.0).edges
    assert np.min(np.abs(found - place)) < 1e-5
    assert by_pieces(stated, 3.0)[0] > 1e-6


@pytest.mark.parametrize("given", ["1 - t", "1/abs(t - 2)"])
def test_wrong_values_are_mistakes(given):
    with pytest.raises(InputError, match="finite number, zero or more"):
        mesh(given, 4.0)


def test_too_many_pieces(monkeypatch):
    monkeypatch.setattr("smolux.deterministic.timemesh._MOST", 4000)
    with pytest.raises(InputError, match="varies too fast"):
        mesh("1 + sin(1e7*t)", 100.0)
