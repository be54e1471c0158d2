"""A rate law of given variables: a number, a formula, a Python function or a list of values.

Time, the size of a particle and the sizes of a pair differ in the ranges over which bounds are
wanted, and in where a function is tried that nothing else bounds: see `smolux.timefunction`,
`smolux.sizefunction` and `smolux.kernels`. All else about a law is here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .callables import Function, numbers_of
from .checks import is_number, numbers
from .errors import InputError
from .formula import Formula, parse
from .intervals import Interval, range_of

Float = NDArray[np.float64]
#: what a user may state: the lowest and the highest value, or a function of the edges of a box
StatedBounds = tuple[float, float] | Callable[..., Any]


def _constant(x: Any, value: Any) -> Any:
    return value


def _listed(k: Any, values: Any) -> Any:
    return values[min(int(k), len(values)) - 1]


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


@dataclass(frozen=True)
class Law:
    """A rate law of given variables; made by `Law.read`.

    Attributes
    ----------
    text : str
        For case files and messages: the number, the formula, the list or the name of the function.
    variables : tuple of str
        What it is a function of: ``t``; ``k``; or ``i`` and ``j``.
    names, parameters : tuple
        Of a formula or function, what it takes after the variables, and the values. Of a number,
        that.
    constant : float or None
        The value, if it does not vary.
    formula : Formula or None
    user : smolux.callables.Function or None
    values : tuple of float or None
        For the sizes 1, 2, ...; the last one holds beyond. At most one of the four is given.
    stated : (float, float), callable or None
        Bounds that the user states, see `law`.
    breakpoints : tuple of float
        Places that the user states.
    """

    text: str
    variables: tuple[str, ...]
    names: tuple[str, ...] = ()
    parameters: tuple[float, ...] = ()
    constant: float | None = None
    formula: Formula | None = None
    user: Function | None = None
    values: tuple[float, ...] | None = None
    stated: StatedBounds | None = None
    breakpoints: tuple[float, ...] = ()

    @classmethod
    def read(
        cls, given: Any, variables: tuple[str, ...], what: str, kinds: str, lists: bool = False
    ) -> Self:
        """Make a law of what the user gave.

        Parameters
        ----------
        given : float, str, callable or sequence of float
        variables : tuple of str
        what, kinds : str
            What it stands for, and what it may be, for messages.
        lists : bool
            Whether it may be a list of values.

        Raises
        ------
        InputError
            If it is none of these.
        """
        if isinstance(given, str):
            expression = parse(given, variables, what)
            if expression.names:
                return cls(given, variables, formula=expression)
            number = float(expression.evaluate())
            return cls(given, variables, parameters=(number,), constant=number)
        if is_number(given):
            number = float(given)
            return cls(repr(number), variables, parameters=(number,), constant=number)
        if callable(given):
            user = Function.of(given, variables, what)
            return cls(user.text, variables, user.names, user.defaults, user=user)
        values = _list(given, what) if lists else None
        if values is None:
            raise InputError(f"{what} = {given!r}: must be {kinds}")
        listed = [f"{x:g}" for x in values[:4]] + ["..."] * (len(values) > 4)
        return cls(f"[{', '.join(listed)}]", variables, values=values)

    @property
    def rate(self) -> Callable[..., Any]:
        """``rate(*variables, *arguments) -> float``: plain Python that Numba compiles.

        The same object for equal laws.
        """
        if self.formula is not None:
            return self.formula.function((*self.variables, *self.names))
        if self.user is not None:
            return self.user.function
        return _listed if self.values is not None else _constant

    @property
    def arguments(self) -> tuple[Any, ...]:
        """What `rate` takes after the variables: the parameters, or the list as one array."""
        return self.parameters if self.values is None else (np.array(self.values),)

    @property
    def rigorous(self) -> bool:
        """Whether bounds are proved; not for functions that intervals do not follow, or stated."""
        return self.stated is None and self.followed

    @property
    def followed(self) -> bool:
        """Whether intervals follow it."""
        one = Interval(1.0, 2.0)
        try:
            self.interval(*(one for _ in self.variables))
        except TypeError:
            return False
        return True

    @property
    def numbers(self) -> Float:
        """Where it may differ from what it is beside: what is stated, and the numbers it reads."""
        read = np.empty(0) if self.user is None else numbers_of(self.user.function)
        return np.unique(np.concatenate([self.breakpoints, read]))

    def on(self, *variables: ArrayLike) -> Float:
        """Evaluate on arrays of the variables, broadcast against each other."""
        if self.user is not None:
            return self.user.evaluate(variables, self.parameters)
        arrays = np.broadcast_arrays(*(np.asarray(x, float) for x in variables))
        if self.formula is not None:
            with np.errstate(all="ignore"):
                found = self.rate(*arrays, *self.parameters)
            return np.array(np.broadcast_to(np.asarray(found, float), arrays[0].shape))
        if self.values is not None:
            place = np.minimum(arrays[0].astype(np.int64), len(self.values)) - 1
            return np.array(self.values)[place]
        return np.full(arrays[0].shape, self.constant)

    def interval(self, *variables: Interval) -> Interval:
        """Bounds over intervals of the variables, the best only where these are small.

        Raises
        ------
        TypeError
            If it is a function that cannot be followed.
        """
        if self.user is not None:
            return self.user.interval(variables, self.parameters)
        if self.formula is not None:
            found = self.rate(*variables, *self.parameters)
            return found if isinstance(found, Interval) else Interval(float(found))
        low, high = np.broadcast_arrays(variables[0].lo, variables[0].hi)
        if self.values is not None:
            return Interval(*self._range(low, high))
        return Interval(np.full(low.shape, self.constant))

    def stated_bounds(self, *box: ArrayLike) -> tuple[Float, Float]:
        """Bounds that the user states, over boxes: the lower and upper edge of each variable."""
        sides = np.broadcast_arrays(*(np.asarray(x, float) for x in box))
        shape = sides[0].shape
        if isinstance(self.stated, tuple):
            low, high = self.stated
            return np.full(shape, low), np.full(shape, high)
        assert self.stated is not None
        try:
            found = [
                self.stated(*(float(x) for x in edges), *self.parameters)
                for edges in zip(*(side.ravel() for side in sides), strict=True)
            ]
            lower, upper = np.array(found, float).reshape(-1, 2).T
        except Exception as error:  # a user's function may raise anything
            raise InputError(
                f"{self.text}: its bounds raise {type(error).__name__}: {error}; correct them"
            ) from error
        return lower.reshape(shape), upper.reshape(shape)

    def _range(self, low: Float, high: Float) -> tuple[Float, Float]:
        """Least and largest value of the list over ranges of sizes."""
        assert self.values is not None
        count = len(self.values)  # the last one holds beyond
        first = np.clip(low, 1.0, count).astype(np.int64) - 1
        return range_of(np.array(self.values), first, np.clip(high, 1.0, count).astype(np.int64))


def proved_or_tried(
    prove: Callable[..., tuple[Float, Float]],
    trial: Callable[..., tuple[Float, Float]],
    *box: Any,
) -> tuple[Float, Float]:
    """Bounds by `prove`, and where it finds none or raises a TypeError, by `trial`."""
    try:
        lower, upper = prove(*box)
    except TypeError:
        return trial(*box)
    known = np.isfinite(upper)
    if not known.all():
        tried = trial(*box)
        lower, upper = np.where(known, lower, tried[0]), np.where(known, upper, tried[1])
    return lower, upper


def _list(given: Any, what: str) -> tuple[float, ...] | None:
    try:
        values = numbers(what, given)
    except InputError:
        return None
    return tuple(values.tolist()) if values.ndim == 1 and values.size else None
