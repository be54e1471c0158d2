"""Kinds of arguments: what a value must be, how it is kept, and how it is written."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, asdict, field, fields
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from smolux.checks import is_number, numbers, orders_of_moments, whole
from smolux.errors import InputError, Problem, did_you_mean

#: larger limits are named when they are what is wrong
_SHOWN = 1_000_000


class Kind:
    """What an argument may be."""

    def check(self, key: str, value: Any) -> Any:
        """Return a value as it is kept.

        Raises
        ------
        InputError
            With a `Problem` of this key.
        """
        raise NotImplementedError

    def plain(self, value: Any) -> Any:
        """Return a value as numbers, texts, lists and tables."""
        return list(value) if isinstance(value, tuple) else value

    def from_plain(self, key: str, value: Any) -> Any:
        """Return the value of which `plain` has made this."""
        return value


class Whole(Kind):
    """A whole number from `least` to `most`; None, if it is `optional`."""

    def __init__(self, least: int, most: float = math.inf, *, optional: bool = False) -> None:
        self.least, self.most, self.optional = least, most, optional

    def check(self, key: str, value: Any) -> Any:
        if value is None and self.optional:
            return None
        number = whole(value)
        if number is not None and self.least <= number <= self.most:
            return number
        limits = f"of at least {self.least}"
        if self.most <= _SHOWN or (number is not None and number > self.most):
            limits = f"from {self.least} to {self.most}"
        raise InputError([Problem(key, f"must be a whole number {limits}", value)])


class Number(Kind):
    """A number for which a condition holds, which the message says in `words`."""

    def __init__(
        self, holds: Callable[[float], bool], words: str, *, optional: bool = False
    ) -> None:
        self.holds, self.words, self.optional = holds, words, optional

    def check(self, key: str, value: Any) -> Any:
        if value is None and self.optional:
            return None
        if is_number(value) and self.holds(value):
            return float(value)
        raise InputError([Problem(key, f"must be {self.words}", value)])


class Seconds(Number):
    """A stretch of wall time."""

    def __init__(self, *, optional: bool = False) -> None:
        super().__init__(
            lambda s: 0 < s < math.inf, "a positive number of seconds", optional=optional
        )


class Choice(Kind):
    """One of some words."""

    def __init__(self, words: Iterable[str]) -> None:
        self.words = list(words)

    def check(self, key: str, value: Any) -> Any:
        if isinstance(value, str) and value in self.words:
            return value
        raise InputError([Problem(key, f"is unknown{did_you_mean(str(value), self.words)}", value)])


class Text(Kind):
    """A word, of which others know what it may be."""

    def check(self, key: str, value: Any) -> Any:
        return value


class Registered(Kind):
    """The name of an entry of a registry, ``"auto"``, or an object with settings of its own.

    It is kept as it was given. The registry is looked at when it is needed, and its entries when
    one of them is: methods load Numba.

    Parameters
    ----------
    module, registry, names, base : str
        Where the registry is, and what it, the names of its entries and the class of these are
        called there.
    """

    def __init__(self, module: str, registry: str, names: str, base: str) -> None:
        self.module, self.registry, self.names, self.base = module, registry, names, base

    def entries(self) -> tuple[Any, ...]:
        """Return the entries of the registry."""
        return tuple(getattr(import_module(self.module), self.registry))

    def _entries(self) -> dict[str, Any]:
        return {e.name: e for e in self.entries()}

    @property
    def words(self) -> list[str]:
        """Names that may be given."""
        return [*getattr(import_module(self.module), self.names), "auto"]

    def check(self, key: str, value: Any) -> Any:
        if isinstance(value, str) and (value == "auto" or value in self.words):
            return value
        if isinstance(value, getattr(import_module(self.module), self.base)):
            return value
        raise InputError([Problem(key, f"is unknown{did_you_mean(str(value), self.words)}", value)])

    def made(self, value: Any) -> Any:
        """Return the object that a name stands for."""
        return self._entries()[value]() if isinstance(value, str) else value

    def plain(self, value: Any) -> Any:
        """See `Kind`; an object as its name and settings."""
        if isinstance(value, str):
            return value
        settings = asdict(value)
        if any(callable(each) for each in settings.values()):
            raise InputError(
                "the weight is a Python function, which no checkpoint holds; write it as a formula "
                "in l, or as a power of the size"
            )
        return {"name": value.name, **settings}

    def from_plain(self, key: str, value: Any) -> Any:
        if isinstance(value, str):
            return value
        settings = dict(value)
        name, entries = settings.pop("name"), self._entries()
        if name not in entries:
            cure = f"is unknown{did_you_mean(str(name), list(entries))}"
            raise InputError([Problem(key, cure, name)])
        return entries[name](**settings)


class Flag(Kind):
    """True or False."""

    def check(self, key: str, value: Any) -> Any:
        if isinstance(value, (bool, np.bool_)):
            return bool(value)
        raise InputError([Problem(key, "must be true or false", value)])


class _Sequence(Kind):
    """Numbers kept as a tuple."""

    def from_plain(self, key: str, value: Any) -> Any:
        return tuple(value)


class Orders(_Sequence):
    """Orders of moments."""

    def check(self, key: str, value: Any) -> Any:
        return tuple(orders_of_moments(value, key).tolist())

    def plain(self, value: Any) -> Any:
        """See `Kind`; whole numbers as such."""
        return [int(order) if order == int(order) else order for order in value]


class Times(_Sequence):
    """Output times, ascending, the last one above zero; or the `start` alone, where it is enough.

    None, if they are `optional`.
    """

    def __init__(self, *, optional: bool = False, start: bool = False) -> None:
        self.optional, self.start = optional, start

    def check(self, key: str, value: Any) -> Any:
        if value is None and self.optional:
            return None
        output = np.atleast_1d(numbers(key, value))
        if output.ndim != 1 or not output.size:
            wrong = Problem(key, "must be a list of at least one number", value)
        elif not (np.isfinite(output).all() and output[0] >= 0 and (self.start or output[-1] > 0)):
            end = "" if self.start else ", and end above zero"
            wrong = Problem(key, f"must be finite numbers, zero or more{end}", value)
        elif (np.diff(output) <= 0).any():
            k = int(np.argmax(np.diff(output) <= 0))
            wrong = Problem(key, f"must ascend, but {output[k + 1]:g} follows {output[k]:g}")
        else:
            return tuple(output.tolist())
        raise InputError([wrong])


class Called(Kind):
    """A function, or None; `words` say what it must be."""

    def __init__(self, words: str) -> None:
        self.words = words

    def check(self, key: str, value: Any) -> Any:
        if value is None or callable(value):
            return value
        raise InputError([Problem(key, f"must be {self.words}", value)])


class File(Kind):
    """A file that can be written, or None."""

    def check(self, key: str, value: Any) -> Any:
        if value is None:
            return None
        if not isinstance(value, (str, os.PathLike)):
            raise InputError([Problem(key, "must be the path of a file", value)])
        path = Path(value).expanduser()
        if path.is_dir():
            raise InputError([Problem(key, "is a folder; name a file in it", value)])
        if not path.absolute().parent.is_dir():
            cure = f"there is no folder {str(path.parent)!r}; create it first"
            raise InputError([Problem(key, cure, value)])
        return path


def setting(kind: Kind, default: Any = MISSING, *, kw_only: bool = True) -> Any:
    """Declare a field of settings."""
    return field(default=default, metadata={"kind": kind}, kw_only=kw_only)


def declared(table: Any, name: str) -> Any:
    """Declare a field as it is declared in other settings."""
    known = next(f for f in fields(table) if f.name == name)
    return setting(known.metadata["kind"], known.default)


def kinds(table: Any) -> dict[str, Kind]:
    """Return the kinds of the fields of settings, by name."""
    return {f.name: f.metadata["kind"] for f in fields(table)}


def checked(table: Any, given: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Check arguments one by one.

    Parameters
    ----------
    table : type
        Settings.
    given : mapping
        Their arguments; what is left out has its default.

    Returns
    -------
    good : dict
        Those that are right, as they are kept.
    problems : list of Problem
        Of the others.
    """
    good, problems = {}, []
    for f in fields(table):
        if f.name not in given and f.default is not MISSING:
            good[f.name] = f.default
            continue
        try:
            good[f.name] = f.metadata["kind"].check(f.name, given[f.name])
        except InputError as error:
            problems += error.problems
    return good, problems


def plain(table: Any, settings: Any) -> dict[str, Any]:
    """Return settings as plain data: the fields of a table."""
    return {name: kind.plain(getattr(settings, name)) for name, kind in kinds(table).items()}


def from_plain(table: Any, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of settings that `plain` has written."""
    found = kinds(table)
    return {name: found[name].from_plain(name, value) for name, value in given.items()}
