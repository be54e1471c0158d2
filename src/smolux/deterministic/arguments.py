"""Checks of the arguments of `smolux.solve`, all at once."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checks import is_number, numbers, orders_of_moments
from ..errors import InputError, did_you_mean
from ..model import Model
from .operator import METHODS

Float = NDArray[np.float64]

GELS = ("inert", "reacts")
_TOLERANCES = 1e-12, 0.1
_SMALLEST = 4


@dataclass(frozen=True)
class Settings:
    """What decides the outcome of `smolux.solve`, besides the model.

    Attributes
    ----------
    window, max_window : int or None
        The last size, if it is fixed, and the largest that it may become, as the user gave them.
    """

    times: tuple[float, ...]
    method: str
    tolerance: float
    window: int | None
    max_window: int | None
    orders: Float
    sizes: int
    bins_per_octave: int
    gel: str


def checked(
    model: Model,
    times: ArrayLike,
    method: str,
    tolerance: float,
    window: int | None,
    max_window: int | None,
    orders: Sequence[float],
    sizes: int,
    bins_per_octave: int,
    gel: str,
    check: bool = False,
) -> Settings:
    """Return the arguments of `smolux.solve` as settings; parameters as there.

    Raises
    ------
    InputError
        With every mistake.
    """
    problems: list[str] = []
    if not isinstance(model, Model):
        problems.append(f"model = {model!r}: must be a smolux.Model(kernel=..., ...)")
    for what, value, choices in (("method", method, METHODS), ("gel", gel, GELS)):
        if value not in choices:
            problems.append(f"{what} = {value!r}: unknown{did_you_mean(str(value), choices)}")
    low, high = _TOLERANCES
    if not (is_number(tolerance) and low <= tolerance <= high):
        problems.append(
            f"tolerance = {tolerance!r}: must be a number from {low:g} to {high:g}; 1e-8 is usual"
        )
    for what, most in (("window", window), ("max_window", max_window)):
        if most is not None:
            _whole(what, most, _SMALLEST, problems)
    if window is not None and max_window is not None:
        problems.append(
            f"window = {window!r} and max_window = {max_window!r}: the first fixes the number of "
            "sizes, the second limits its growth: give one of them"
        )
    counts = {
        "sizes": _whole("sizes", sizes, 1, problems),
        "bins_per_octave": _whole("bins_per_octave", bins_per_octave, 1, problems),
    }
    output = _times(times, problems)
    powers = np.empty(0)
    try:
        powers = orders_of_moments(orders)
    except InputError as error:
        problems += error.problems
    if not isinstance(check, (bool, np.bool_)):
        problems.append(f"check = {check!r}: must be True or False")
    if gel == "reacts" and isinstance(model, Model):
        problems += _beside_a_gel(model)
    if problems:
        raise InputError(problems)
    return Settings(
        times=output,
        method=method,
        tolerance=float(tolerance),
        window=None if window is None else int(window),
        max_window=None if max_window is None else int(max_window),
        orders=powers,
        gel=gel,
        **counts,
    )


def _beside_a_gel(model: Model) -> list[str]:
    if model.only_aggregates:
        return []
    others = [p.name for p in model.processes if p.name != "aggregation"]
    return [
        f"gel = 'reacts': is for aggregation alone, not with {', '.join(others)}: what a gel would "
        "leave then is not defined; use gel='inert'"
    ]


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


def _whole(what: str, value: Any, least: int, problems: list[str]) -> int:
    if is_number(value) and value == value // 1 >= least:
        return int(value)
    problems.append(f"{what} = {value!r}: must be a whole number of at least {least}")
    return least


def _times(times: ArrayLike, problems: list[str]) -> tuple[float, ...]:
    try:
        output = np.atleast_1d(numbers("times", times))
    except InputError as error:
        problems += error.problems
        return ()
    if output.ndim != 1 or not output.size:
        problems.append(f"times = {times!r}: must be a list of at least one number")
    elif not (np.isfinite(output).all() and output[0] >= 0 and output[-1] > 0):
        problems.append(f"times = {times!r}: must be finite, zero or more, and end above zero")
    elif (np.diff(output) <= 0).any():
        k = int(np.argmax(np.diff(output) <= 0))
        problems.append(f"times: must ascend, but {output[k + 1]:g} follows {output[k]:g}")
    return tuple(float(t) for t in output.ravel())
