"""Running the items of a verification, storing their data, writing pages."""

from __future__ import annotations

import datetime
import json
import os
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

import smolux
from smolux.plotting.style import save

from .outcome import Item, Outcome, Table

ROOT = Path(__file__).resolve().parent.parent
#: figures for the documentation stay small
_LARGEST = 150_000


@dataclass(frozen=True)
class Suite:
    """The verification against one paper.

    Attributes
    ----------
    name, title, paper : str
    items : sequence of Item
    remarks : sequence of str
        What a reader must know before comparing, for the summary page.
    total : callable, optional
        ``total(values)``: a sentence on the data of all items, by their names, for that page.
    """

    name: str
    title: str
    paper: str
    items: Sequence[Item]
    remarks: Sequence[str] = ()
    total: Callable[[dict[str, Any]], str] | None = None


def default_output(quick: bool) -> Path:
    """Folder of the pages: those of the documentation, or a scratch folder for quick runs."""
    return ROOT / "build" / "verification" if quick else ROOT / "docs" / "verification"


def run_suite(
    suite: Suite,
    names: Sequence[str] = (),
    *,
    quick: bool = False,
    redraw: bool = False,
    output: Path | None = None,
) -> bool:
    """Run items, write their pages and the summary page; return whether every check passed.

    Parameters
    ----------
    suite : Suite
    names : sequence of str
        The items to run; all if empty.
    quick : bool
        A smoke test of less than two minutes.
    redraw : bool
        Take the stored data instead of computing.
    output : path, optional
    """
    unknown = set(names) - {item.name for item in suite.items}
    if unknown:
        known = ", ".join(item.name for item in suite.items)
        raise SystemExit(f"unknown item {', '.join(sorted(unknown))}; choose from {known}")
    folder = (output or default_output(quick)) / suite.name
    folder.mkdir(parents=True, exist_ok=True)
    passed = True
    for item in suite.items:
        if names and item.name not in names:
            continue
        stored = folder / "data" / f"{item.name}.json"
        data = json.loads(stored.read_text()) if redraw else _compute(item, quick, stored)
        outcome = item.present(data["values"])
        _write_page(suite, item, outcome, data, folder)
        failed = [c for c in outcome.checks if not c.passed]
        passed &= not failed
        print(
            f"{item.name}: {len(outcome.checks) - len(failed)} of {len(outcome.checks)} checks "
            f"passed, {data['seconds']:.0f} s of processor time",
            flush=True,
        )
        for check in failed:
            print(f"  not passed: {check.what}: {check.measured}, target {check.target}")
    _write_summary(suite, folder)
    return passed


def _compute(item: Item, quick: bool, stored: Path) -> dict[str, Any]:
    begun, cpu = time.perf_counter(), _processor_seconds()
    values = item.compute(quick)
    data = {
        "date": datetime.date.today().isoformat(),
        "quick": quick,
        "seconds": round(_processor_seconds() - cpu, 1),
        "wall_seconds": round(time.perf_counter() - begun, 1),
        "versions": versions(),
        "values": plain(values),
    }
    stored.parent.mkdir(exist_ok=True)
    stored.write_text(json.dumps(data, separators=(",", ":")) + "\n")
    return json.loads(stored.read_text())


def _processor_seconds() -> float:
    """Return the processor time of this process and of those that it started and that ended."""
    return sum(os.times()[:4])


def versions() -> dict[str, str]:
    """Versions of what computed the numbers."""
    import numba
    import scipy

    return {
        "smolux": smolux.__version__,
        "Python": platform.python_version(),
        "NumPy": np.__version__,
        "SciPy": scipy.__version__,
        "Numba": numba.__version__,
    }


def plain(value: Any) -> Any:
    """Turn arrays and keys into what JSON holds; seven digits are enough for a figure."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, (float, np.floating)):
        return float(f"{value:.7g}") if np.isfinite(value) else None
    return value.item() if isinstance(value, np.generic) else value


def _draw(figure: Figure, path: Path) -> None:
    figure.draw_without_rendering()  # ticks settle, so that the layout leaves room for them
    for dpi in (200, 150, 110):
        save(figure, path, dpi=dpi)
        if path.stat().st_size < _LARGEST:
            return


def _write_page(
    suite: Suite, item: Item, outcome: Outcome, data: dict[str, Any], folder: Path
) -> None:
    lines = [f"# {item.title}", "", f"From {suite.paper}", "", outcome.ran, ""]
    if outcome.figure is not None:
        with mpl.rc_context({"savefig.facecolor": "white"}):
            _draw(outcome.figure, folder / f"{item.name}.png")
        lines += [f"![{item.title}]({item.name}.png)", "", f"*{outcome.caption}*", ""]
    for table in outcome.tables:
        lines += [table.markdown(), ""]
    if outcome.checks:
        rows = [
            ["passed" if c.passed else "**not passed**", c.what, c.measured, c.target, c.limit]
            for c in outcome.checks
        ]
        head = ["result", "check", "measured", "target", "allowed"]
        lines += [Table("Checks", head, rows).markdown(), ""]
    lines += [f"- {note}" for note in outcome.notes]
    lines += ["", f"{_circumstances(data)} Run again with", "", "```"]
    lines += [f"python verification/run.py {suite.name} --item {item.name}", "```"]
    (folder / f"{item.name}.md").write_text("\n".join(lines) + "\n")


def _circumstances(data: dict[str, Any]) -> str:
    used = ", ".join(f"{name} {version}" for name, version in data["versions"].items())
    kind = "Quick run (a smoke test, not a verification)" if data["quick"] else "Computed"
    return f"{kind} on {data['date']} in {data['seconds']:.0f} s of processor time: {used}."


def _write_summary(suite: Suite, folder: Path) -> None:
    rows, failed, tables = [], [], []
    values: dict[str, Any] = {}
    for item in suite.items:
        stored = folder / "data" / f"{item.name}.json"
        if not stored.exists():
            rows.append([item.title, "not run", "", ""])
            continue
        data = json.loads(stored.read_text())
        values[item.name] = data["values"]
        outcome = item.present(data["values"])
        good = sum(c.passed for c in outcome.checks)
        link = f"[{item.title}]({suite.name}/{item.name}.md)"
        rows.append(
            [link, f"{good} of {len(outcome.checks)}", f"{data['seconds']:.0f} s", outcome.ran]
        )
        failed += [[item.title, c.what, c.measured, c.target, c.limit]
                   for c in outcome.checks if not c.passed]  # fmt: skip
        tables += [f"## {item.title}", ""]
        if outcome.figure is not None:
            tables += [f"![{item.title}]({suite.name}/{item.name}.png)", ""]
        tables += [text for table in outcome.tables for text in (table.markdown(), "")]
    lines = [f"# {suite.title}", "", suite.paper, ""]
    lines += [f"- {remark}" for remark in suite.remarks]
    head = ["item", "checks passed", "processor time", "what was run"]
    lines += ["", Table("Overview", head, rows).markdown(), ""]
    if suite.total is not None:
        lines += [suite.total(values), ""]
    if failed:
        head = ["item", "check", "measured", "target", "allowed"]
        lines += [Table("Checks not passed", head, failed).markdown(), ""]
    else:
        lines += ["Every check that was run passed.", ""]
    lines += ["```", f"python verification/run.py {suite.name}", "```", "", *tables]
    (folder.parent / f"{suite.name}.md").write_text("\n".join(lines).rstrip() + "\n")
