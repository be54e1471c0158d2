"""Writing TOML: only what a case file needs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from smolux.units import shortest

_BARE = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-")
_ESCAPES = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t", "\r": "\\r"}


def to_toml(tables: Mapping[str, Any]) -> str:
    """Write tables of plain values; a list of tables becomes an array of tables.

    Parameters
    ----------
    tables : mapping
        Texts, numbers, flags, lists of them, inline tables inside of tables.

    Returns
    -------
    str
        Read back by `tomllib` to equal values, floats to the last bit.
    """
    top = [f"{_key(k)} = {value(v)}" for k, v in tables.items() if not _is_table(v)]
    blocks = ["\n".join(top)] if top else []
    for name, content in tables.items():
        if isinstance(content, Mapping):
            blocks.append(_block(f"[{_key(name)}]", content))
        elif _is_table(content):
            blocks += [_block(f"[[{_key(name)}]]", entry) for entry in content]
    return "\n\n".join(blocks) + "\n"


def _is_table(content: Any) -> bool:
    return isinstance(content, Mapping) or (
        isinstance(content, list) and bool(content) and all(isinstance(c, Mapping) for c in content)
    )


def _block(header: str, content: Mapping[str, Any]) -> str:
    return "\n".join([header, *(f"{_key(k)} = {value(v)}" for k, v in content.items())])


def _key(key: str) -> str:
    return key if key and _BARE.issuperset(key) else _string(key)


def _string(text: str) -> str:
    signs = (
        _ESCAPES.get(c) or (c if c >= " " and c != "\x7f" else f"\\u{ord(c):04x}") for c in text
    )
    return '"' + "".join(signs) + '"'


def value(content: Any) -> str:
    """Write one value."""
    if isinstance(content, bool):
        return "true" if content else "false"
    if isinstance(content, str):
        return _string(content)
    if isinstance(content, (int, float)):
        return repr(content) if isinstance(content, int) else shortest(content)
    if isinstance(content, Mapping):
        return "{ " + ", ".join(f"{_key(k)} = {value(v)}" for k, v in content.items()) + " }"
    parts = [value(v) for v in content]
    line = "[" + ", ".join(parts) + "]"
    if len(line) <= 88:
        return line
    rows = [""]
    for part in parts:
        if rows[-1] and len(rows[-1]) + len(part) > 88:
            rows.append("")
        rows[-1] += f" {part},"
    return "[\n" + "\n".join(f" {row}" for row in rows) + "\n]"
