"""Arguments of `smolux.solve` and `steady_state` that have new names."""

from __future__ import annotations

import warnings
from typing import Any

from smolux.errors import InputError


def renamed(new: str, value: Any, old: str, former: Any) -> Any:
    """Return the value of an argument that has a new name, whichever was given.

    Raises
    ------
    InputError
        If both were.
    """
    if former is None:
        return value
    if value is not None:
        raise InputError(f"{new} = {value!r} and {old} = {former!r}: are one argument; give {new}")
    warnings.warn(f"{old} is called {new} now", DeprecationWarning, stacklevel=3)
    return former
