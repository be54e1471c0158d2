"""Where each key of a TOML text stands, so that a message can name the line.

`tomllib` keeps no positions. The text has passed it when it comes here, so this scan need not check
anything: it only walks over keys and values.
"""

from __future__ import annotations

from typing import Any

Path = tuple[str | int, ...]

_BARE = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-")


def line_numbers(text: str) -> dict[Path, int]:
    """Find the line of every key, table and array element.

    Parameters
    ----------
    text : str
        Valid TOML.

    Returns
    -------
    dict
        Path, such as ``("processes", 1, "rate")``, to line number, counted from 1. A table stands
        where its header does.
    """
    return _Scanner(text.replace("\r\n", "\n")).scan()


class _Scanner:
    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.lines: dict[Path, int] = {}
        self.counts: dict[Path, int] = {}  # entries of each array of tables so far

    def scan(self) -> dict[Path, int]:
        prefix: Path = ()
        while self.skip():
            if self.text.startswith("[[", self.at):
                self.at += 2
                path = self.resolve(self.key())
                index = self.counts.get(path, 0)
                self.counts[path] = index + 1
                self.mark(path)
                prefix = (*path, index)
                self.mark(prefix)
                self.at += 2
            elif self.text[self.at] == "[":
                self.at += 1
                prefix = self.resolve(self.key())
                self.mark(prefix)
                self.at += 1
            else:
                self.pair(prefix)
        return self.lines

    def resolve(self, key: Path) -> Path:
        """Put the index of the newest entry behind every array of tables on the way."""
        path: Path = ()
        for n, part in enumerate(key):
            path = (*path, part)
            if path in self.counts and n + 1 < len(key):
                path = (*path, self.counts[path] - 1)
        return path

    def mark(self, path: Path) -> None:
        line = self.text.count("\n", 0, self.at) + 1
        for depth in range(1, len(path) + 1):
            self.lines.setdefault(path[:depth], line)

    def skip(self) -> bool:
        """Go to the next sign that is neither space nor comment; False at the end."""
        while self.at < len(self.text):
            sign = self.text[self.at]
            if sign == "#":
                end = self.text.find("\n", self.at)
                self.at = len(self.text) if end < 0 else end
            elif sign in " \t\r\n,":
                self.at += 1
            else:
                return True
        return False

    def key(self) -> Path:
        parts: list[str] = []
        while True:
            self.skip()
            if self.text[self.at] in "\"'":
                parts.append(self.string())
            else:
                start = self.at
                while self.text[self.at] in _BARE:
                    self.at += 1
                parts.append(self.text[start : self.at])
            self.skip()
            if self.text[self.at] != ".":
                return tuple(parts)
            self.at += 1

    def pair(self, prefix: Path) -> None:
        self.skip()
        start = self.at
        path = (*prefix, *self.key())
        end, self.at = self.at, start
        self.mark(path)
        self.at = end + 1  # behind the equals sign
        self.value(path)

    def value(self, path: Path) -> None:
        self.skip()
        sign = self.text[self.at]
        if sign in "\"'":
            self.string()
        elif sign in "[{":
            self.at += 1
            index = 0
            while self.skip() and self.text[self.at] not in "]}":
                if sign == "{":
                    self.pair(path)
                else:
                    self.mark((*path, index))
                    self.value((*path, index))
                    index += 1
            self.at += 1
        else:
            while self.at < len(self.text) and self.text[self.at] not in ",]}#\n":
                self.at += 1

    def string(self) -> str:
        """Go behind the string that begins here; its text as written (escapes are left)."""
        quote = self.text[self.at]
        mark = quote * 3 if self.text.startswith(quote * 3, self.at) else quote
        self.at += len(mark)
        start = self.at
        while not self.text.startswith(mark, self.at):
            self.at += 2 if quote == '"' and self.text[self.at] == "\\" else 1
        end = self.at
        self.at += len(mark)
        while len(mark) == 3 and self.text.startswith(quote, self.at):
            self.at += 1  # up to two quotes may stand before the closing three
        return self.text[start:end]


def lookup(lines: dict[Path, int], path: Path) -> int | None:
    """Line of `path`, or of the nearest table around it."""
    for depth in range(len(path), 0, -1):
        if path[:depth] in lines:
            return lines[path[:depth]]
    return None


def get(table: Any, path: Path) -> Any:
    """Value at `path` of nested tables and arrays."""
    for part in path:
        table = table[part]
    return table
