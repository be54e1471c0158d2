"""What users state of a law: its bounds, and where it jumps or bends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from smolux.checks import is_number, numbers
from smolux.errors import InputError

#: what a user may state: the lowest and the highest value, or a function of the edges of a box
StatedBounds = tuple[float, float] | Callable[..., Any]


@dataclass(frozen=True)
class Stated:
    """A Python function with what its user knows of it; made by `law`."""

    function: Callable[..., Any]
    bounds: StatedBounds | None = None
    breakpoints: tuple[float, ...] = ()


def law(function: Callable[..., Any], *, bounds: Any = None, breakpoints: ArrayLike = ()) -> Stated:
    """State what is known of a Python function of time that is given as a rate.

    Numbers and formulas need none of this, as what they can be is proved. Nor do functions without
    branches on the time. What a function with branches can be is found by trial, which may step
    over what is narrow. Of kernels `smolux.kernels.from_function` takes the same; rates by the size
    of single particles are bounded by those of the sizes that are there.

    Parameters
    ----------
    function : callable
        A function of time ``f(t)``, as a process takes it.
    bounds : float, (float, float) or callable, optional
        The highest value, the lowest and the highest one, or ``bounds(a, b) -> (lower, upper)`` of
        the values from a to b, which takes the parameters of the function after these. A value
        above them that is met raises the bound, and the result warns of it.
    breakpoints : sequence of float, optional
        Where the function jumps or bends. The function is bounded between two of them by itself,
        so that a short peak is neither missed nor dear.

    Returns
    -------
    Stated
        To be given to a process in place of the function.

    Raises
    ------
    InputError
        With every problem found.

    Examples
    --------
    >>> def flash(t):
    ...     return 1000.0 if 30 < t < 30.001 else 0.0
    >>> from smolux.processes import Source
    >>> flashing = Source(1.0, varying=law(flash, bounds=1000.0, breakpoints=[30, 30.001]))
    """
    problems: list[str] = []
    if not callable(function):
        problems.append(
            f"law = {function!r}: must be a Python function; numbers and formulas are given as "
            "they are, their bounds are proved"
        )
    wrong, found, points = statements(bounds, breakpoints, "law")
    if problems + wrong:
        raise InputError(problems + wrong)
    return Stated(function, found, points)


def statements(
    bounds: Any, breakpoints: Any, what: str
) -> tuple[list[str], StatedBounds | None, tuple[float, ...]]:
    """Read the bounds and breakpoints that a user states of a law that is never negative.

    Returns
    -------
    problems : list of str
    bounds : (float, float), callable or None
    breakpoints : tuple of float
        Ascending.
    """
    problems: list[str] = []
    stated: StatedBounds | None = None
    points: tuple[float, ...] = ()
    try:
        stated = _bounds(bounds, what)
    except InputError as error:
        problems += error.problems
    try:
        points = _points(breakpoints, what)
    except InputError as error:
        problems += error.problems
    return problems, stated, points


def _bounds(given: Any, what: str) -> StatedBounds | None:
    if given is None or callable(given):
        return given
    pair = (0.0, given) if is_number(given) else given
    if isinstance(pair, (tuple, list)) and len(pair) == 2 and all(map(is_number, pair)):
        low, high = float(pair[0]), float(pair[1])
        if 0.0 <= low <= high < np.inf:
            return low, high
    raise InputError(
        f"{what}: bounds = {given!r}: must be the highest value, the lowest and the highest one as "
        "in (0.0, 2.0), finite and zero or more, or a function of the edges of a range"
    )


def _points(given: Any, what: str) -> tuple[float, ...]:
    found = numbers(f"{what}: breakpoints", given) if np.size(given) else np.empty(0)
    if found.ndim != 1 or not np.isfinite(found).all():
        raise InputError(f"{what}: breakpoints = {given!r}: must be a list of finite numbers")
    return tuple(np.unique(found).tolist())
