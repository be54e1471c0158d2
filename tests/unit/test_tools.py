"""The tools that compare code before and after a change."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from numba import njit

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from tools import layers  # noqa: E402
from tools.assembly import digest, normalised  # noqa: E402
from tools.side_by_side import argument_sets  # noqa: E402


def compiled(source: str):
    space: dict = {}
    exec(source, space)
    function = njit("float64(float64)")(space["f"])
    function(2.0)
    return function


def test_a_new_name_is_no_change_and_a_new_number_is_one():
    one = compiled("def f(x):\n    return x * x + 3.5\n")
    renamed = compiled("# moved\n\n\ndef g(y):\n    return y * y + 3.5\n\n\nf = g\n")
    other = compiled("def f(x):\n    return x * x + 4.5\n")
    assert digest(one) == digest(renamed)
    assert digest(one) != digest(other)
    (text,) = one.inspect_asm().values()
    assert "symbol1" in normalised(text)
    assert "_Z" not in normalised(text)


@pytest.mark.parametrize("word", ["particles", "times", "remix"])
def test_argument_sets_are_right_and_wrong_and_the_same_each_time(word):
    sets = argument_sets(50)
    assert str(sets) == str(argument_sets(50))
    assert len({str(given[word]) for given in sets}) > 1


def test_the_figure_of_the_layers_is_that_of_the_contract():
    """``python tools/layers.py`` draws it anew."""
    assert layers.FIGURE.read_text(encoding="utf-8") == layers.drawn()
    assert {row[0] for row in layers.layers()} == set(layers.WORDS)
