"""Where output goes: results to standard output, everything else to standard error."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

#: columns where there is no terminal to ask
_WIDTH = 100


def console(stderr: bool = False, terminal: bool | None = None) -> Console:
    """Return a console on standard output or standard error.

    Parameters
    ----------
    stderr : bool
        For progress and remarks; standard output is for what was asked for.
    terminal : bool, optional
        Whether it is a terminal; found out if left out.
    """
    import sys

    from rich.console import Console

    class Patient(Console):
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError  # which is no error of ours, see `guard`

    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() else _WIDTH
    return Patient(file=stream, width=width, highlight=False, force_terminal=terminal)


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
        grid.add_column(
            name, justify="left" if n in left else "right", overflow="fold", no_wrap=n == 0
        )
    for row in rows:
        grid.add_row(*map(Text, row))
    console().print(grid)


def number(value: float, digits: int = 4) -> str:
    """Write a number for a table; a dash for what is not known."""
    return f"{value:.{digits}g}" if value == value else "-"


def duration(seconds: float) -> str:
    """Write a stretch of wall time: ``"3.2 s"``, ``"4 min 10 s"``, ``"2 h 5 min"``."""
    if not seconds < 1e9:
        return "unknown"
    whole = round(seconds)
    if whole < 60:
        return f"{seconds:.2g} s" if seconds < 9.95 else f"{whole} s"
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
