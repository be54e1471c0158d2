"""Case files: the TOML form of a model and of how it is computed.

Strict: every mistake is found at once, with the line it stands in and the nearest word that would
be right. Units are converted here and nowhere else.
"""

from __future__ import annotations

import os
import secrets
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath
from typing import Any

from smolux import units
from smolux.errors import InputError
from smolux.model import Model
from smolux.settings.solution import OBSERVED

from .lines import Path, line_numbers
from .model_tables import model_tables
from .physics import build, read_physics
from .reader import Problems, Table
from .settings import (
    Output,
    Parallel,
    Run,
    Solve,
    as_table,
    read_output,
    read_parallel,
    read_run,
    read_solve,
)
from .write import to_toml

__all__ = ["Case", "Output", "Parallel", "Run", "Solve", "load", "parse", "read_value"]

_TABLES = (
    "kernel",
    "processes",
    "initial",
    "attributes",
    "run",
    "solve",
    "parallel",
    "output",
    "spatial",
)


@dataclass(frozen=True)
class Case:
    """What a case file says.

    Attributes
    ----------
    model : Model
        The physics.
    run : Run or None
        How it is simulated, if it is.
    solve : Solve or None
        How it is solved deterministically, if it is.
    output : Output
        What is written beside the results.
    parallel : Parallel
        Where it is computed.
    title : str
        A line for figures and reports.
    si : bool
        Whether quantities are in SI units, or dimensionless.
    origin : str
        From which physical quantities the kernel was found.
    """

    model: Model
    run: Run | None = None
    solve: Solve | None = None
    output: Output = field(default_factory=Output)
    parallel: Parallel = field(default_factory=Parallel)
    title: str = ""
    si: bool = False
    origin: str = field(default="", compare=False)

    @property
    def times(self) -> tuple[float, ...]:
        """Output times."""
        settings = self.run or self.solve
        assert settings is not None
        return settings.times

    def solve_arguments(self) -> dict[str, Any]:
        """Return the arguments of `smolux.solve`: what is observed is that of a simulation."""
        assert self.solve is not None
        like = self.run or self.solve
        return self.solve.arguments() | {name: getattr(like, name) for name in OBSERVED}

    def with_seed(self) -> Case:
        """Return the case with a seed: its own, or a new one."""
        if self.run is None or self.run.seed is not None:
            return self
        return replace(self, run=replace(self.run, seed=secrets.randbits(48)))

    def to_toml(self) -> str:
        """Write the case with every default; `parse` reads it back to an equal one.

        Returns
        -------
        str
        """
        tables: dict[str, Any] = {"title": self.title} if self.title else {}
        tables |= model_tables(self.model, self.si)
        for name in ("run", "solve"):
            settings = getattr(self, name)
            if settings is not None:
                tables[name] = as_table(settings)
                if self.si:
                    times = tables[name]["times"]
                    tables[name]["times"] = [units.text(float(t), units.TIME) for t in times]
        if self.run and self.solve:
            for name in ("times", *OBSERVED):
                del tables["solve"][name]
        if self.parallel != Parallel():
            tables["parallel"] = as_table(self.parallel)
        tables["output"] = as_table(self.output)
        comment = f"# {self.origin}\n\n" if self.origin else ""
        return comment + to_toml(tables)


def load(path: str | os.PathLike[str], sets: Sequence[str] = ()) -> Case:
    """Read a case file.

    Parameters
    ----------
    path : path
        The file.
    sets : sequence of str
        Changes, each ``"key=value"`` as the option ``--set`` has it: ``"run.particles=1e5"``.

    Returns
    -------
    Case

    Raises
    ------
    InputError
        With every mistake, each with its line or option.
    """
    file = FilePath(path).expanduser()
    return parse(read_text(file), file.name, sets)


def read_text(path: str | os.PathLike[str]) -> str:
    """Return the text of a case file.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    file = FilePath(path).expanduser()
    try:
        return file.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(
            f"{os.fspath(path)}: there is no such file; make one with: smolux new {file.stem}"
        ) from None
    except IsADirectoryError:
        raise InputError(f"{os.fspath(path)}: is a folder, not a case file") from None
    except UnicodeDecodeError:
        raise InputError(f"{os.fspath(path)}: is not a text file in UTF-8") from None
    except OSError as error:
        raise InputError(f"{os.fspath(path)}: cannot be read: {error.strerror}") from None


def parse(text: str, source: str = "case", sets: Sequence[str] = ()) -> Case:
    """Read the text of a case file.

    Parameters
    ----------
    text : str
        TOML.
    source : str
        Name of the file, for messages.
    sets : sequence of str
        As for `load`.

    Returns
    -------
    Case

    Raises
    ------
    InputError
        With every mistake, each with its line or option.
    """
    return _read(*contents(text, source, sets))


def contents(text: str, source: str, sets: Sequence[str] = ()) -> tuple[dict[str, Any], Problems]:
    """Return the tables of a case file as changed by `sets`, and where mistakes are noted."""
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{source}: is not valid TOML: {_located(error)}") from None
    problems = Problems(source, line_numbers(text))
    for option in sets:
        _change(content, option, problems)
    return content, problems


def _located(error: tomllib.TOMLDecodeError) -> str:
    message = str(error)
    # a string is the usual thing to forget the quotes of
    return message + (
        '; a text needs quotes: name = "constant"' if message.startswith("Invalid value") else ""
    )


def _read(content: Mapping[str, Any], problems: Problems) -> Case:
    if "spatial" in content:
        problems.add(("spatial",), "a case in space can be run and checked, but not this")
        problems.raise_if_any()
    top = Table(content, (), problems)
    title = top.text("title", "")
    top.known += _TABLES
    top.finish()
    before = len(problems.messages)
    physics = read_physics(content, problems)
    physics_is_good = len(problems.messages) == before
    run = read_run(content["run"], problems) if "run" in content else None
    solve = None
    if "solve" in content:
        solve = read_solve(content["solve"], run, "run" in content, problems)
    if not ("run" in content or "solve" in content):
        problems.add(
            (), "a table [run] is missing, with times = [...]; or [solve] for the solver alone"
        )
    parallel = read_parallel(content.get("parallel", {}), run, problems)
    output = read_output(content.get("output", {}), problems)
    si = problems.check_units()
    model = build(physics, si, problems) if physics_is_good else None
    problems.raise_if_any()
    assert model is not None
    return Case(model, run, solve, output, parallel, title, si, physics.origin)


# --- changes from the command line ----------------------------------------------------------


def _change(content: dict[str, Any], option: str, problems: Problems) -> None:
    """Apply ``key=value`` to the tables."""
    label = f"--set {option}"
    key, sign, text = option.partition("=")
    parts = [p.strip() for p in key.split(".")]
    if not sign or not all(parts):
        problems.options[(label,)] = label
        problems.add((label,), "must be key=value, such as run.particles=1e5")
        return
    path: Path = ()
    table: Any = content  # a table or, below [[processes]], a list
    for part in parts[:-1]:
        step = _step(table, part)
        if step is None:
            problems.options[(*path, part)] = label
            names = [str(p.get("label", p.get("name"))) for p in table if isinstance(p, Mapping)]
            problems.add(
                (*path, part), f"there is no entry {part!r}; there are {', '.join(names) or 'none'}"
            )
            return
        path = (*path, step)
        if isinstance(table, dict) and not isinstance(table.get(part), (dict, list)):
            table[part] = {}
        table = table[step]
    last: Any = _step(table, parts[-1])
    if last is None or not isinstance(table, (dict, list)):
        problems.options[(*path, parts[-1])] = label
        problems.add((*path, parts[-1]), "there is nothing to set under that key")
        return
    problems.options[(*path, last)] = label
    if path == () and last in _TABLES:
        problems.add((last,), f"{last} is a table; set one of its keys: {last}.key={text}")
        return
    table[last] = read_value(text.strip())


def _step(table: Any, part: str) -> str | int | None:
    """Key of a table, or index of an array by number, or by the label or name of its entry."""
    if not isinstance(table, list):
        return part
    if part.isdecimal() and int(part) < len(table):
        return int(part)
    entries = [entry if isinstance(entry, Mapping) else {} for entry in table]
    called = [entry.get("label", entry.get("name")) for entry in entries]
    names = [entry.get("name") for entry in entries]
    return called.index(part) if part in called else names.index(part) if part in names else None


def read_value(text: str) -> Any:
    """Read a value as TOML, or as a text if it is none: quotes get lost in a shell."""
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except (tomllib.TOMLDecodeError, KeyError):
        return text
