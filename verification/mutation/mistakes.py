"""The mistakes: what is changed where, and which tests should see it.

One file of ``mistakes`` is an area of the code, with entries ::

    [[mistake]]
    what = "a source adds its particles twice"
    file = "core/loop.py"
    old = "count += 1"
    new = "count += 2"
    tests = ["tests/law/test_processes.py::test_source"]

`file` is in the package, `old` stands there once, `tests` are those of the fast suite that should
see the mistake, `slow` (optional) others that do if these do not.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).parent / "mistakes"
PACKAGE = "src/smolux"


@dataclass(frozen=True)
class Mistake:
    """One change of a file, and the tests that should see it.

    Attributes
    ----------
    what : str
        The mistake in words.
    file : str
        The file, within the package.
    old, new : str
        What stands there, once, and what is put in its place.
    tests, slow : tuple of str
        Tests as pytest takes them: of the fast suite, and slow ones.
    """

    what: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]
    slow: tuple[str, ...] = ()

    def made(self, source: str) -> str:
        """Return the text of the file with the mistake in it.

        Raises
        ------
        ValueError
            What is changed does not stand there just once, or nothing is changed.
        """
        found = source.count(self.old)
        if found != 1:
            raise ValueError(f"{self.file}: {self.old!r} stands there {found} times, not once")
        if self.old == self.new:
            raise ValueError(f"{self.file}: {self.old!r} is not changed")
        return source.replace(self.old, self.new)


def areas() -> tuple[str, ...]:
    """Names of the areas, each a file."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def read(area: str) -> tuple[Mistake, ...]:
    """Read the mistakes of an area."""
    entries = tomllib.loads((FOLDER / f"{area}.toml").read_text())["mistake"]
    lists = ("tests", "slow")
    return tuple(
        Mistake(**{key: tuple(v) if key in lists else v for key, v in entry.items()})
        for entry in entries
    )
