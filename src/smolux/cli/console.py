"""Where output goes: results to standard output, everything else to standard error."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

#: columns where there is no terminal to ask
_WIDTH = 100


def _console(stderr: bool) -> Console:
    import sys

    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() else _WIDTH
    return Console(file=stream, width=width, highlight=False, soft_wrap=False)


def out() -> Console:
    """Console for what was asked for."""
    return _console(False)


def err() -> Console:
    """Console for progress and remarks."""
    return _console(True)


def say(*lines: str) -> None:
    """Print remarks, without any formatting, to standard error."""
    import sys

    for line in lines:
        print(line, file=sys.stderr, flush=True)


def table(
    header: Sequence[str],
    rows: Iterable[Sequence[str]],
    title: str = "",
    left: Sequence[int] = (0,),
) -> None:
    """Print a table to standard output; numbers stand right, the columns `left` stand left."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    grid = Table(
        title=title or None, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD,
        pad_edge=False,
    )  # fmt: skip
    for n, name in enumerate(header):
        grid.add_column(name, justify="left" if n in left else "right", overflow="fold")
    for row in rows:
        grid.add_row(*map(Text, row))
    out().print(grid)


def number(value: float, digits: int = 4) -> str:
    """Write a number for a table; a dash for what is not known."""
    return f"{value:.{digits}g}" if value == value else "-"


def duration(seconds: float) -> str:
    """Write a stretch of wall time: ``"3.2 s"``, ``"4 min 10 s"``, ``"2 h 5 min"``."""
    if not seconds < 1e9:
        return "unknown"
    if seconds < 60:
        return f"{seconds:.2g} s" if seconds < 10 else f"{seconds:.0f} s"
    whole = round(seconds)
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    if whole < 48 * 3600:
        return f"{whole // 3600} h {whole % 3600 // 60} min"
    return f"{whole / 86400:.1f} days"


def amount(value: float, unit: str = "") -> str:
    """Write a large number with a prefix: ``"12.3 M"``."""
    for factor, prefix in ((1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k")):
        if value >= factor:
            return f"{value / factor:.3g} {prefix}{unit}"
    return f"{value:.3g} {unit}".rstrip()
