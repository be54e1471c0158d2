"""The folder of a run, and what stands in it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import smolux
from smolux.case import Case, load
from smolux.case.spatial import SpatialCase
from smolux.errors import InputError
from smolux.runtime.files import replacing


@dataclass(frozen=True)
class RunDirectory:
    """The folder of a run."""

    path: Path

    @property
    def case(self) -> Path:
        """The resolved case: every default, the seed."""
        return self.path / "case.toml"

    @property
    def results(self) -> Path:
        """The results."""
        return self.path / "results.nc"

    @property
    def solution(self) -> Path:
        """The solution of the rate equations, where a simulation has the name of the results."""
        return self.path / "solution.nc"

    @property
    def checkpoint(self) -> Path:
        """From where an unfinished run goes on."""
        return self.path / "checkpoint.npz"

    @property
    def report(self) -> Path:
        """The report."""
        return self.path / "report.html"

    def figure(self, name: str) -> Path:
        """Return the file of a figure."""
        return self.path / f"{name}.png"

    def load(self) -> Case:
        """Read the resolved case."""
        return load(self.case)


def create(case: Case | SpatialCase, source: Path, wanted: Path | None) -> RunDirectory:
    """Make the folder of a new run and put the resolved case there.

    Parameters
    ----------
    case : Case or SpatialCase
        With its seed.
    source : Path
        The case file, after which the folder is named if none is wanted.
    wanted : Path, optional
        The folder.

    Raises
    ------
    InputError
        If it holds something already: results are never overwritten.
    """
    path = _free(source) if wanted is None else wanted.expanduser()
    if path.exists() and not path.is_dir():
        raise InputError(f"-o {path}: is a file; name a new folder")
    if (path / "case.toml").exists():
        raise InputError(
            f"-o {path}: holds a run already; go on with it by: smolux run {path}, or name another "
            "folder"
        )
    if path.is_dir() and any(path.iterdir()):
        raise InputError(f"-o {path}: is not empty; name a new folder")
    path.mkdir(parents=True, exist_ok=True)
    directory = RunDirectory(path)
    with replacing(directory.case) as temporary:
        temporary.write_text(case.to_toml(), encoding="utf-8")
    return directory


def _free(source: Path) -> Path:
    """Return a folder beside nothing: the name of the case, numbered if that is taken."""
    path, number = Path(source.stem), 2
    while path.exists():
        path, number = Path(f"{source.stem}-{number}"), number + 1
    return path


def find(path: Path) -> RunDirectory:
    """Return the folder of a run that was begun.

    Raises
    ------
    InputError
        If it is none.
    """
    directory = RunDirectory(path)
    if not directory.case.is_file():
        raise InputError(f"{path}: is not the folder of a run, there is no case.toml in it")
    return directory


def find_results(path: Path) -> Path:
    """Return the results file of a folder, or the file itself.

    Raises
    ------
    InputError
        If there is none.
    """
    if not path.is_dir():
        return path
    file = path / "results.nc"
    if not file.is_file():
        hint = f"; run it with: smolux run {path}" if (path / "case.toml").is_file() else ""
        raise InputError(f"{path}: there is no results.nc in it{hint}")
    return file


def load_results(path: Path) -> Any:
    """Read a result.

    Raises
    ------
    InputError
        If there is none, or it cannot be read.
    """
    return smolux.results.load(find_results(path))


def load_solution(path: Path) -> Any:
    """Read the solution of the rate equations beside a result; None if there is none."""
    file = find_results(path).with_name("solution.nc")
    return smolux.results.load(file) if file.is_file() and file != path else None
