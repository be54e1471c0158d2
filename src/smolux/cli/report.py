"""The report of a run: one page that opens anywhere, with everything in it."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

import smolux
from smolux.case import Case
from smolux.runtime.files import replacing

from .commands import show
from .console import amount, duration

_STYLE = """
:root { color-scheme: light dark; --ink: #1d2329; --dim: #5b6670; --line: #d8dde2; --paper: #fff;
  --shade: #f4f6f8; --warn: #8a5300; --warnbg: #fff6e5; }
@media (prefers-color-scheme: dark) { :root { --ink: #e4e8ec; --dim: #9aa5b0; --line: #39424b;
  --paper: #15191d; --shade: #1e242a; --warn: #f0c070; --warnbg: #33270f; } }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper);
  max-width: 62rem; margin: 2rem auto; padding: 0 1.2rem; }
h1 { font-size: 1.6rem; margin: 0 0 .2rem; } h2 { font-size: 1.15rem; margin: 2.2rem 0 .6rem; }
p.dim, figcaption { color: var(--dim); } p { margin: .3rem 0; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .9rem; }
th, td { padding: .2rem .8rem .2rem 0; text-align: right; border-bottom: 1px solid var(--line); }
th { color: var(--dim); font-weight: 600; } td:first-child, th:first-child { text-align: left; }
table.facts td { text-align: left; vertical-align: top; overflow-wrap: anywhere; }
table.facts td:first-child { color: var(--dim); white-space: nowrap; }
.wide { overflow-x: auto; } .tables { display: flex; flex-wrap: wrap; gap: 1.5rem 3rem; }
caption { text-align: left; font-weight: 600; padding-bottom: .2rem; }
figure { margin: 0; flex: 1 1 24rem; max-width: 34rem; } .figures { display: flex; flex-wrap: wrap;
  gap: 1.5rem; } img { width: 100%; background: #fff; border-radius: 4px; }
pre { background: var(--shade); padding: .8rem 1rem; overflow-x: auto; font-size: .82rem;
  border-radius: 4px; }
.warning { color: var(--warn); background: var(--warnbg); padding: .5rem .9rem; border-radius: 4px;
  margin: .4rem 0; }
"""


_CAPTIONS = {
    "clusters": "Clusters per unit volume, and deviations in standard deviations.",
    "moments": "Moments of the size distribution.",
    "size-distribution": "Number densities over cluster size.",
    "oscillations": "Second moment over time, and the cycle in the plane with the number density.",
    "scaling": "Size distributions scaled by the mean size; one curve if growth is self-similar.",
}


def write(
    file: Path, case: Case, ds: Any, solution: Any = None, figures: Sequence[Path] = ()
) -> None:
    """Write the report of a run, whole or not at all.

    Parameters
    ----------
    file : Path
    case : Case
        Resolved.
    ds : xarray.Dataset
        The result.
    solution : xarray.Dataset, optional
        Of the rate equations.
    figures : sequence of Path
        PNG files, which are put into the page.
    """
    with replacing(file) as temporary:
        temporary.write_text(page(case, ds, solution, figures), encoding="utf-8")


def page(case: Case, ds: Any, solution: Any = None, figures: Sequence[Path] = ()) -> str:
    """Return the report as HTML; it loads nothing from anywhere."""
    title = case.title or f"{case.model.kernel.name} kernel"
    found = list(dict.fromkeys([*smolux.results.warnings(ds), *_of(solution)]))
    parts = [
        f"<h1>{escape(title)}</h1>",
        f'<p class="dim">{escape(_subtitle(ds))}</p>',
        *(f'<p class="warning">{escape(w)}</p>' for w in found),
        "<h2>Results</h2>",
        *_summary(ds),
        *_agreement(ds, solution),
        "<h2>Figures</h2>" if figures else "",
        '<div class="figures">' if figures else "",
        *map(_figure, figures),
        "</div>" if figures else "",
        "<h2>Case</h2>",
        f"<pre>{escape(case.to_toml().strip())}</pre>",
        "<h2>Provenance</h2>",
        _facts(_provenance(ds)),
    ]
    body = "\n".join(part for part in parts if part)
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        f"{body}\n</body>\n</html>\n"
    )


def _of(ds: Any) -> list[str]:
    return [] if ds is None else smolux.results.warnings(ds)


def _subtitle(ds: Any) -> str:
    attributes = ds.attrs
    words = [f"smolux {smolux.__version__}", str(attributes.get("method", ""))]
    if "initial_particles" in attributes:
        words += [
            f"{attributes['initial_particles']} particles",
            f"{ds.sizes['replica']} replicas",
            f"seed {attributes['seed']}",
        ]
    return " · ".join(word for word in words if word)


def _table(caption: str, header: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>\n" for row in rows
    )
    return (
        f'<div class="wide"><table><caption>{escape(caption)}</caption>\n'
        f"<thead><tr>{head}</tr></thead>\n<tbody>\n{body}</tbody></table></div>"
    )


def _summary(ds: Any) -> list[str]:
    summary = show.chosen(ds, show.MOST)
    tables = [_table(title, rows[0], rows[1:]) for title, rows in smolux.analysis.tables(summary)]
    notes = (
        str(summary.attrs["mass"]),
        show.shown(ds, show.MOST),
        str(summary.attrs.get("notes", "")),
    )
    words = escape(" ".join(note for note in notes if note))
    return ['<div class="tables">', *tables, "</div>", f'<p class="dim">{words}</p>']


def _agreement(ds: Any, solution: Any) -> list[str]:
    """Say whether simulation and rate equations agree."""
    if solution is None:
        return []
    return ["<h2>Rate equations</h2>", f"<p>{escape(agreement(ds, solution))}</p>"]


def agreement(ds: Any, solution: Any) -> str:
    """Say in a sentence whether a result and a solution of the rate equations agree."""
    found = smolux.analysis.compare(ds, solution).attrs
    if not found["entries"]:
        return "Nothing could be tested against the solution of the rate equations."
    words = {1: "agrees with", 0: "differs from"}.get(found["agree"], "cannot be told from")
    note = f" {found['notes']}" if found["agree"] < 0 else ""
    return (
        f"The simulation {words} the solution of the rate equations: joint test of "
        f"{found['entries']} numbers p = {found['p_value']:.3g}; the largest deviation is "
        f"{found['largest_sigmas']:.2f} standard deviations ({found['where']}).{note}"
    )


def _figure(file: Path) -> str:
    data = base64.b64encode(file.read_bytes()).decode("ascii")
    caption = escape(_CAPTIONS.get(file.stem, file.stem))
    return (
        f'<figure><img alt="{caption}" src="data:image/png;base64,{data}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def _provenance(ds: Any) -> dict[str, str]:
    attributes = ds.attrs
    facts = {key: str(attributes[key]) for key in ("created", "platform") if key in attributes}
    versions = json.loads(attributes.get("versions", "{}"))
    facts["versions"] = ", ".join(f"{name} {number}" for name, number in versions.items())
    if "events" in attributes:
        facts["collisions"] = amount(float(attributes["events"]))
    for key in ("wall", "compile", "compute"):
        if f"{key}_seconds" in attributes:
            facts[f"{key} time"] = duration(float(attributes[f"{key}_seconds"]))
    facts["to repeat"] = "smolux run case.toml (the case above, with its seed)"
    return facts


def _facts(facts: dict[str, str]) -> str:
    rows = "".join(
        f"<tr><td>{escape(key)}</td><td>{escape(text)}</td></tr>\n" for key, text in facts.items()
    )
    return f'<table class="facts"><tbody>\n{rows}</tbody></table>'
