"""What is swept over: keys of the case file, and the values of each."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from smolux.case import read_value
from smolux.errors import InputError

#: points that a sweep may have; more are a slip in a range
MOST_POINTS = 100_000
_EXAMPLE = "such as kernel.a=0.5:1:11, run.particles=1e3:1e5:3:log or processes.shattering.rate=0,1"


@dataclass(frozen=True)
class Axis:
    """A key of the case file and its values, in the order given."""

    key: str
    values: tuple[Any, ...]


def read_axes(over: Sequence[str] | Mapping[str, Any]) -> tuple[Axis, ...]:
    """Read what is swept over.

    Parameters
    ----------
    over : sequence of str, or mapping
        ``"key=values"`` each, or keys with their values: a list, or a text as behind the equals
        sign. Texts are lists ``"1,2,5"``, ranges ``"start:stop:count"``, both ends included, or
        ``"start:stop:count:log"``, even in the logarithm.

    Raises
    ------
    InputError
        With every mistake.
    """
    problems: list[str] = []
    axes: list[Axis] = []
    if isinstance(over, str):
        over = [over]
    pairs: Iterable[tuple[Any, Any]] = (
        over.items() if isinstance(over, Mapping) else (_pair(o, problems) for o in over)
    )
    for key, given in pairs:
        if not key:
            continue
        where = f"--over {key}={given}"
        values = _texts(where, given, problems) if isinstance(given, str) else _listed(given)
        if key in [axis.key for axis in axes]:
            problems.append(f"{where}: {key} is swept over twice; give all values at once")
        elif not values and not any(p.startswith(where) for p in problems):
            problems.append(f"{where}: there is no value; give some, {_EXAMPLE}")
        elif len({_canonical(v) for v in values}) < len(values):
            problems.append(f"{where}: a value stands there twice")
        axes.append(Axis(key, tuple(values)))
    if not axes and not problems:
        problems.append(f"over: nothing to sweep over; give a key and values, {_EXAMPLE}")
    points = math.prod(len(axis.values) for axis in axes)
    if points > MOST_POINTS:
        problems.append(f"over: {points} points, more than {MOST_POINTS}; take fewer values")
    if problems:
        raise InputError(problems)
    return tuple(axes)


def _pair(option: Any, problems: list[str]) -> tuple[str, str]:
    key, sign, text = str(option).partition("=")
    if not sign or not key.strip():
        problems.append(f"--over {option}: must be key=values, {_EXAMPLE}")
        return "", ""
    return key.strip(), text.strip()


def _canonical(value: Any) -> str:
    return repr(float(value)) if _is_number(value) else f"text {value}"


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _listed(given: Any) -> list[Any]:
    """Return values of Python or NumPy as plain ones."""
    values = given if isinstance(given, Iterable) else [given]
    return [v.item() if isinstance(v, np.generic) else v for v in values]


def _texts(where: str, text: str, problems: list[str]) -> list[Any]:
    parts = [p.strip() for p in text.split(":")]
    if len(parts) > 1 and all(_is_number(read_value(p)) for p in parts[:2]):
        return _range(where, parts, problems)
    return [read_value(part) for part in _split(text) if part]


def _range(where: str, parts: list[str], problems: list[str]) -> list[Any]:
    start, stop = (read_value(p) for p in parts[:2])
    count = read_value(parts[2]) if len(parts) > 2 else None
    spacing = parts[3] if len(parts) > 3 else "linear"
    if spacing not in ("linear", "log") or len(parts) > 4 or not isinstance(count, int):
        problems.append(
            f"{where}: a range is start:stop:count, or start:stop:count:log, such as 0.5:1:11"
        )
    elif not 2 <= count <= MOST_POINTS or start == stop or not math.isfinite(stop - start):
        problems.append(f"{where}: a range needs two different ends and 2 values or more")
    elif spacing == "log" and not (start > 0 and stop > 0):
        problems.append(f"{where}: both ends of a logarithmic range must be above zero")
    else:
        space = np.geomspace if spacing == "log" else np.linspace
        # twelve digits are enough to see the spacing
        values = [float(f"{v:.12g}") for v in space(float(start), float(stop), count)]
        values[0], values[-1] = float(start), float(stop)
        return values
    return []


def _split(text: str) -> Iterator[str]:
    """Split at the commas that stand in no quotes and no brackets."""
    depth, quote, part = 0, "", ""
    for sign in text:
        if quote:
            quote = "" if sign == quote else quote
        elif sign in "\"'":
            quote = sign
        elif sign in "([{":
            depth += 1
        elif sign in ")]}":
            depth -= 1
        elif sign == "," and depth == 0:
            yield part.strip()
            part = ""
            continue
        part += sign
    yield part.strip()
