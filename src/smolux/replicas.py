"""A group of replicas advanced together by one compiled loop: the unit of parallel work."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .assembly import (
    bound_splits,
    factor_parameters,
    loop_for,
    rates_for,
    uncompilable,
    windows_for,
)
from .core.compile import CompileError
from .core.rng import streams
from .core.state import (
    BAD_FACTOR,
    BAD_RATE,
    BOUND,
    BUDGET,
    BY_FACTOR,
    CLOCKS,
    CULPRIT,
    DONE,
    DOUBLE_AT,
    EVENTS,
    EXCESS,
    EXTINCT,
    GROW,
    PAUSE,
    PAUSED,
    PENDING,
    PROCESS,
    SPLITS,
    TIME,
    TOO_LARGE,
    TRIALS,
    VALUE,
    VOLUME,
    WANTED,
    WINDOW,
    WORST_I,
    WORST_J,
    Parameters,
    State,
    Tally,
    Windows,
    new_state,
    new_tally,
)
from .errors import InputError
from .initial import Sizes
from .model import Model
from .plan import Plan
from .processes.base import LoneProcess
from .remembered import spent

Int = NDArray[np.int64]

#: seconds between returns to Python
_SLICE = 0.1
#: what a replica returns with that may end the run
_ENDING = (BAD_FACTOR, BAD_RATE, TOO_LARGE)


@dataclass
class Group:
    """Some replicas of a plan: their state, stores and observations; see `start`."""

    plan: Plan
    first: int
    state: State
    work: Any
    tally: Tally
    codes: Int
    windows: Windows
    distribution: list[list[tuple[Int, Int]]] = field(default_factory=list)
    seconds: float = 0.0
    compile_seconds: float = 0.0
    #: for bounds and tables of rates, not part of `seconds`
    bounds_seconds: float = 0.0
    #: what `loop_for` returns for the plan, once it is known: what tells loops apart takes time
    loop: Any = None
    #: parameters of the processes, with tables that fill up as sizes occur
    parameters: Parameters | None = None
    #: candidates and events of a slice
    budget: int = 10_000

    @classmethod
    def start(cls, plan: Plan, first: int, count: int, loop: Any = None) -> Group:
        """Draw the initial populations of the replicas ``first .. first + count - 1``.

        The `loop` is that of a group before, if one had the same model, method and weighting.
        """
        before = spent()
        populations = initial_populations(plan, range(first, first + count))
        state = empty_state(plan, streams(plan.entropy, first, count))
        rates = rates_for(plan.model, plan.weighting)
        work = plan.method.new_work(rates, populations, state, plan.mass)
        windows = windows_for(plan.model.processes, plan.times[-1], plan.weighting)
        new = cls.of(plan, first, state, work, windows, loop)
        new.bounds_seconds = spent() - before
        return new

    @classmethod
    def of(
        cls,
        plan: Plan,
        first: int,
        state: State,
        work: Any,
        windows: Windows,
        loop: Any = None,
        parameters: Parameters | None = None,
    ) -> Group:
        """Start with these particles; see `start`. The `parameters` are those of a group before."""
        count, processes = len(state.rng), plan.model.processes
        state.count[:, DOUBLE_AT] = plan.doubles_at
        state.count[:, PAUSE] = plan.distribution
        return cls(
            plan,
            first,
            state,
            work,
            new_tally(count, plan.grid, plan.sizes, len(processes)),
            np.full(count, BUDGET, np.int64),
            windows,
            distribution=[[] for _ in range(count if plan.distribution else 0)],
            loop=loop,
            parameters=parameters,
        )

    @property
    def done(self) -> bool:
        """Whether every output time of every replica is recorded."""
        return bool((self.codes == DONE).all())

    @property
    def events(self) -> int:
        """Collisions so far."""
        return int(self.state.count[:, EVENTS].sum())

    @property
    def fraction(self) -> float:
        """Share of the simulated time that is done."""
        reached = np.minimum(self.state.clock[:, TIME] / self.plan.times[-1], 1.0)
        return float(np.where(self.codes == DONE, 1.0, reached).mean())

    def compile(self) -> None:
        """Compile the loop, or load it from the cache, before any clock runs."""
        start = time.perf_counter()
        try:
            self._call(np.full(len(self.codes), DONE, np.int64), 0)
        except CompileError:
            problems = uncompilable(self.plan.model, self.plan.weighting)
            if not problems:
                raise
            raise InputError(problems) from None
        self.compile_seconds = time.perf_counter() - start

    def _call(self, codes: Int, budget: int) -> None:
        plan = self.plan
        self.loop = self.loop or loop_for(plan.model, plan.method, plan.weighting)
        self.parameters = self.parameters or factor_parameters(plan.model.processes)
        self.loop(
            self.state,
            self.work,
            self.tally,
            self.windows,
            plan.grid,
            (*plan.model.kernel.parameters, *plan.weighting.parameters),
            self.parameters,
            codes,
            budget,
        )

    def advance(self, stop: Callable[[], bool]) -> None:
        """Go on until done or until `stop` says so, asked about ten times a second.

        Every call gets something done, so that a run interrupted again and again comes to its end.
        """
        while not self.done:
            before, budget = self._effort(), self.budget
            start = time.perf_counter()
            self._call(self.codes, budget)
            elapsed = time.perf_counter() - start
            self.seconds += elapsed
            known = spent()
            self._serve()
            self.bounds_seconds += spent() - known
            done = self._effort() - before
            if done > 0.5 * budget:
                wanted = max(done * _SLICE / max(elapsed, 1e-6), 1000)
                self.budget = int(min(wanted, 1e10, 20 * budget))
            if stop():
                return

    def release(self) -> None:
        """Give up the particles of replicas that are done; what was observed stays."""
        if self.done:
            empty = {k: v[:0].copy() for k, v in self.work._asdict().items() if np.ndim(v)}
            self.work = self.work._replace(**empty)

    def _effort(self) -> int:
        return int(self.state.count[:, (TRIALS, EVENTS)].sum())

    def _serve(self) -> None:
        """Give the replicas that returned what they asked for."""
        if (self.codes == GROW).any():
            self.work = self.plan.method.grow(self.work, self.state)
        waiting = np.flatnonzero(
            (self.codes != DONE) & (self.codes != BUDGET) & (self.codes != GROW)
        )
        if len(waiting):
            rates = rates_for(self.plan.model, self.plan.weighting)
        # an error comes last: the others have what they asked for when the run is written
        for r in map(int, sorted(waiting, key=lambda r: self.codes[r] in _ENDING)):
            code = self.codes[r]
            if code == BOUND:
                self.plan.method.supply_bound(self.work, rates, self.state, r)
            elif code == SPLITS:
                assert self.parameters is not None
                wanted = int(self.state.count[r, WANTED])
                bound_splits(self.plan.model.processes, self.parameters, wanted)
            elif code == PAUSED:
                self.distribution[r].append(self.plan.method.population(self.work, self.state, r))
            elif code == BAD_FACTOR:
                self._repair_factor(r)
            elif code == BAD_RATE:
                raise InputError(_bad_rate(self.plan.model, self.state, r))
            elif code == TOO_LARGE:
                raise InputError(
                    "a cluster would reach 2**62 monomers, more than can be counted, near "
                    f"t = {self.state.clock[r, TIME]:.6g}: end earlier"
                )

    def _repair_factor(self, r: int) -> None:
        """Raise the bounds of a factor that was found above one; the event itself takes place."""
        process = int(self.state.count[r, PROCESS])
        value, window = float(self.state.clock[r, VALUE]), int(self.state.count[r, WINDOW])
        name, text = (
            self.plan.model.processes[process].name,
            self.plan.model.processes[process].factor.text,
        )
        if not (np.isfinite(value) and value >= 0):
            raise InputError(
                f"the rate of {name}, {text}, is {value:.6g} at "
                f"t = {self.state.clock[r, PENDING]:.6g}; it must be a finite number, zero or more"
            )
        # for this replica alone: what others do must not depend on when this one came here
        clock, known = self.state.clock[r], float(self.windows.bounds[window, process])
        bound = known + clock[CLOCKS + process]
        if bound > 0.0:  # see `smolux.core.loop.repair`
            self.state.missed[r, BY_FACTOR + process] += value / bound - 1.0
        clock[CLOCKS + process] = 1.1 * value - known
        clock[EXCESS] = clock[CLOCKS:].sum()


def empty_state(plan: Plan, rng: Any) -> State:
    """Return the state at the start but for the particles, for as many replicas as streams."""
    processes = plan.model.processes
    lone = sum(isinstance(p, LoneProcess) for p in processes)
    state = new_state(rng, len(processes), max(p.entries for p in processes), lone)
    state.clock[:, VOLUME] = plan.volume
    state.clock[:, EXTINCT] = np.nan
    return state


def initial_populations(plan: Plan, replicas: Sequence[int]) -> list[tuple[Int, Int]]:
    """Draw the initial sizes of replicas and their counts."""
    initial = plan.start
    if isinstance(initial, Sizes) and len(initial.sizes) == 1:  # nothing to draw
        return [(np.array(initial.sizes), np.array([plan.particles]))] * len(replicas)
    sequences = (np.random.SeedSequence(plan.entropy, spawn_key=(r, 1)) for r in replicas)
    draws = (float(np.random.default_rng(sequence).random()) for sequence in sequences)
    return [initial.sample(plan.particles, u) for u in draws]


def _bad_rate(model: Model, state: State, r: int) -> str:
    i, j = int(state.count[r, WORST_I]), int(state.count[r, WORST_J])
    culprit = int(state.count[r, CULPRIT])
    if culprit == 0:
        whose, where = f"the kernel {model.kernel.label}", f"sizes {i} and {j}"
    else:
        process = [p for p in model.processes if isinstance(p, LoneProcess)][culprit - 1]
        whose = f"the rate of {process.name}"
        where = f"fragments {i} and {j}" if j else f"size {i}"
    return (
        f"{whose} gave {state.clock[r, VALUE]:.6g} for the {where}, met at "
        f"t = {state.clock[r, TIME]:.6g}; a rate must be a finite number, zero or more: correct "
        "the function there"
    )
