"""Quantities with units, at the edge only: inside, numbers are SI or dimensionless.

A string such as ``"1e12 cm^-3"`` becomes a float in SI units. Pint is loaded when the first string
comes whose unit is not the SI unit itself, so that cases without units never wait for it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, get_type_hints

import numpy as np

from .errors import InputError


@dataclass(frozen=True)
class Dimension:
    """What a quantity measures.

    Attributes
    ----------
    words : str
        Its name in messages.
    unit : str
        The SI unit, as text.
    example : str
        A quantity as one would write it.
    """

    words: str
    unit: str
    example: str


TIME = Dimension("a time", "s", "10 s")
LENGTH = Dimension("a length", "m", "50 nm")
VOLUME = Dimension("a volume", "m^3", "1 um^3")
NUMBER_DENSITY = Dimension("a number per volume", "m^-3", "1e6 cm^-3")
MASS_DENSITY = Dimension("a mass per volume", "kg/m^3", "1.2 g/cm^3")
TEMPERATURE = Dimension("a temperature", "K", "298 K")
PRESSURE = Dimension("a pressure", "Pa", "1013.25 hPa")
VISCOSITY = Dimension("a dynamic viscosity", "Pa*s", "1.8e-5 Pa s")
RATE = Dimension("a rate (one over a time)", "1/s", "100 1/s")
DISSIPATION = Dimension("a power per mass", "m^2/s^3", "10 cm^2/s^3")
ACCELERATION = Dimension("an acceleration", "m/s^2", "9.81 m/s^2")
KERNEL = Dimension("a collision kernel (volume per time)", "m^3/s", "1e-9 cm^3/s")
NONE = Dimension("a plain number", "", "0.5")

# Arguments of functions say what they measure by their types, see `of_arguments`.
Length = Annotated[float, LENGTH]
Volume = Annotated[float, VOLUME]
MassDensity = Annotated[float, MASS_DENSITY]
CollisionRate = Annotated[float, KERNEL]
Temperature = Annotated[float, TEMPERATURE]
Pressure = Annotated[float, PRESSURE]
Viscosity = Annotated[float, VISCOSITY]
Rate = Annotated[float, RATE]
Dissipation = Annotated[float, DISSIPATION]
Acceleration = Annotated[float, ACCELERATION]

_QUANTITY = re.compile(r"\s*([-+]?(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*")


def of_arguments(function: Callable[..., Any]) -> dict[str, Dimension]:
    """Return what the arguments of a function measure, by their names; others are plain numbers."""
    found = {}
    for name, kind in get_type_hints(function, include_extras=True).items():
        for said in getattr(kind, "__metadata__", ()):
            found[name] = said
    return found


def parse(text: str, dimension: Dimension) -> float:
    """Turn a quantity with a unit into SI.

    Parameters
    ----------
    text : str
        A number and a unit, such as ``"1e12 cm^-3"``.
    dimension : Dimension
        What it should measure.

    Returns
    -------
    float
        In units of ``dimension.unit``.

    Raises
    ------
    InputError
        No number, no unit, an unknown unit or one of another dimension.
    """
    match = _QUANTITY.fullmatch(text)
    wanted = f'{dimension.words}, for example "{dimension.example}"'
    if match is None:
        raise InputError(f"is not a number with a unit; give {wanted}")
    number, unit = float(match[1]), match[2]
    if not math.isfinite(number):
        raise InputError(f"is not finite; give {wanted}")
    if not unit:
        raise InputError(f"has no unit; give {wanted}, or a plain number without quotes")
    if unit == dimension.unit:
        # the unit that `text` writes: no conversion, so that a resolved case reads back bit for bit
        return number
    return _convert(number, unit, dimension, wanted)


def parse_any(text: str) -> float:
    """Turn a quantity of any dimension into SI base units.

    Raises
    ------
    InputError
        No number, no unit or an unknown one.
    """
    match = _QUANTITY.fullmatch(text)
    if match is None or not match[2]:
        raise InputError('must be a number, or a number with its unit such as "298 K"')
    try:
        return _tidy(_registry().Quantity(float(match[1]), match[2]).to_base_units().magnitude)
    except Exception:  # pint raises half a dozen kinds, some of Python's own
        raise InputError(f'has an unknown unit ("{match[2]}")') from None


def text(value: float, dimension: Dimension) -> str:
    """Write an SI value so that `parse` gives it back exactly."""
    return f"{shortest(value)} {dimension.unit}"


def shortest(value: float) -> str:
    """Write a float with the fewest signs that read back to it: ``1e+13``, not fourteen digits."""
    plain = repr(value)
    if len(plain) < 9 or not math.isfinite(value):
        return plain
    return min(plain, np.format_float_scientific(value, trim="-"), key=len)


@cache
def _registry() -> Any:
    import pint

    # offset units (degC) mean a temperature here, never a difference of two
    # no cache on disk: Pint's holds the paths of the environment that filled it, for all of them
    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True)


def _tidy(value: float) -> float:
    """Drop the last digit, in which conversions leave their rounding: 1e12 cm^-3 is 1e18 m^-3."""
    return float(f"{value:.15g}")


def _convert(number: float, unit: str, dimension: Dimension, wanted: str) -> float:
    registry = _registry()
    try:
        quantity = registry.Quantity(number, unit)
        value = _tidy(quantity.to(dimension.unit or "dimensionless").magnitude)
    except Exception as problem:  # pint raises half a dozen kinds, some of Python's own
        kind = type(problem).__name__
        if kind == "DimensionalityError":
            raise InputError(f"has the unit of something else; give {wanted}") from None
        if kind == "UndefinedUnitError":
            raise InputError(f'has an unknown unit ("{unit}"); give {wanted}') from None
        raise InputError(f'has a unit that cannot be read ("{unit}"); give {wanted}') from None
    if not math.isfinite(value):
        raise InputError(f"is not finite in SI units; give {wanted}")
    return value
