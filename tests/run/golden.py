"""Trajectories as they were: what a change of the code that only moves or renames must not change.

``python tests/run/golden.py`` writes them anew, after a change that is meant to change them; its
reason belongs into the commit. Kernels are sums and products, exactly rounded, so that a trajectory
is the same on every processor; times may differ in the last bits, as logarithms do.
"""

from __future__ import annotations

import json
import sys
import zlib
from pathlib import Path
from typing import Any

import numpy as np

if __name__ == "__main__":
    sys.path[:0] = [str(Path(__file__).parent.parent / name) for name in ("", "spatial")]

import runs
from flights import run, system

import smolux as sx
from shared import VARYING
from smolux.core.state import DOUBLINGS, EXTINCT, PENDING, TIME, TRIALS, VOLUME
from smolux.stochastic.plan import Plan
from smolux.stochastic.replicas import Group

PATH = Path(__file__).parent / "data" / "golden.json"
P = sx.processes

#: the kinds of processes, each with a loop that the tests of laws compile, too
PROCESSES: dict[str, list[sx.processes.Process]] = {
    "pairs": [P.Aggregation(), P.Shattering(0.1)],
    "pairs in time": [P.Aggregation(), P.Shattering(VARYING)],
    "evaporating": [P.Aggregation(), P.Shattering(0.05), P.Evaporation(0.2)],
    "everything": [
        P.Source({1: 0.2, 3: 0.04}, varying="1 + 0.5 * sin(3 * t)"),
        P.Removal([0.05, 0.05], above=300),
        P.Fragmentation(sx.kernels.formula("f + g*(i + j)", f=0.02, g=0.0)),
        P.Evaporation([0.1, 0.1], varying="1 + sin(5 * t)"),
        P.Aggregation(),
        P.CollisionalFragmentation(0.1, 2.5, largest=12),
    ],
}
WEIGHTINGS: dict[str, Any] = {
    "number": "number",
    "mass": "mass-flow",
    "power": sx.weighting.WeightFunction(0.5),
    "falling": sx.weighting.WeightFunction(-0.3),
}
#: what is written without a loop of its own is compiled by the fast tests
_FAST = {
    *((m, "pairs", "number") for m in runs.METHODS),
    *((m, "pairs in time", "number") for m in ("size-class", "acceptance-rejection")),
    ("acceptance-rejection", "evaporating", "mass"),
    *(("acceptance-rejection", "everything", w) for w in ("number", "power", "falling")),
}
_CASES = {
    *((m, "everything", "number") for m in runs.METHODS),
    *((m, "evaporating", "mass") for m in runs.METHODS),
    *_FAST,
}
#: method, processes, weighting, policy, and whether the fast tests have the loop
CASES = {
    " | ".join((*case, policy)): (*case, policy, case in _FAST)
    for case in sorted(_CASES)
    for policy in ("doubling", "fixed-volume")
}
FLIGHTS = {
    f"{method} | {dimension}": (method, dimension)
    for method in ("windowed", "cells", "all-pairs")
    for dimension in ((2, 3) if method != "all-pairs" else (2,))
}


def plan(method: str, processes: str, weighting: str, policy: str) -> Plan:
    """Make the plan of a case: few particles at the start, so that stores grow."""
    like = runs.model()
    model = sx.Model(like.kernel, PROCESSES[processes], like.initial)
    return runs.plan(
        model, [0.5, 2.0], method, weighting=WEIGHTINGS[weighting], population=policy, particles=60
    )


def checksum(*arrays: Any) -> str:
    """Return a short name of what arrays hold."""
    held = b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)
    return f"{zlib.crc32(held):08x}"


def trajectories(case: str, budget: int = 1000) -> list[dict[str, Any]]:
    """Run a case; return for each replica what no change may change, and the times."""
    method, processes, weighting, policy, _ = CASES[case]
    group = Group.start(plan(method, processes, weighting, policy), 0, 3)
    while not group.done:
        group._call(group.codes, budget)
        group._serve()
    state, found = group.state, []
    for r in range(3):
        sizes = group.plan.method.population(group.work, state, r)
        found.append(
            {
                "population": checksum(*(np.asarray(a, np.int64) for a in sizes)),
                "counted": checksum(group.tally.counts[r], group.tally.processes[r]),
                "events": state.events[r].tolist(),
                "candidates": int(state.count[r, TRIALS]),
                "attempts": state.attempts[r].tolist(),
                "doublings": int(state.count[r, DOUBLINGS]),
                "random": checksum(state.rng[r]),
                "times": [
                    None if np.isnan(x) else float(x)
                    for x in state.clock[r, [TIME, PENDING, VOLUME, EXTINCT]]
                ],
            }
        )
    return found


def flights(case: str) -> list[dict[str, Any]]:
    """Run discs in three kinds of boxes; return who met whom, and when."""
    method, dimension = FLIGHTS[case]
    found = []
    for number in (1, 4, 7):
        log = run(system(number, dimension, most=24), method).log
        met = log.merges
        found.append(
            {
                "merges": checksum(*(a[met].astype(np.int64) for a in (log.first, log.second))),
                "reflections": int((~met).sum()),
                "times": [float(t) for t in log.time[met][[0, len(log.time[met]) // 2, -1]]],
            }
        )
    return found


def moments(processes: str) -> list[float]:
    """Moments by the rate equations."""
    model = plan("inverse", processes, "number", "doubling").model
    ds = sx.solve(model, [0.5, 2.0], tolerance=1e-8, orders=(0, 1, 2))
    return [float(x) for x in ds["moment"].values.ravel()]


def written(found: dict[str, dict[str, Any]]) -> str:
    """Write what was found with a line for each case, so that a difference shows which changed."""
    blocks = []
    for kind, cases in found.items():
        lines = (f"  {json.dumps(case)}: {json.dumps(each)}" for case, each in cases.items())
        blocks.append(f" {json.dumps(kind)}: {{\n" + ",\n".join(lines) + "\n }")
    return "{\n" + ",\n".join(blocks) + "\n}\n"


def main() -> None:
    """Write all anew."""
    PATH.parent.mkdir(exist_ok=True)
    found = {
        "trajectories": {case: trajectories(case) for case in CASES},
        "flights": {case: flights(case) for case in FLIGHTS},
        "moments": {name: moments(name) for name in PROCESSES},
    }
    PATH.write_text(written(found))


if __name__ == "__main__":
    main()
