"""What an argument is, asked in one way everywhere."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import InputError, Problem


def is_number(value: Any) -> bool:
    """Whether a value is a real number of Python or NumPy.

    True and False are none, nor are durations, which NumPy counts among its whole numbers, nor
    quantities with a unit, which some packages make numbers of.
    """
    return (
        isinstance(value, (int, float, np.integer, np.floating))
        and not isinstance(value, (bool, np.timedelta64))
        and not hasattr(value, "magnitude")
    )


def whole(value: Any) -> int | None:
    """Return a whole number as an int; None if it is none."""
    if isinstance(value, (bool, np.bool_, complex, np.timedelta64, np.datetime64, str, bytes)):
        return None
    if _has_unit(value):
        return None
    try:
        number = int(value)
        return number if number == value else None
    except (TypeError, ValueError, OverflowError):
        return None


def numbers(what: str, given: Any) -> NDArray[np.float64]:
    """Return numbers as an array of floats.

    Parameters
    ----------
    what : str
        The argument, for messages.
    given : array_like
        Numbers without a unit.

    Raises
    ------
    InputError
        For durations, dates, quantities with a unit, texts and flags, of which NumPy would make
        numbers in silence.
    """
    values = None if _has_unit(given) else _array(given)
    parts = values.ravel().tolist() if values is not None and values.dtype.kind == "O" else ()
    if values is None or any(_has_unit(part) for part in parts):
        raise _wrong(
            what,
            "has a unit; give plain numbers in the unit of the rates, such as "
            f'{what}.to("s").magnitude for rates per second',
            given,
        )
    kind: str = values.dtype.kind
    if kind == "O":
        kind = next((k for k in map(_kind, parts) if k != "f"), "f")
    if kind == "m":
        raise _wrong(
            what,
            "is a duration; give plain numbers in the unit of the rates, such as "
            f'{what} / np.timedelta64(1, "s") for rates per second',
            given,
        )
    if kind == "M":
        raise _wrong(
            what,
            "is a date; give the time since the start as plain numbers, such as "
            f'({what} - start) / np.timedelta64(1, "s") for rates per second',
            given,
        )
    if kind not in "iuf":
        raise _wrong(what, "must be a list of numbers", given)
    return values.astype(float)


def orders_of_moments(given: Any, what: str = "orders") -> NDArray[np.float64]:
    """Return orders of moments as an array of floats.

    Raises
    ------
    InputError
        If they are no different finite numbers.
    """
    found = np.atleast_1d(numbers(what, given))
    alone = found.ndim == 1 and 0 < len(np.unique(found)) == found.size
    if not alone or not np.isfinite(found).all():
        raise _wrong(
            what, "must be a list of different finite numbers, such as (0, 1, 2, 3)", given
        )
    return found


def _wrong(what: str, cure: str, given: Any) -> InputError:
    return InputError([Problem(what, cure, given)])


def _has_unit(value: Any) -> bool:
    """Whether a value is a quantity of pint, of astropy or of unyt; without importing them."""
    pint = hasattr(value, "units") and not callable(value.units)
    return pint or (hasattr(value, "unit") and hasattr(value, "to_value"))


def _array(given: Any) -> NDArray[Any]:
    if isinstance(given, (list, tuple)) and any(
        isinstance(x, (str, bytes, bool, np.bool_)) or _has_unit(x) for x in given
    ):
        found = np.empty(len(given), object)
        found[:] = given
        return found
    try:
        return np.asarray(given)
    except (TypeError, ValueError):
        return np.asarray("no numbers")


def _kind(value: Any) -> str:
    """Return the kind of a value as NumPy names it; "f" for every number."""
    if is_number(value):
        return "f"
    if hasattr(value, "total_seconds"):
        return "m"
    return np.asarray(value).dtype.kind if not hasattr(value, "isoformat") else "M"
