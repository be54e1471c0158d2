"""Checks of the arguments of `smolux.solve`, all at once."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

from ..errors import InputError, Problem
from ..model import Model
from ..settings import SolverSettings


def checked(model: Any, given: Mapping[str, Any]) -> SolverSettings:
    """Return the arguments of `smolux.solve` as settings.

    Raises
    ------
    InputError
        With every mistake.
    """
    problems: list[str] = []
    if not isinstance(model, Model):
        problems.append(Problem("model", "must be a smolux.Model(kernel=..., ...)", model))
    elif given.get("gel") == "reacts" and not model.only_aggregates:
        others = [p.name for p in model.processes if p.name != "aggregation"]
        cure = (
            f"is for aggregation alone, not with {', '.join(others)}: what a gel would leave then "
            "is not defined; use gel='inert'"
        )
        problems.append(Problem("gel", cure, "reacts"))
    try:
        settings = SolverSettings.checked(given)
    except InputError as error:
        raise InputError([*error.problems, *problems]) from None
    if problems:
        raise InputError(problems)
    return settings


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
