"""A user's plain Python function of numbers: checked, run on arrays and on intervals."""

from __future__ import annotations

import builtins
import contextlib
import inspect
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache, reduce
from types import BuiltinFunctionType, FunctionType, ModuleType, SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.checks import is_number
from smolux.errors import InputError, did_you_mean

from .content import INSTALLED, frozen, module_of, names_in
from .intervals import Interval

Float = NDArray[np.float64]

#: entries of an array result that are compared with calls on single numbers
_COMPARED = 24

_ARRAY_MATH = {
    name: getattr(np, numpy_name)
    for name, numpy_name in {
        "sqrt": "sqrt", "cbrt": "cbrt", "exp": "exp", "expm1": "expm1", "log": "log",
        "log2": "log2", "log10": "log10", "log1p": "log1p", "fabs": "absolute", "pow": "power",
        "sin": "sin", "cos": "cos", "tanh": "tanh", "atan": "arctan", "floor": "floor",
        "ceil": "ceil", "hypot": "hypot",
    }.items()
    if hasattr(math, name)
}  # fmt: skip
_ARRAY_MATH["log"] = lambda x, *base: np.log(x) / np.log(base[0]) if base else np.log(x)


@dataclass(frozen=True)
class Function:
    """A user's function; made by `of`.

    Attributes
    ----------
    function : callable
        The plain Python function.
    names, defaults : tuple
        Its parameters after the leading arguments, and their values.
    """

    function: Callable[..., Any]
    names: tuple[str, ...]
    defaults: tuple[float, ...]

    @classmethod
    def of(cls, function: Any, arguments: tuple[str, ...], what: str) -> Function:
        """Take a function apart.

        Parameters
        ----------
        function : callable
            A Python function of `arguments`, whose further arguments have numbers as defaults. A
            compiled (Numba) function is taken for the Python function it was made from.
        arguments : tuple of str
            What the leading arguments stand for.
        what : str
            What the function stands for, for messages.

        Raises
        ------
        InputError
            If it is no plain function or its signature does not fit.
        """
        plain = getattr(function, "py_func", function)
        example = f"def f({', '.join(arguments)}, a=1.0)"
        if not isinstance(plain, FunctionType):
            raise InputError(f"{what} = {function!r}: must be a Python function such as {example}")
        problems, names, defaults = [], [], []
        found = list(inspect.signature(plain).parameters.values())
        where = f"{what} = {plain.__name__}{inspect.signature(plain)}"
        if any(p.kind not in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD) for p in found):
            problems.append(f"{where}: give each argument by name, no *args, **kwargs or * alone")
        elif len(found) < len(arguments):
            problems.append(f"{where}: must take {' and '.join(arguments)}, as {example}")
        for p in found[len(arguments) :] if not problems else ():
            if p.default is p.empty:
                problems.append(f"{where}: argument {p.name!r} needs a default, as {p.name}=1.0")
                continue
            problems += wrong_number(p.default, f"{where}: the default of {p.name!r}")
            names.append(p.name)
            defaults.append(p.default)
        if problems:
            raise InputError(problems)
        return cls(plain, tuple(names), tuple(float(value) for value in defaults))

    def values(self, given: dict[str, Any], what: str) -> tuple[float, ...]:
        """Return the parameters, with those that are given in place of the defaults."""
        problems = []
        for name, value in given.items():
            if name not in self.names:
                cure = did_you_mean(name, self.names) if self.names else "; it takes none"
                problems.append(f"{what}: unknown parameter {name!r} of {self.text}{cure}")
            problems += wrong_number(value, f"{what}: parameter {name!r}")
        if problems:
            raise InputError(problems)
        pairs = zip(self.names, self.defaults, strict=True)
        return tuple(float(given.get(name, value)) for name, value in pairs)

    @property
    def text(self) -> str:
        """The name of the function."""
        return self.function.__name__

    @property
    def source(self) -> str | None:
        """The source text, if there is any."""
        try:
            return inspect.cleandoc("\n" + inspect.getsource(self.function))
        except (OSError, TypeError):
            return None

    def scalar(self, arguments: tuple[float, ...], parameters: tuple[float, ...]) -> float:
        """Call with single numbers; what is too large is infinite, as in compiled code."""
        return _scalar(frozen(self.function), arguments, parameters)

    def evaluate(self, arguments: tuple[ArrayLike, ...], parameters: tuple[float, ...]) -> Float:
        """Call with arrays: at once if the function allows it, else entry by entry.

        A function of single numbers may misread arrays without an error, so some entries are
        compared with calls on single numbers.
        """
        arrays = np.broadcast_arrays(*(np.asarray(x, float) for x in arguments))
        flat = [np.ascontiguousarray(x).ravel() for x in arrays]
        result = self._at_once(flat, parameters)
        if result is None:
            now = frozen(self.function)
            values = [_scalar(now, entry, parameters) for entry in zip(*flat, strict=True)]
            result = np.array(values, float)
        return result.reshape(arrays[0].shape)

    def takes_arrays(self, parameters: tuple[float, ...]) -> bool:
        """Whether a call with two arrays gives what calls with single numbers do."""
        sizes = np.geomspace(1.0, 2.0 * _COMPARED, 2 * _COMPARED)
        return self._at_once([sizes, sizes[::-1].copy()], parameters) is not None

    def _at_once(self, flat: list[Float], parameters: tuple[float, ...]) -> Float | None:
        size = flat[0].size
        if size < _COMPARED:
            return None
        now = frozen(self.function)
        try:
            with np.errstate(all="ignore"):
                found = np.asarray(_for_arrays(now)(*flat, *parameters))
            if found.shape not in ((), (size,)) or found.dtype.kind not in "fiub":
                return None
            result = np.array(np.broadcast_to(found, (size,)), float)
        except Exception:  # whatever it is: the function is not one of arrays
            return None
        # never in step with the rows of a matrix
        index = np.concatenate([(golden(_COMPARED - 1) * size).astype(int), [0, size - 1]])
        single = [_scalar(now, tuple(x[k] for x in flat), parameters) for k in index]
        same = np.allclose(result[index], single, rtol=1e-9, atol=0.0, equal_nan=True)
        return result if same else None

    def interval(self, arguments: tuple[Interval, ...], parameters: tuple[float, ...]) -> Interval:
        """Bounds of the function over intervals.

        Raises
        ------
        TypeError
            If the function compares its arguments or calls what intervals do not follow.
        """
        try:
            found = _for_arrays(frozen(self.function))(*arguments, *parameters)
        except Exception as error:
            raise TypeError(f"{self.text} cannot be followed: {error}") from error
        if isinstance(found, Interval):
            return found
        if isinstance(found, (int, float, np.number)):
            return Interval(float(found))
        raise TypeError(f"{self.text} cannot be followed: it returned {type(found).__name__}")


def _scalar(
    function: Callable[..., Any], arguments: Iterable[float], parameters: tuple[float, ...]
) -> float:
    with np.errstate(all="ignore"):
        try:
            return float(function(*(np.float64(x) for x in arguments), *parameters))
        except OverflowError:
            return np.inf


def numbers_of(function: Callable[..., Any], most: int = 4096) -> Float:
    """Return the numbers that a function reads, ascending: where its branches and tables change.

    Constants, defaults, and what is in its closure, its globals and modules of the user, and in the
    functions that it calls; arrays and lists of numbers, too, unless there are more than `most`.
    """
    found: set[float] = set()
    _collect(function, found, set(), most)
    return np.array(sorted(found))


def _collect(value: Any, found: set[float], done: set[int], most: int) -> None:
    called = getattr(value, "py_func", value)
    if isinstance(called, FunctionType):
        if id(called) in done or (called.__module__ or "").startswith("numpy"):
            return
        done.add(id(called))
        reached = inspect.getclosurevars(called)
        held = [*called.__code__.co_consts, *(called.__defaults__ or ())]
        held += [*reached.nonlocals.values(), *reached.globals.values()]
        for module in [value for value in held if isinstance(value, ModuleType)]:
            if module_of(module) not in INSTALLED:
                names = names_in(called.__code__)
                held += [getattr(module, name) for name in names if hasattr(module, name)]
        for inner in held:
            _collect(inner, found, done, most)
    elif is_number(value):
        found |= {abs(float(value))} if np.isfinite(value) else set()
    elif isinstance(value, (tuple, list, np.ndarray)) and 0 < len(np.atleast_1d(value)) <= most:
        with contextlib.suppress(TypeError, ValueError):
            entries = np.abs(np.asarray(value, float).ravel())
            found |= set(entries[np.isfinite(entries)].tolist())


def golden(count: int) -> Float:
    """Return numbers in [0, 1), spread by the golden ratio: evenly, and in step with no period."""
    return np.modf(np.arange(1, count + 1) * 0.6180339887498949)[0]


def spread(count: int) -> Float:
    """Return numbers in [0, 1] in no step with any period: both ends, even and irregular ones.

    The same ones on every machine: PCG64 is defined to the bit.
    """
    random = np.random.Generator(np.random.PCG64(count)).random(count)
    return np.concatenate([np.linspace(0.0, 1.0, count // 4 + 1), golden(count - 1), random])


def wrong_number(value: Any, where: str) -> list[str]:
    """Return a message unless the value is a finite number."""
    if not is_number(value):
        return [f"{where} = {value!r}: must be a number"]
    return [] if np.isfinite(value) else [f"{where} = {value!r}: must be a finite number"]


@lru_cache(maxsize=256)
def _for_arrays(function: FunctionType) -> Callable[..., Any]:
    """Copy a frozen function so that `math`, `min` and `max` work on arrays and intervals.

    The functions that it calls by a global name are copied likewise.
    """
    return _copy(function, {})


def _copy(function: FunctionType, done: dict[FunctionType, FunctionType]) -> FunctionType:
    if function in done:
        return done[function]
    space: dict[str, Any] = dict(function.__globals__)
    copy = FunctionType(
        function.__code__, space, function.__name__, function.__defaults__, function.__closure__
    )
    copy.__kwdefaults__ = function.__kwdefaults__
    done[function] = copy
    # Built-in names first: globals of the user hide them.
    for name, replacement in _BUILTINS.items():
        if space.get(name, getattr(builtins, name)) is getattr(builtins, name):
            space[name] = replacement
    for name in function.__code__.co_names:
        value = space.get(name)
        called = getattr(value, "py_func", value)
        if value is math:
            space[name] = SimpleNamespace(**{**vars(math), **_ARRAY_MATH})
        elif isinstance(value, BuiltinFunctionType) and value.__module__ == "math":
            space[name] = _ARRAY_MATH.get(value.__name__, value)
        elif isinstance(called, FunctionType) and not called.__module__.startswith("numpy"):
            space[name] = _copy(called, done)
    return copy


def _pairwise(ufunc: Any) -> Callable[..., Any]:
    def chosen(*values: Any) -> Any:
        if len(values) < 2:
            raise TypeError("not followed: an iterable")
        return reduce(ufunc, values)

    return chosen


def _as_numbers(x: Any = 0.0) -> Any:
    if isinstance(x, Interval):
        return x
    return np.asarray(x, float) if np.ndim(x) else float(x)


_BUILTINS = {"min": _pairwise(np.minimum), "max": _pairwise(np.maximum), "float": _as_numbers}
