"""Checks of the arguments of `smolux.solve`, all at once."""

from __future__ import annotations

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
#: largest windows by default; for the direct sum, whose cost is quadratic, see `DIRECT_LIMIT`
_LIMIT, DIRECT_LIMIT = 1 << 20, 1 << 13
#: where a gel forms, and where only other processes keep one from forming
_GEL_LIMIT, _HINDERED_LIMIT = 1 << 12, 1 << 16
_SMALLEST = 4
#: at least so many times the largest size at the start
_ROOM = 8


@dataclass(frozen=True)
class Settings:
    """What decides the outcome of `smolux.solve`, besides the model.

    Attributes
    ----------
    limit : int
        The largest number of sizes.
    fixed, given : bool
        Whether the number of sizes stays at `limit`, and whether that is the user's choice.
    """

    times: tuple[float, ...]
    method: str
    tolerance: float
    limit: int
    fixed: bool
    given: bool
    orders: Float
    sizes: int
    bins_per_octave: int
    gel: str


def check(
    model: Model,
    times: ArrayLike,
    method: str,
    tolerance: float,
    largest: int | None,
    max_size: int | None,
    orders: Sequence[float],
    sizes: int,
    bins_per_octave: int,
    gel: str,
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
    for what, most in (("largest", largest), ("max_size", max_size)):
        if most is not None:
            _whole(what, most, _SMALLEST, problems)
    if largest is not None and max_size is not None and largest != max_size:
        problems.append(
            f"largest = {largest!r} and max_size = {max_size!r}: the first fixes the number of "
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
    if gel == "reacts" and isinstance(model, Model):
        others = [p.name for p in model.processes if p.name != "aggregation"]
        if others:
            problems.append(
                f"gel = 'reacts': is for aggregation alone, not with {', '.join(others)}: "
                "what a gel would leave then is not defined; use gel='inert'"
            )
    if problems:
        raise InputError(problems)
    limit = largest or max_size or _default_limit(model)
    return Settings(
        times=output,
        method=method,
        tolerance=float(tolerance),
        limit=min(int(limit), _beyond(model)),
        fixed=largest is not None,
        given=largest is not None or max_size is not None,
        orders=powers,
        gel=gel,
        **counts,
    )


def _beyond(model: Model) -> int:
    """Return the largest size that is ever there, if particles beyond a size leave."""
    return 1 << 62 if model.cut is None else max(model.cut, _SMALLEST)


def _default_limit(model: Model) -> int:
    if not model.kernel.gels:
        return _LIMIT
    limit = _GEL_LIMIT if len(model.processes) == 1 else _HINDERED_LIMIT
    return max(limit, _ROOM * model.initial.largest)


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
