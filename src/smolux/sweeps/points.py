"""The points of a sweep: the case of each, and the folder in which their results are kept."""

from __future__ import annotations

import hashlib
import itertools
import json
import os
import secrets
import tomllib
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from smolux.case import Case, parse
from smolux.case.write import to_toml, value
from smolux.errors import InputError
from smolux.runtime.files import replacing

from .axes import Axis

#: messages that are told of a sweep in which many points are wrong
_MOST_MESSAGES = 10


@dataclass(frozen=True)
class Point:
    """One point: its number, counted from 0 with the last key fastest, its values, its case."""

    number: int
    values: dict[str, Any]
    case: Case

    @property
    def label(self) -> str:
        """The keys and values."""
        return ", ".join(f"{k} = {v:g}" if isinstance(v, float) else f"{k} = {v}"
                         for k, v in self.values.items())  # fmt: skip


@dataclass(frozen=True)
class Sweep:
    """A case file, changes of it, and what is swept over.

    Attributes
    ----------
    text, source : str
        The case file and its name.
    sets : tuple of str
        Changes of it that hold for all points, as ``--set`` has them.
    axes : tuple of Axis
    seed : int
        From which the seeds of the points are derived.
    """

    text: str
    source: str
    sets: tuple[str, ...]
    axes: tuple[Axis, ...]
    seed: int

    def points(self) -> list[Point]:
        """Return all points.

        Raises
        ------
        InputError
            With the mistakes in their cases.
        """
        keys = [axis.key for axis in self.axes]
        found: list[Point] = []
        problems: dict[str, None] = {}
        for number, values in enumerate(itertools.product(*(a.values for a in self.axes))):
            place = dict(zip(keys, values, strict=True))
            try:
                found.append(Point(number, place, self._case(place)))
            except InputError as error:
                problems |= dict.fromkeys(_over(p, keys) for p in error.problems)
        if problems:
            more = len(problems) - _MOST_MESSAGES
            told = list(problems)[:_MOST_MESSAGES]
            raise InputError([*told, f"... and {more} more"] if more > 0 else told)
        return found

    def _case(self, place: dict[str, Any]) -> Case:
        changes = [f"{key}={value(v)}" for key, v in place.items()]
        case = parse(self.text, self.source, [*self.sets, *changes])
        if case.run is not None and "run.seed" not in place:
            changes.append(f"run.seed={derived(self.seed, place)}")
            case = parse(self.text, self.source, [*self.sets, *changes])
        if case.run is not None and case.run.time_limit is not None:
            raise InputError(
                f"{self.source}: run.time_limit holds for a single run; take it out: a sweep that "
                "is stopped goes on where it was"
            )
        return case


def _over(problem: str, keys: Sequence[str]) -> str:
    """Name the option that was really given."""
    for key in keys:
        problem = problem.replace(f"--set {key}=", f"--over {key}=")
    return problem


def derived(seed: int, place: dict[str, Any]) -> int:
    """Return the seed of a point: its values decide, not the others in the grid."""
    text = json.dumps({k: float(v) if isinstance(v, int) else v for k, v in place.items()},
                      sort_keys=True, default=str)  # fmt: skip
    words = np.frombuffer(hashlib.sha256(text.encode()).digest(), np.uint32)
    state = np.random.SeedSequence([seed, *map(int, words)]).generate_state(1, np.uint64)
    return int(state[0] >> np.uint64(16))


def make_sweep(
    case: Case | str | os.PathLike[str], axes: tuple[Axis, ...], sets: Sequence[str]
) -> tuple[Sweep, bool]:
    """Make a sweep of a case or a case file; its seed is that of the case, or drawn.

    Returns
    -------
    Sweep
    bool
        Whether the seed was drawn.

    Raises
    ------
    InputError
        If the file cannot be read, or a key is changed and swept over.
    """
    keys = {axis.key for axis in axes}
    twice = [item for item in sets if item.partition("=")[0].strip() in keys]
    if twice:
        raise InputError([f"set {item}: this key is swept over; leave out one" for item in twice])
    if isinstance(case, Case):
        text, source = case.to_toml(), "case"
    else:
        file = Path(case).expanduser()
        try:
            text, source = file.read_text(encoding="utf-8"), file.name
        except (OSError, UnicodeDecodeError) as error:
            reason = getattr(error, "strerror", None) or "it is no text in UTF-8"
            raise InputError(f"{os.fspath(case)}: cannot be read: {reason}") from None
    first = {axis.key: axis.values[0] for axis in axes}
    run = None
    with suppress(InputError):  # which all points together tell better
        run = parse(text, source, [*sets, *(f"{k}={value(v)}" for k, v in first.items())]).run
    drawn = run is None or run.seed is None
    seed = secrets.randbits(48) if run is None or run.seed is None else run.seed
    return Sweep(text, source, tuple(sets), axes, seed), drawn


# --- the folder ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Folder:
    """The folder of a sweep."""

    path: Path

    @property
    def results(self) -> Path:
        """All points in one file."""
        return self.path / "results.nc"

    @property
    def _sweep(self) -> Path:
        return self.path / "sweep.toml"

    @property
    def _text(self) -> Path:
        return self.path / "base.toml"

    def point(self, number: int) -> Path:
        """Return the file of a point."""
        return self.path / "points" / f"{number:05d}.nc"

    def holds_sweep(self) -> bool:
        """Whether a sweep was begun in it."""
        return self._sweep.is_file()

    def load(self) -> Sweep:
        """Read the sweep that was begun.

        Raises
        ------
        InputError
            If there is none, or it cannot be read.
        """
        try:
            given = tomllib.loads(self._sweep.read_text(encoding="utf-8"))
            text = self._text.read_text(encoding="utf-8")
            axes = tuple(Axis(k, tuple(v)) for k, v in given["over"].items())
            return Sweep(text, given["source"], tuple(given["sets"]), axes, int(given["seed"]))
        except FileNotFoundError:
            raise InputError(
                f"{self.path}: is not the folder of a sweep, there is no sweep.toml in it"
            ) from None
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"{self._sweep}: cannot be read: {error}") from None

    def begin(self, sweep: Sweep, drawn: bool) -> Sweep:
        """Write down what is to be done, or find it written down; return it.

        Raises
        ------
        InputError
            If the folder holds something else.
        """
        if self.path.exists() and not self.path.is_dir():
            raise InputError(f"{self.path}: is a file; name a new folder")
        if self.holds_sweep():
            begun = self.load()
            same = begun == (sweep if not drawn else _with_seed(sweep, begun.seed))
            if not same:
                raise InputError(
                    f"{self.path}: holds another sweep; name a new folder, or go on with that one "
                    f"by: smolux sweep {self.path}"
                )
            self._clean()
            return begun
        if self.path.is_dir() and any(p.name != "base.toml" for p in self.path.iterdir()):
            raise InputError(f"{self.path}: is not empty; name a new folder")
        (self.path).mkdir(parents=True, exist_ok=True)
        tables = {
            "source": sweep.source,
            "seed": str(sweep.seed),
            "sets": list(sweep.sets),
            "over": {axis.key: list(axis.values) for axis in sweep.axes},
        }
        for file, text in ((self._text, sweep.text), (self._sweep, to_toml(tables))):
            with replacing(file) as temporary:
                temporary.write_text(text, encoding="utf-8")
        self._clean()
        return sweep

    def _clean(self) -> None:
        """Remove what a killed process left half written."""
        points = self.path / "points"
        points.mkdir(exist_ok=True)
        for file in (*points.glob(".*"), *self.path.glob(".*")):
            if file.is_file():
                file.unlink()


def _with_seed(sweep: Sweep, seed: int) -> Sweep:
    return Sweep(sweep.text, sweep.source, sweep.sets, sweep.axes, seed)
