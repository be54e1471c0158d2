"""Tables of the reference that are written from what the code declares."""

from __future__ import annotations

import re
from typing import Any

from smolux import observables

#: mark in a page -> what stands there
TABLES = {"variables": observables.reference}


def fill(app: Any, page: str, source: list[str]) -> None:
    """Put tables in the places of their marks, whenever a page is read."""
    source[0] = filled(source[0])


def filled(text: str) -> str:
    """Return the text of a page with tables in the places of their marks."""
    return re.sub(r"<!-- (\w+): written by .*? -->", lambda mark: TABLES[mark[1]](), text)


def setup(app: Any) -> dict[str, bool]:
    """Fill pages before they are parsed."""
    app.connect("source-read", fill)
    return {"parallel_read_safe": True}
