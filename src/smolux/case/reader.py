"""Reading tables strictly: every mistake is noted with its place, none stops the reading."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from smolux import units
from smolux.errors import InputError, Problem, did_you_mean

from .lines import Path, lookup


def show(value: Any) -> str:
    """Return a value as it would stand in a case file, cut if it is long."""
    if isinstance(value, bool):
        text = "true" if value else "false"
    elif isinstance(value, str):
        text = f'"{value}"'
    else:
        text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def dotted(path: Path) -> str:
    """Write ``("processes", 1, "rate")`` as ``processes[1].rate``."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


@dataclass
class Problems:
    """The mistakes found so far, and what tells where they are.

    Attributes
    ----------
    source : str
        Name of the file.
    lines : dict
        Path to line, see `lines.line_numbers`.
    options : dict
        Path to the text of the command-line option that set it, in place of a line.
    """

    source: str
    lines: dict[Path, int] = field(default_factory=dict)
    options: dict[Path, str] = field(default_factory=dict)
    messages: list[tuple[int, str]] = field(default_factory=list)
    #: the values that could carry a unit: path, and whether one was written
    measured: list[tuple[Path, bool]] = field(default_factory=list)

    def add(self, path: Path, message: str) -> None:
        """Note a mistake at `path`."""
        for depth in range(len(path), 0, -1):
            if path[:depth] in self.options:
                self.messages.append((1 << 60, f"{self.options[path[:depth]]}: {message}"))
                return
        line = lookup(self.lines, path)
        where = f"{self.source}, line {line}" if line else self.source
        self.messages.append((line or 0, f"{where}: {message}"))

    def add_error(self, path: Path, error: InputError) -> None:
        """Note every mistake of `error`, at the argument that it is about if it knows that."""
        for message in error.problems:
            self.add((*path, *getattr(message, "path", ())), message)

    def check_units(self) -> bool:
        """Note a mix of quantities with and without units; True if all have units."""
        with_unit = sorted({dotted(p) for p, unit in self.measured if unit})
        without = [p for p, unit in self.measured if not unit]
        if with_unit and without:
            self.add(
                without[0],
                "a case is dimensionless throughout or has units throughout; "
                f"with a unit: {', '.join(with_unit)}; "
                f"without: {', '.join(sorted({dotted(p) for p in without}))}",
            )
        return bool(with_unit)

    def raise_if_any(self) -> None:
        """Raise an `InputError` with everything noted, in the order of the file."""
        if self.messages:
            unique = dict.fromkeys(sorted(self.messages, key=lambda m: m[0]))
            raise InputError([text for _, text in unique])


_MISSING = object()


class Table:
    """One table of the case: its keys are taken one by one, what is left over is a mistake."""

    def __init__(self, content: Any, path: Path, problems: Problems) -> None:
        self.path, self.problems = path, problems
        self.known: list[str] = []
        self.content: dict[str, Any] = {}
        if isinstance(content, Mapping):
            self.content = dict(content)
        else:
            problems.add(
                path, f"{dotted(path)} = {show(content)}: must be a table [{dotted(path)}]"
            )

    def __contains__(self, key: str) -> bool:
        return key in self.content

    def bad(self, key: str, message: str) -> None:
        """Note that the value of `key` is a mistake."""
        value = show(self.content.get(key))
        self.problems.add((*self.path, key), f"{self._label(key)} = {value}: {message}")

    def wrong(self, problem: str, hint: str = "") -> None:
        """Note what is wrong with an argument: at its key, in the words of the file."""
        if not isinstance(problem, Problem):
            self.problems.add(self.path, problem)
            return
        key = str(problem.path[-1])
        if key in self:
            self.bad(key, problem.cure + hint)
        else:
            self.problems.add((*self.path, key), f"{self._label(key)}: {problem.cure}{hint}")

    def _label(self, key: str) -> str:
        return dotted((*self.path, key))

    def take(self, key: str, default: Any = None) -> Any:
        """Return the value of `key` as it stands, or the default."""
        self.known.append(key)
        return self.content.get(key, default)

    def require(self, key: str, message: str) -> None:
        """Note that `key` is missing."""
        self.problems.add(self.path, f"{self._label(key)} is missing: {message}")

    def number(
        self, key: str, default: Any, low: float = -math.inf, above: float | None = None
    ) -> Any:
        """Return a finite number of at least `low`, or more than `above`."""
        value = self.take(key, _MISSING)
        if value is _MISSING:
            return default
        wanted = f"must be a number of at least {low:g}" if low > -math.inf else "must be a number"
        if above is not None:
            wanted = f"must be a number above {above:g}"
        good = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not (good and math.isfinite(value) and value >= low) or (
            above is not None and not value > above
        ):
            self.bad(key, wanted)
            return default
        return float(value)

    def integer(self, key: str, default: Any, low: int, high: float = math.inf) -> Any:
        """Return a whole number; ``1e5`` is one too."""
        value = self.take(key, _MISSING)
        if value is _MISSING:
            return default
        good = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not (good and math.isfinite(value) and value == int(value) and low <= value <= high):
            limits = f"from {low} to {high}" if math.isfinite(high) else f"of at least {low}"
            self.bad(key, f"must be a whole number {limits}")
            return default
        return int(value)

    def flag(self, key: str, default: bool) -> bool:
        """Return true or false."""
        value = self.take(key, default)
        if not isinstance(value, bool):
            self.bad(key, "must be true or false, without quotes")
            return default
        return value

    def text(self, key: str, default: str) -> str:
        """Return a text."""
        value = self.take(key, default)
        if not isinstance(value, str):
            self.bad(key, "must be a text in quotes")
            return default
        return value

    def choice(self, key: str, default: Any, choices: Sequence[str]) -> Any:
        """Return one of the given words."""
        value = self.take(key, _MISSING)
        if value is _MISSING:
            return default
        if not isinstance(value, str):
            self.bad(key, "must be one of " + ", ".join(f'"{c}"' for c in choices))
            return default
        if value not in choices:
            self.bad(key, "is unknown" + did_you_mean(value, choices))
            return default
        return value

    def parsed(self, where: Path, value: str, dimension: units.Dimension) -> float | None:
        """Return a text with a unit as an SI number; None, with a note, if it is none."""
        try:
            return units.parse(value, dimension)
        except InputError as error:
            path = (*self.path, *where)
            self.problems.add(path, f"{dotted(path)} = {show(value)}: {error}")
            return None

    def convert(self, where: Path, value: Any, dimension: units.Dimension) -> Any:
        """Turn a quantity into an SI number and note whether it had a unit; None if it is wrong."""
        path = (*self.path, *where)
        if isinstance(value, str):
            self.problems.measured.append((path, True))
            return self.parsed(where, value, dimension)
        if not isinstance(value, (int, float)) or isinstance(value, bool):
            self.problems.add(
                path,
                f"{dotted(path)} = {show(value)}: must be a number, or {dimension.words} "
                f"with its unit such as {show(dimension.example)}",
            )
            return None
        self.problems.measured.append((path, False))
        if not math.isfinite(value):
            self.problems.add(path, f"{dotted(path)} = {value!r}: must be finite")
            return None
        return float(value)

    def quantity(self, key: str, default: Any, dimension: units.Dimension) -> Any:
        """Return a number or a quantity with its unit, in SI."""
        value = self.take(key, _MISSING)
        if value is _MISSING:
            return default
        converted = self.convert((key,), value, dimension)
        return default if converted is None else converted

    def anything(self, key: str) -> Any:
        """Return a quantity of any dimension in SI base units; one without a unit is a mistake."""
        value = self.take(key)
        try:
            return units.parse_any(value)
        except InputError as error:
            self.bad(key, str(error))
            return None

    def finish(self) -> None:
        """Note every key that nobody took."""
        choices = list(dict.fromkeys(self.known))
        for key in self.content:
            if key not in choices:
                self.problems.add(
                    (*self.path, key),
                    f"{self._label(key)}: no such key{did_you_mean(key, choices)}",
                )
