"""Cells of the matrix: a start, a kernel, processes and what varies, made into two problems."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

import smolux as sx

from . import reference
from .axes import KERNELS, PROCESSES, STARTS, VARYING, Kernel, Process, Scale, Start, Varying

#: the sizes that the direct sum is given are at most so many
DIRECT = 2000
#: share of the time to gelation that is the most
_NEAR = 0.7
#: output times, in units of the last one
_SHARES = (0.31, 1.0)


@dataclass(frozen=True)
class Cell:
    """One model of the matrix; `varying` is that of the first of the processes."""

    start: Start
    kernel: Kernel
    processes: tuple[Process, ...] = ()
    varying: Varying = VARYING[0]

    @property
    def name(self) -> str:
        """What stands in tables."""
        what = " + ".join(p.name for p in self.processes) or "aggregation"
        when = "" if self.varying.name == "none" else f", {self.varying.name}"
        return f"{self.start.name} | {what}{when} | {self.kernel.name}"

    @property
    def scale(self) -> Scale:
        """The scales of sizes, density and time."""
        start, kernel = self.start, self.kernel
        size = np.float64(start.scale)
        turnovers = min(kernel.pace * start.turnovers, kernel.most)
        time = turnovers / (float(kernel.law.rate(size, size)) * start.density)
        # a round number, so that what is printed is what was computed
        return Scale(float(size), start.largest, start.density, float(f"{time:.3g}"))

    @property
    def times(self) -> list[float]:
        """The output times."""
        return [share * self.scale.time for share in _SHARES]

    @property
    def model(self) -> Any:
        """The model for the solver."""
        scale = self.scale
        factor = self.varying.given(scale.time)
        given = [p.given(scale, factor if k == 0 else 1.0) for k, p in enumerate(self.processes)]
        return sx.Model(self.kernel.kernel, [sx.processes.Aggregation(), *given],
                        initial=self.start.initial)  # fmt: skip

    @property
    def problem(self) -> reference.Problem:
        """The same for the reference."""
        scale = self.scale
        factor = self.varying.plain(scale.time)
        plain = [
            p.plain(scale, factor if k == 0 else reference.one)
            for k, p in enumerate(self.processes)
        ]
        cuts = [p.cut(scale) for p in self.processes if p.cut is not None]
        inflow = [p for p in plain if isinstance(p, reference.Inflow)]
        largest = max(self.start.largest, *(s for p in inflow for s in p.rates), 1)
        return reference.Problem(
            law=self.kernel.law,
            pairs=[reference.Pairs("aggregation"),
                   *(p for p in plain if isinstance(p, reference.Pairs))],
            unary=[p for p in plain if isinstance(p, reference.Unary)],
            inflow=inflow,
            start=self.start.densities,
            largest=int(max(60, 1.5 * largest, 18 * self.start.scale)),
            cut=cuts[0] if cuts else None,
            breaks=self.varying.breaks(scale.time) if self.processes else (),
        )  # fmt: skip


def _gels(cell: Cell) -> bool:
    """Whether a gel may form: M2 of all that comes in, at once, times the time nears one."""
    if cell.kernel.name != "multiplicative":
        return False
    problem, time = cell.problem, cell.times[-1]
    n = problem.start(problem.largest)
    second = float(n @ np.arange(1.0, len(n) + 1.0) ** 2)
    come = sum(s**2 * r for p in problem.inflow for s, r in p.rates.items())
    return (second + come * time) * time > _NEAR


def _possible(start: Start, processes: Sequence[Process]) -> bool:
    families = [p.family for p in processes]
    fed = start.name != "empty" or "source" in families
    return fed and len(set(families)) == len(families)


def varies(processes: Sequence[Process]) -> bool:
    """Whether a factor of time can be given to the first of some processes."""
    return bool(processes) and processes[0].cut is None


def alone() -> Iterator[Cell]:
    """Yield aggregation alone: every start with every kernel."""
    for start in STARTS:
        if _possible(start, ()):
            for kernel in KERNELS:
                yield Cell(start, kernel)


def timed() -> Iterator[Cell]:
    """Yield every process with all that varies; starts and two kernels take turns."""
    for p, process in enumerate(PROCESSES):
        for v, varying in enumerate(VARYING):
            for k in (p + v, p + v + 3):
                start = STARTS[(0, 4, 10)[k % 3]]
                if start is STARTS[0] and process.family == "source":
                    start = STARTS[-1]
                cell = Cell(start, KERNELS[k % 6], (process,), varying)
                if (varying.name == "none" or varies([process])) and not _gels(cell):
                    yield cell


def each(starts: slice) -> Iterator[Cell]:
    """Yield some of the starts with every process; kernels and what varies take turns."""
    for s in range(len(STARTS))[starts]:
        for p, process in enumerate(PROCESSES):
            yield from _turned(s, p, (process,))


def paired() -> Iterator[Cell]:
    """Yield every pair of processes; starts, kernels and what varies take turns."""
    for p, pair in enumerate(combinations(PROCESSES, 2)):
        for s in (p % 16, (p + 7) % 16):
            # those that vary come first, now the one and now the other
            yield from _turned(s, p, pair[::-1] if (s + p) % 2 else pair)


def mixed() -> Iterator[Cell]:
    """Yield every start with every process, and every pair of processes."""
    yield from each(slice(None))
    yield from paired()


def _turned(s: int, p: int, processes: tuple[Process, ...]) -> Iterator[Cell]:
    """Yield the s-th start with some processes, unless there is nothing to begin with."""
    if not _possible(STARTS[s], processes):
        return
    varying = VARYING[(2 * s + p) % 5] if varies(processes) else VARYING[0]
    cell = Cell(STARTS[s], KERNELS[(s + p) % 6], processes, varying)
    yield replace(cell, kernel=KERNELS[(s + p + 1) % 6]) if _gels(cell) else cell


def unique(*parts: Iterator[Cell]) -> list[Cell]:
    """Return cells in the order of the parts, each once."""
    return list({cell.name: cell for part in parts for cell in part}.values())
