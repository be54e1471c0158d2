"""What an argument is, asked in one way everywhere."""

from __future__ import annotations

from typing import Any

import numpy as np


def is_number(value: Any) -> bool:
    """Whether a value is a number of Python or NumPy; True and False are none."""
    return isinstance(value, (int, float, np.number)) and not isinstance(value, bool)


def whole(value: Any) -> int | None:
    """Return a whole number as an int; None if it is none."""
    try:
        number = int(value)
        return number if number == value and not isinstance(value, bool) else None
    except (TypeError, ValueError, OverflowError):
        return None
