"""What smolux raises and warns with."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from typing import Any

_EXHAUSTED = (
    "memory: there is no more: use fewer particles, replicas, sizes or output times, or let this "
    "process have more memory"
)


class Problem(str):
    """What is wrong with one argument: a text that knows which, for those who know its place.

    Parameters
    ----------
    key : str
        The argument.
    cure : str
        What it must be.
    *value : object
        What was given, if that is to be shown.

    Attributes
    ----------
    path : tuple of str or int
        The keys that lead to the argument, the outermost first; it is the last.
    cure : str
    """

    path: tuple[str | int, ...]
    cure: str

    def __new__(cls, key: str, cure: str, *value: Any) -> Problem:
        """Put the text together."""
        shown = "".join(f" = {v!r}" for v in value)
        return cls.at(f"{key}{shown}: {cure}", key, cure=cure)

    @classmethod
    def at(cls, text: str, *path: str | int, cure: str = "") -> Problem:
        """Say what is wrong in words that name the argument in their own way."""
        self = super().__new__(cls, text)
        self.path, self.cure = path, cure or text
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (str(self), self.path, self.cure)


def _restored(text: str, path: tuple[str | int, ...], cure: str) -> Problem:
    return Problem.at(text, *path, cure=cure)


class InputError(ValueError):
    """A mistake in what the user wrote: names the argument, its value and the cure.

    Parameters
    ----------
    problems : str or sequence of str
        One message for each mistake; all that could be found at once.

    Attributes
    ----------
    problems : list of str
    dataset : xarray.Dataset or None
        What was computed, if a run had begun; output times not reached are NaN.
    checkpoint : pathlib.Path or None
        The file that holds the run where it ended, if one was asked for and written.
    """

    dataset: object = None
    checkpoint: object = None

    def __init__(self, problems: str | Sequence[str]) -> None:
        self.problems = [problems] if isinstance(problems, str) else list(problems)
        super().__init__("\n".join(self.problems))

    def __reduce__(self) -> tuple[type[InputError], tuple[list[str]]]:
        return type(self), (self.problems,)


@contextmanager
def about(*path: str | int) -> Iterator[None]:
    """Give mistakes found within their place: what leads to the argument from outside."""
    try:
        yield
    except InputError as error:
        error.problems = [
            Problem.at(p, *path, *getattr(p, "path", ()), cure=getattr(p, "cure", ""))
            for p in error.problems
        ]
        raise


class OutOfMemoryError(InputError):
    """The arrays of a run would outgrow the memory that there is: it stopped before they did.

    With more memory it goes on from its checkpoint.
    """

    def __init__(self, problems: str | Sequence[str] = _EXHAUSTED) -> None:
        super().__init__(problems)


class Interrupted(KeyboardInterrupt):
    """A run stopped on request before its end.

    Attributes
    ----------
    dataset : xarray.Dataset or None
        What was computed; output times not reached are NaN.
    checkpoint : pathlib.Path or None
        The file from which the run goes on, bit for bit; None if it could not be written.
    """

    def __init__(self, message: str, dataset: object = None, checkpoint: object = None) -> None:
        super().__init__(message)
        self.dataset = dataset
        self.checkpoint = checkpoint


class SolverError(RuntimeError):
    """The rate equations could not be solved any further.

    Attributes
    ----------
    time : float
        How far the solution came.
    dataset : xarray.Dataset or None
        What was computed; output times not reached are NaN.
    """

    dataset: object = None

    def __init__(self, message: str, time: float) -> None:
        super().__init__(message)
        self.time = time


class WorkerError(RuntimeError):
    """The processes that compute die, again and again: no memory, a crash, a node that is gone.

    Attributes
    ----------
    dataset : xarray.Dataset or None
        What the others have computed; replicas of which nothing is known are NaN.
    """

    dataset: object = None


class SmoluxWarning(UserWarning):
    """Something the user should know of a result: also stored in its attributes."""


def warn(texts: Sequence[str], level: int) -> None:
    """Issue warnings at the line of the user, who called the function `level` calls above this."""
    for text in texts:
        warnings.warn(text, SmoluxWarning, stacklevel=level + 2)


@contextmanager
def quiet() -> Iterator[None]:
    """Issue no warnings of smolux: they stand in the results, and are told with them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SmoluxWarning)
        yield


def did_you_mean(word: str, choices: Sequence[str]) -> str:
    """Return ``"; did you mean 'x'?"`` for the nearest choice, else the list of choices."""
    near = get_close_matches(word, choices, n=1)
    if near:
        return f"; did you mean {near[0]!r}?"
    return "; choose from " + ", ".join(repr(c) for c in choices)
