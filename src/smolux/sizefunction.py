"""A number, a formula, a list or a function of the size of a particle, with bounds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .boxes import subdivided
from .callables import Function, numbers_of, spread
from .checks import is_number, numbers
from .errors import InputError
from .formula import Formula, parse
from .intervals import Interval

Float = NDArray[np.float64]

#: sizes at which a function that intervals do not follow is tried, and what is added then
_SAMPLES = 48
_SAFETY = 1.1
#: ranges of fewer sizes than this are tried at every size
_ALL = 257
#: sizes at which a new function is looked at
_TRIED = (1.0, 2.0, 3.0, 10.0, 100.0, 1000.0)


def _constant(k: Any, value: Any) -> Any:
    return value


def _listed(k: Any, values: Any) -> Any:
    return values[min(int(k), len(values)) - 1]


@dataclass(frozen=True)
class SizeFunction:
    """A function of the size; made by `SizeFunction.of`.

    Attributes
    ----------
    text : str
        For case files and messages: the number, the formula, the list or the name of the function.
    variable : str
        What the size is called in formulas.
    constant : float or None
        The value, if it does not depend on the size.
    formula : Formula or None
    user : smolux.callables.Function or None
    values : tuple of float or None
        For the sizes 1, 2, ...; the last one holds beyond. At most one of the four is given.
    """

    text: str
    variable: str
    constant: float | None = None
    formula: Formula | None = None
    user: Function | None = None
    values: tuple[float, ...] | None = None

    @classmethod
    def of(cls, given: Any, what: str, variable: str = "k") -> SizeFunction:
        """Make a function of the size.

        Parameters
        ----------
        given : float, str, callable, sequence of float or SizeFunction
            A number; a formula in the size such as ``"k**(2/3)"``, see `smolux.formula`; a plain
            Python function of one size, whose further arguments have defaults; or the values for
            the sizes 1, 2, ..., of which the last one holds for all larger ones, too.
        what : str
            What it stands for, for messages.
        variable : str
            What the size is called in a formula.

        Raises
        ------
        InputError
            If it is none of these, or negative or not finite at a few sizes.
        """
        if isinstance(given, cls):
            return given
        new = cls._made(given, what, variable)
        new._try(what)
        return new

    @classmethod
    def _made(cls, given: Any, what: str, variable: str) -> SizeFunction:
        if isinstance(given, str):
            expression = parse(given, (variable,), what)
            if expression.names:
                return cls(given, variable, formula=expression)
            return cls(given, variable, constant=float(expression.evaluate()))
        if is_number(given):
            return cls(repr(float(given)), variable, constant=float(given))
        if callable(given):
            user = Function.of(given, (variable,), what)
            return cls(user.text, variable, user=user)
        try:
            values = numbers(what, given)
        except InputError:
            values = np.empty((0, 0))
        if values.ndim == 1 and values.size:
            listed = [f"{x:g}" for x in values[:4]] + ["..."] * (len(values) > 4)
            return cls(f"[{', '.join(listed)}]", variable, values=tuple(values.tolist()))
        raise InputError(
            f"{what} = {given!r}: must be a number, a formula in {variable} such as "
            f'"{variable}**(2/3)", a function of the size, or a list of the values for the sizes '
            "1, 2, ..."
        )

    def _try(self, what: str) -> None:
        where = f"{what} = {self.text}"
        sizes = np.array(_TRIED) if self.values is None else np.arange(1.0, len(self.values) + 1.0)
        try:
            found = self(sizes)
        except Exception as error:  # a user's function may raise anything
            raise InputError(
                f"{where}: raises {type(error).__name__}: {error}; correct the function"
            ) from error
        self._check(sizes, found, (found >= 0.0) & (found < np.inf), f"{where}: ", "zero or more")

    def _check(self, sizes: Float, found: Float, good: Any, where: str, wanted: str) -> None:
        if not good.all():
            k = int(np.argmin(good))
            raise InputError(
                f"{where}is {found[k]:g} for the size {sizes[k]:.0f}; must be a finite number, "
                f"{wanted}"
            )

    def check_positive(self, what: str) -> None:
        """Raise `InputError` if the function is zero at one of a few sizes up to 2**40."""
        sizes = np.unique(np.concatenate((np.arange(1.0, 65.0), 2.0 ** np.arange(41))))
        found = self(sizes)
        good = (found > 0.0) & (found < np.inf)
        self._check(sizes, found, good, f"{what} = {self.text}: ", "above zero")

    @property
    def parameters(self) -> tuple[Any, ...]:
        """What `rate` takes after the size: floats, or one array."""
        if self.values is not None:
            return (np.array(self.values),)
        if self.user is not None:
            return self.user.defaults
        return () if self.constant is None else (self.constant,)

    @property
    def rate(self) -> Callable[..., Any]:
        """``rate(k, *parameters) -> float``: plain Python that Numba compiles."""
        if self.formula is not None:
            return self.formula.function((self.variable,))
        if self.user is not None:
            return self.user.function
        return _listed if self.values is not None else _constant

    def __call__(self, sizes: ArrayLike) -> Float:
        """Evaluate on an array of sizes."""
        sizes = np.asarray(sizes, float)
        if self.user is not None:
            return self.user.evaluate((sizes,), self.user.defaults)
        if self.formula is not None:
            return self.formula.evaluate(**{self.variable: sizes})
        if self.values is not None:
            place = np.minimum(sizes.astype(np.int64), len(self.values)) - 1
            return np.array(self.values)[place]
        return np.full(sizes.shape, self.constant)

    @property
    def rigorous(self) -> bool:
        """Whether `bounds` is proved, by intervals; False for functions that they do not follow."""
        try:
            self.interval(Interval(1.0, 2.0))
        except TypeError:
            return False
        return True

    def interval(self, k: Interval) -> Interval:
        """Bounds of the function over intervals of sizes.

        Raises
        ------
        TypeError
            If it is a function that cannot be followed.
        """
        if self.user is not None:
            return self.user.interval((k,), self.user.defaults)
        if self.formula is not None:
            return self.formula.interval(**{self.variable: k})
        lo, hi = np.broadcast_arrays(k.lo, k.hi)
        if self.values is not None:
            return Interval(*self._range(lo, hi))
        return Interval(np.full(lo.shape, self.constant))

    def bounds(self, a: ArrayLike, b: ArrayLike) -> tuple[Float, Float]:
        """Bounds over the sizes ``a <= k <= b``; infinite where there are none.

        By interval arithmetic, else by trial with a margin; never below zero.
        """
        a, b = np.broadcast_arrays(np.asarray(a, float), np.asarray(b, float))
        if self.values is not None:
            return self._range(a, b)
        try:
            one = np.ones(a.shape)
            found = subdivided(lambda k, _: self.interval(k), a, b, one, one, 8, least=0.0)
        except TypeError:
            return self._sampled(a, b)
        lower, upper = found
        known = np.isfinite(upper)
        if not known.all():
            sampled = self._sampled(a, b)
            lower, upper = np.where(known, lower, sampled[0]), np.where(known, upper, sampled[1])
        return lower, upper

    def _sampled(self, a: Float, b: Float) -> tuple[Float, Float]:
        assert self.user is not None or self.formula is not None
        low, high = a.ravel(), b.ravel()
        sizes, owner = _tried(low, high, self._numbers)
        values = self(sizes)
        least, most = np.full(len(low), np.inf), np.full(len(low), -np.inf)
        good = ~np.isnan(values)
        np.minimum.at(least, owner[good], values[good])
        np.maximum.at(most, owner[good], values[good])
        # Where every size was tried, nothing is left to guess.
        single = np.where(high - low < _ALL, 1.0, _SAFETY)
        return (least / single).reshape(a.shape), (most * single).reshape(a.shape)

    @property
    def _numbers(self) -> Float:
        return np.empty(0) if self.user is None else numbers_of(self.user.function)

    def _range(self, low: Float, high: Float) -> tuple[Float, Float]:
        assert self.values is not None
        # The last value holds beyond; once more, so that the end of a range is a place, too.
        values = np.array((*self.values, self.values[-1]))
        count = len(self.values)
        first = np.clip(low, 1.0, count).astype(np.int64).ravel() - 1
        last = np.clip(high, 1.0, count).astype(np.int64).ravel()
        if not first.size:
            return np.empty(low.shape), np.empty(low.shape)
        places = np.stack([first, last], axis=1).ravel()
        least = np.minimum.reduceat(values, places)[::2]
        most = np.maximum.reduceat(values, places)[::2]
        return least.reshape(low.shape), most.reshape(low.shape)


def _tried(low: Float, high: Float, numbers: Float) -> tuple[Float, NDArray[np.int64]]:
    """Sizes at which a function is tried over ranges of sizes, and the range of each.

    Every whole size of a short range; of others the ends, sizes in no step with any period, and the
    whole numbers at and next to those that the function reads.
    """
    sizes, owner = [low, high], [np.arange(len(low)), np.arange(len(low))]
    short = np.flatnonzero(high - low < _ALL)
    steps = np.arange(_ALL, dtype=float)
    whole = np.minimum(low[short, None] + steps, high[short, None])
    sizes.append(whole.ravel())
    owner.append(np.repeat(short, len(steps)))
    wide = np.flatnonzero(high - low >= _ALL)
    share = spread(_SAMPLES)
    between = low[wide, None] * (high / low)[wide, None] ** share
    sizes.append(np.clip(np.rint(between), low[wide, None], high[wide, None]).ravel())
    owner.append(np.repeat(wide, len(share)))
    near = np.unique(np.concatenate([np.floor(numbers) + step for step in (-1.0, 0.0, 1.0, 2.0)]))
    for k in wide:
        inside = near[(near >= low[k]) & (near <= high[k])]
        sizes.append(inside)
        owner.append(np.full(len(inside), k))
    pairs = np.stack([np.concatenate(owner).astype(float), np.concatenate(sizes)])
    pairs = np.unique(pairs, axis=1)
    return pairs[1], pairs[0].astype(np.int64)
