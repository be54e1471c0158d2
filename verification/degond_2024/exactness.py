"""The event-driven methods against each other, and the accuracy of contacts."""

from __future__ import annotations

from typing import Any

import numpy as np

import smolux.spatial as sp
from verification.outcome import Check, Item, Outcome, Table, at_most

from .common import Finished, compiled, run

_SIZES, _LARGE = (100, 400, 900), 400
_FRACTIONS = (0.1, 0.3)
METHODS = (sp.AllPairs(), sp.Cells(), sp.Windowed())


def compute(quick: bool) -> dict[str, Any]:
    compiled(METHODS)
    rows = []
    for fraction in _FRACTIONS:
        for discs in _SIZES[: 2 if quick else 3]:
            system = sp.lattice(discs, fraction, seed=7)
            first, *others = (run(m, system) for m in METHODS)
            rows.append({
                "fraction": fraction, "discs": discs, "merges": len(first.merges),
                "same": [_same(first, x) for x in others],
                "apart": max(_apart(first, x) for x in others),
                "time": max(abs(x.trace.time / first.trace.time - 1) for x in others),
            })  # fmt: skip
    side = 100 if quick else _LARGE
    return {"rows": rows, "large": _contacts(run(METHODS[-1], sp.lattice(side**2, 0.1, seed=7)))}


def _same(a: Finished, b: Finished) -> int:
    """Count merges of the same discs at the same place of the list."""
    pairs = [np.stack([x.trace.log.first, x.trace.log.second], 1)[x.trace.log.merges]
             for x in (a, b)]  # fmt: skip
    n = min(map(len, pairs))
    return int((np.sort(pairs[0][:n], 1) == np.sort(pairs[1][:n], 1)).all(1).sum())


def _apart(a: Finished, b: Finished) -> float:
    """Largest difference of the final positions, in diameters."""
    widest = float(np.abs(a.trace.position - b.trace.position).max())
    return widest / (2 * float(a.system.radius[0]))


def _contacts(done: Finished) -> dict[str, Any]:
    """Gaps of all links and the deepest overlap at the end, in diameters."""
    log, x = done.trace.log, done.trace.position
    wide = 2 * float(done.system.radius[0])
    i, j = log.first[log.merges], log.second[log.merges]
    gaps = np.linalg.norm(x[j] - x[i], axis=1) / wide - 1
    near = done.snapshot.tree().query_pairs(wide * (1 + 1e-6), output_type="ndarray")
    apart = np.linalg.norm(x[near[:, 1]] - x[near[:, 0]], axis=1) / wide - 1
    return {
        "discs": len(x), "links": len(gaps), "gap": float(np.abs(gaps).max()),
        "overlap": float(max(-apart.min(), 0.0)), "seconds": done.seconds,
    }  # fmt: skip


def present(data: dict[str, Any]) -> Outcome:
    rows, large = data["rows"], data["large"]
    different = sum(r["merges"] - s for r in rows for s in r["same"])
    merges = sum(2 * r["merges"] for r in rows)
    checks = [
        Check(
            "merges of cells and windowed that differ from those of all-pairs",
            f"{different} of {merges}", "0", "0 (order and pairs)", different == 0,
        ),
        at_most(
            "final positions, largest difference in diameters", max(r["apart"] for r in rows),
            1e-9, "(rounding)",
        ),
        Check(
            f"links of N = {large['discs']}", str(large["links"]), "N − 1", "exact",
            large["links"] == large["discs"] - 1,
        ),
        at_most("their largest gap or overlap, in diameters", large["gap"], 1e-10, "(rounding)"),
        at_most(
            "deepest overlap of any two discs, in diameters", large["overlap"], 1e-9, "(rounding)"
        ),
    ]  # fmt: skip
    table = [
        [f"{r['fraction']:g}", str(r["discs"]), str(r["merges"]), *map(str, r["same"]),
         f"{r['apart']:.1e}", f"{r['time']:.1e}"]
        for r in rows
    ]  # fmt: skip
    head = [
        "φ", "N", "merges", "same by cells", "same by windowed", "positions, diameters",
        "final time, relative",
    ]  # fmt: skip
    return Outcome(
        ran="The three event-driven methods on the same lattices, and one run of "
        f"{large['discs']} discs by the windowed method.",
        checks=checks,
        tables=[Table("All pairs (appendix A) against cells and windowed", head, table)],
        notes=["N = 1600 is compared in the item on run time; a hundred systems of all kinds in "
               "the tests."],
    )  # fmt: skip


ITEM = Item("exactness", "Appendix A: three event-driven methods, one list of merges",
            compute, present)  # fmt: skip
