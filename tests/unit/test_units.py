from __future__ import annotations

import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from smolux import units
from smolux.errors import InputError


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("1e12 cm^-3", units.NUMBER_DENSITY, 1e18),
        ("1e12 1/cm^3", units.NUMBER_DENSITY, 1e18),
        ("25 degC", units.TEMPERATURE, 298.15),
        ("298 K", units.TEMPERATURE, 298.0),
        ("2 min", units.TIME, 120.0),
        ("-1.5e1 ms", units.TIME, -0.015),
        ("1_000 s", units.TIME, 1000.0),
        (".5 um", units.LENGTH, 5e-7),
        ("1e-9 cm^3/s", units.KERNEL, 1e-15),
        ("1.8e-5 Pa s", units.VISCOSITY, 1.8e-5),
        ("1.2 g/cm^3", units.MASS_DENSITY, 1200.0),
        ("1.234567890123 cm", units.LENGTH, 0.01234567890123),
    ],
)
def test_quantities_become_si(text, dimension, value):
    assert units.parse(text, dimension) == value


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("ten seconds", "is not a number with a unit; give a time"),
        ("10", "has no unit; give a time"),
        ("10 m", "has the unit of something else; give a time"),
        ("10 sekunden", 'has an unknown unit ("sekunden"); give a time'),
        ("10 s**", "cannot be read"),
        ("10 __import__('os')", "unit"),
        ("1e999 s", "is not finite"),
        ("1e308 yr", "is not finite"),
    ],
)
def test_mistakes_are_named(text, words):
    with pytest.raises(InputError) as caught:
        units.parse(text, units.TIME)
    assert words in str(caught.value)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_what_is_written_reads_back_exactly(value):
    for dimension in (units.TIME, units.KERNEL, units.NUMBER_DENSITY):
        assert units.parse(units.text(value, dimension), dimension) == value


def test_any_dimension_in_si_base_units():
    assert units.parse_any("3 g/cm^3") == 3000.0
    for text in ("3", "x", "3 nonsense"):
        with pytest.raises(InputError):
            units.parse_any(text)


def test_si_units_do_not_load_pint():
    code = (
        "import sys; from smolux import units; units.parse('1 s', units.TIME);"
        "sys.exit('pint' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_units_do_not_depend_on_what_an_environment_left_on_the_disk():
    """Pint's cache holds the paths of the environment that filled it."""
    assert units._registry()._diskcache is None
