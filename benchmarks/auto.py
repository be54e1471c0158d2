"""The choice of `method="auto"` against the best method, over a set of cases.

What counts is what a user of `simulate` waits for once everything is compiled: the start of a
group, its event loop, and what it asks Python for. A group has the replicas that one of two threads
gets of the usual eight.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

import smolux as sx
from benchmarks.common import loop_seconds, model, table, write_section
from smolux.core.state import TRIALS
from smolux.stochastic.make_plan import make_plan
from smolux.stochastic.plan import Plan
from smolux.stochastic.replicas import Group

CLASSES, AR, LOW_RANK = "size-class", "acceptance-rejection", "low-rank"
METHODS = (CLASSES, AR, LOW_RANK)
#: kernel, a short and a long time
KERNELS: tuple[tuple[Any, float, float], ...] = (
    (sx.kernels.Constant(), 1.0, 1000.0),
    (sx.kernels.Additive(), 0.5, 3.0),
    (sx.kernels.Multiplicative(), 0.3, 0.9),
    (sx.kernels.Brownian(), 1.0, 300.0),
    (sx.kernels.Ballistic(), 0.5, 30.0),
    (sx.kernels.GeneralizedBrownian(a=0.95), 1.0, 60.0),
)
SIZES = (1000, 10_000, 100_000, 1_000_000)
SHATTERING = (0.0, 0.01)
#: a method this many times slower than the size-class method is stopped
_HOPELESS = 3.0
_GOAL = 1.3


@dataclass(frozen=True)
class Case:
    """What is simulated."""

    kernel: Any
    shattering: float
    end: float
    particles: int

    def plan(self, method: str) -> Plan:
        """Plan eight replicas, as `simulate` does."""
        physics = model(self.kernel, self.shattering)
        return make_plan(
            physics,
            [self.end],
            method=method,
            particles=self.particles,
            replicas=8,
            seed=1,
            orders=(0, 1, 2, 3),
            sizes=1024,
        )


class Found(NamedTuple):
    """Seconds of each method, infinite for those that were stopped; what was chosen, and why."""

    case: Case
    seconds: dict[str, float]
    events: int
    candidates: float
    chosen: str
    reason: str

    @property
    def loss(self) -> float:
        """Seconds of the choice over those of the best."""
        return self.seconds[self.chosen] / min(self.seconds.values())


def cases(particles: int) -> Iterator[Case]:
    """All combinations for a number of particles."""
    for kernel, *ends in KERNELS:
        for shattering in SHATTERING:
            for end in ends:
                yield Case(kernel, shattering, end, particles)


def seconds_of(plan: Plan, most: float) -> tuple[float, Group]:
    """Processor seconds of a group, from its start to its end; infinite if it is above `most`."""
    start = time.thread_time()
    group = Group.start(plan, *plan.groups(2)[0])
    spent = time.thread_time() - start
    group.compile()
    while not group.done:
        spent += loop_seconds(group, lambda: True)  # a slice
        if spent > most:
            return np.inf, group
    return spent, group


def measure(case: Case, repeats: int) -> Found:
    """Measure all methods, interleaved, and ask for the choice."""
    plans = {method: case.plan(method) for method in METHODS}
    for plan in plans.values():
        seconds_of(plan, 0.0)  # compiled, and bounds that are proved once
    runs: dict[str, list[float]] = {method: [] for method in METHODS}
    least, events, candidates = np.inf, 0, np.nan
    for _ in range(repeats):
        for method in METHODS:
            spent, group = seconds_of(plans[method], _HOPELESS * least)
            runs[method].append(spent)
            if method == CLASSES:
                least, events = min(least, spent), group.events
            elif method == AR and spent < np.inf:
                candidates = float(group.state.count[:, TRIALS].sum()) / group.events
    chosen = case.plan("auto")
    seconds = {method: float(np.median(found)) for method, found in runs.items()}
    return Found(case, seconds, events, candidates, chosen.method.name, chosen.reason)


def choosing(repeats: int = 15) -> str:
    """Measure how long the choice takes."""
    case = Case(sx.kernels.Ballistic(), 0.01, 10.0, 100_000)
    seconds = []
    for _ in range(repeats):
        start = time.thread_time()
        case.plan("auto")
        between = time.thread_time()
        case.plan(AR)
        seconds.append(2.0 * between - start - time.thread_time())
    return f"The choice itself takes {1e3 * float(np.median(seconds)):.1f} ms."


def describe(found: list[Found]) -> list[str]:
    """Make a table of all cases, and a summary."""
    rows = []
    for one in found:
        rows.append(
            [
                one.case.kernel.name,
                f"{one.case.shattering:g}",
                f"{one.case.end:g}",
                *(_ns(one.seconds[m], one.events) for m in METHODS),
                min(one.seconds, key=one.seconds.__getitem__),
                one.chosen,
                _factor(one.loss) if one.loss <= _GOAL else f"**{_factor(one.loss)}**",
            ]
        )
    losses = np.array([one.loss for one in found])
    above = int((losses > _GOAL).sum())
    always = [
        np.array([one.seconds[m] / min(one.seconds.values()) for one in found]) for m in METHODS
    ]
    head = ["kernel", "shattering", "t", *(f"{m}, ns" for m in METHODS)]
    head += ["best", "auto", "auto : best"]
    return [
        f"Processor nanoseconds per collision, start of the replicas included; –: more than "
        f"{_HOPELESS:g} times the size-class method. Of {len(found)} cases, the choice is more "
        f"than {_GOAL} times slower than the best in {above}; the largest loss is a factor of "
        f"{_factor(losses.max())}, the median {np.median(losses):.2f}. "
        + " ".join(
            f"Always {method}: at most {_factor(loss.max())}, above {_GOAL} in "
            f"{int((loss > _GOAL).sum())}."
            for method, loss in zip(METHODS, always, strict=True)
        )
        + " "
        + choosing(),
        "",
        *table([*head], rows),
    ]


def _ns(seconds: float, events: int) -> str:
    return f"{1e9 * seconds / events:.0f}" if seconds < np.inf else "–"


def _factor(loss: float) -> str:
    return f"{loss:.2f}" if loss < np.inf else f"more than {_HOPELESS:g}"


def main() -> None:
    """Measure, and write a section for each number of particles."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--particles", type=float, nargs="+", default=SIZES)
    parser.add_argument("--repeats", type=int, default=5, help="fewer for the larger systems")
    parser.add_argument("--dry", action="store_true", help="leave the page of results alone")
    asked = parser.parse_args()
    for particles in map(int, asked.particles):
        # larger systems run for long enough to be measured once
        repeats = max(1, min(asked.repeats, 300_000 // particles))
        found = []
        for case in cases(particles):
            found.append(measure(case, repeats))
            _show(found[-1])
        lines = describe(found)
        if asked.dry:
            print("\n".join(lines))
        else:
            title = f'The choice of `method="auto"`, N = {particles:.0e}'
            write_section(f"auto-{particles}", title, lines)


def _show(one: Found) -> None:
    case = one.case
    print(
        case.kernel.name,
        case.shattering,
        case.end,
        case.particles,
        one.events,
        *(f"{1e9 * s / one.events:.0f}" for s in one.seconds.values()),
        f"{one.candidates:.3g}",
        one.chosen,
        f"{one.loss:.2f}",
        one.reason,
        sep="\t",
        flush=True,
    )


if __name__ == "__main__":
    main()
