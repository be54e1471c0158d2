"""A rate law of given variables: a number, a formula, a Python function or a list of values.

Time, the size of a particle and the sizes of a pair differ in the ranges over which bounds are
wanted, and in where a function is tried that nothing else bounds: see `smolux.functions.time`,
`smolux.functions.size` and `smolux.kernels`. All else about a law is here.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.checks import is_number, numbers
from smolux.errors import InputError

from .content import frozen
from .formula import Formula, parse
from .intervals import Interval, range_of
from .stated import StatedBounds
from .user_function import Function, numbers_of

Float = NDArray[np.float64]


def _constant(x: Any, value: Any) -> Any:
    return value


def _listed(k: Any, values: Any) -> Any:
    return values[min(int(k), len(values)) - 1]


@dataclass(frozen=True)
class Law:
    """A rate law of given variables; made by `Law.read`, and of other laws by ``+`` and ``*``.

    The sum and the product of two formulas or numbers are formulas; what else is added or
    multiplied stays two `operands`.

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
    user : smolux.functions.user_function.Function or None
    values : tuple of float or None
        For the sizes 1, 2, ...; the last one holds beyond.
    operator, operands : str, tuple of Law
        ``+`` or ``*``, and two laws of the same variables. At most one of the five is given.
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
    operator: str = ""
    operands: tuple[Law, ...] = ()
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

    def __add__(self, other: Any) -> Self:
        """Add a law of the same variables, or a number."""
        return self._with("+", other, 0.0)

    __radd__ = __add__

    def __mul__(self, other: Any) -> Self:
        """Multiply by a law of the same variables, or by a number."""
        return self._with("*", other, 1.0)

    __rmul__ = __mul__

    def _with(self, operator: str, other: Any, neutral: float) -> Self:
        if is_number(other):
            number = float(other)
            other = type(self)(repr(number), self.variables, parameters=(number,), constant=number)
        if not isinstance(other, type(self)) or other.variables != self.variables:
            return NotImplemented
        if neutral in (self.constant, other.constant):
            return self if other.constant == neutral else other
        text, pair = f"({self.text}) {operator} ({other.text})", (self, other)
        if all(x.constant is not None or (x.formula and not x.names) for x in pair):
            with contextlib.suppress(InputError):  # of a text that gets too long
                return type(self).read(text, self.variables, text, "")
        names, parameters = (
            (*getattr(self, name), *getattr(other, name)) for name in ("names", "parameters")
        )
        points = tuple(np.unique([*self.breakpoints, *other.breakpoints]).tolist())
        return type(self)(
            text, self.variables, names, parameters, operator=operator, operands=pair,
            breakpoints=points,
        )  # fmt: skip

    def _of_both(self, one: Any, two: Any) -> Any:
        """Return what two operands give together."""
        return one + two if self.operator == "+" else one * two

    @property
    def functions(self) -> tuple[Function, ...]:
        """The Python functions in it."""
        own = () if self.user is None else (self.user,)
        return own + tuple(found for law in self.operands for found in law.functions)

    @property
    def rate(self) -> Callable[..., Any]:
        """``rate(*variables, *arguments) -> float``: plain Python that Numba compiles.

        The same object for equal laws.
        """
        if self.formula is not None:
            return self.formula.function((*self.variables, *self.names))
        if self.user is not None:
            return self.user.function
        if self.operands:
            one, two = self.operands
            rates = frozen(one.rate), frozen(two.rate)
            return _combined(self.operator, *rates, len(self.variables), len(one.arguments))
        return _listed if self.values is not None else _constant

    @property
    def arguments(self) -> tuple[Any, ...]:
        """What `rate` takes after the variables: the parameters, or the list as one array."""
        if self.operands:
            return tuple(value for law in self.operands for value in law.arguments)
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
        read = [numbers_of(each.function) for each in self.functions]
        return np.unique(np.concatenate([self.breakpoints, *read]))

    def on(self, *variables: ArrayLike) -> Float:
        """Evaluate on arrays of the variables, broadcast against each other."""
        if self.user is not None:
            return self.user.evaluate(variables, self.parameters)
        if self.operands:
            return np.asarray(self._of_both(*(law.on(*variables) for law in self.operands)))
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
        if self.operands:
            return self._of_both(*(law.interval(*variables) for law in self.operands))
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


@lru_cache(maxsize=256)
def _combined(
    operator: str, one: Callable[..., Any], two: Callable[..., Any], variables: int, own: int
) -> Callable[..., Any]:
    """Bind the sum or product of two rates; the first takes so many arguments of its own."""
    end = variables + own

    def added(*x: Any) -> Any:
        return one(*x[:end]) + two(*x[:variables], *x[end:])

    def multiplied(*x: Any) -> Any:
        return one(*x[:end]) * two(*x[:variables], *x[end:])

    return frozen(added if operator == "+" else multiplied)


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
