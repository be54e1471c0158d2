"""A group of replicas advanced together by one compiled loop: the unit of parallel work."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smolux.core.seeds import streams
from smolux.core.state import (
    BAD_FACTOR,
    BAD_RATE,
    BAD_SHARE,
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
    NEXT,
    PARTICLES,
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
    TimeWindows,
    new_state,
    new_tally,
)
from smolux.errors import InputError
from smolux.initial import Sizes
from smolux.jit.compile import CompileError
from smolux.kernels.base import Kernel
from smolux.kernels.shared import WHOLE, Shared
from smolux.methods.base import size_of
from smolux.model import Model
from smolux.processes.base import PairProcess, UnaryProcess, text_of
from smolux.runtime import room

from .assembly import uncompilable
from .bounds_cache import spent
from .carrying import carrying_work, joint_population, observe_rows, tally_shape
from .parameters import bound_splits, factor_parameters
from .plan import Plan

Int = NDArray[np.int64]

#: seconds between returns to Python
_SLICE = 0.1


@dataclass
class Group:
    """Some replicas of a plan: their state, stores and observations; see `start`."""

    plan: Plan
    first: int
    state: State
    work: Any
    tally: Tally
    codes: Int
    windows: TimeWindows
    distribution: list[list[tuple[Int, Int]]] = field(default_factory=list)
    #: what the particles of these populations carry, row by row, if they carry anything
    joint: list[list[Int]] = field(default_factory=list)
    seconds: float = 0.0
    compile_seconds: float = 0.0
    #: for bounds and tables of rates, not part of `seconds`
    bounds_seconds: float = 0.0
    #: that of the plan, once it is known: what tells loops apart takes time
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
        state = empty_state(plan, streams(plan.seed, first, count))
        if plan.model.attributes:
            work = carrying_work(plan, populations, first, state)
        else:
            work = plan.store.new_work(plan.rates, populations, state, plan.mass)
        new = cls.of(plan, first, state, work, plan.windows(), loop)
        new.bounds_seconds = spent() - before
        return new

    @classmethod
    def of(
        cls,
        plan: Plan,
        first: int,
        state: State,
        work: Any,
        windows: TimeWindows,
        loop: Any = None,
        parameters: Parameters | None = None,
    ) -> Group:
        """Start with these particles; see `start`. The `parameters` are those of a group before."""
        count, processes = len(state.rng), plan.model.processes
        state.count[:, DOUBLE_AT] = plan.doubles_at
        state.count[:, PAUSE] = plan.distribution or bool(plan.model.attributes)
        return cls(
            plan,
            first,
            state,
            work,
            new_tally(count, plan.grid, plan.sizes, len(processes), tally_shape(plan)),
            np.full(count, BUDGET, np.int64),
            windows,
            distribution=[[] for _ in range(count if plan.distribution else 0)],
            joint=[[] for _ in range(count if plan.distribution else 0)],
            loop=loop,
            parameters=parameters,
        )

    @classmethod
    def unbegun(cls, plan: Plan, first: int, count: int) -> Group:
        """Return a group of which nothing is known, in place of one that never came back."""
        state = empty_state(plan, np.zeros((count, 4), np.uint64))
        return cls.of(plan, first, state, None, plan.windows())

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

    @property
    def intact(self) -> bool:
        """Whether it could go on from what it is, see `.subvolumes.SubvolumeReplica`."""
        return True

    def compile(self) -> None:
        """Compile the loop, or load it from the cache, before any clock runs."""
        start = time.perf_counter()
        try:
            self._call(np.full(len(self.codes), DONE, np.int64), 0)
        except CompileError:
            problems = uncompilable(self.plan.physics, self.plan.weighting)
            if not problems:
                raise
            raise InputError(problems) from None
        self.compile_seconds = time.perf_counter() - start

    def _call(self, codes: Int, budget: int) -> None:
        plan = self.plan
        self.loop = self.loop or plan.loop
        self.parameters = self.parameters or factor_parameters(
            plan.physics.processes, plan.physics.kernel
        )
        self.loop(
            self.state,
            self.work,
            self.tally,
            self.windows,
            plan.grid,
            (*plan.physics.kernel.parameters, *plan.weighting.parameters),
            self.parameters,
            codes,
            budget,
        )

    def advance(self, stop: Callable[[], bool]) -> None:
        """Go on until done or until `stop` says so, asked about ten times a second.

        Every call gets something done, so that a run interrupted again and again comes to its end.
        """
        self._serve()  # what memory did not last for when the run was written
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
        """Give up the particles of replicas that do not go on; what was observed stays."""
        empty = {k: v[:0].copy() for k, v in self.work._asdict().items() if np.ndim(v)}
        self.work = self.work._replace(**empty)

    def _effort(self) -> int:
        return int(self.state.count[:, (TRIALS, EVENTS)].sum())

    def _serve(self) -> None:
        """Give the replicas that returned what they asked for.

        An error comes last: the others have what they asked for when the run is written.
        """
        errors: list[InputError] = []
        waiting = (self.codes != DONE) & (self.codes != BUDGET) & (self.codes != GROW)
        for r in map(int, np.flatnonzero(waiting)):
            try:
                self._give(r)
            except InputError as error:
                errors.append(error)
        if (self.codes == GROW).any():
            try:
                self._grow()
            except InputError as error:
                errors.append(error)
        if errors:
            raise errors[0]

    def _give(self, r: int) -> None:
        """Give a replica what it asked for, or raise the error of it."""
        code, plan = self.codes[r], self.plan
        if code == PAUSED:
            # sizes and counts, and as much to sort them; a store may hold less, if it counts
            size = min(32 * int(self.state.count[r, PARTICLES]), 4 * size_of(self.work))
            with room.needed(size, f"the clusters of replica {self.first + r}, to be kept,"):
                self._keep(r)
        # whatever comes of it, it is asked for anew; but not a population, or it would come twice
        self.codes[r] = BUDGET
        if code == BOUND:
            plan.store.supply_bound(self.work, plan.rates, self.state, r)
        elif code == SPLITS:
            assert self.parameters is not None
            bound_splits(plan.model.processes, self.parameters, int(self.state.count[r, WANTED]))
            self.state.count[r, WANTED] = 0  # which replica asks first is no part of its state
        elif code == BAD_FACTOR:
            self._repair_factor(r)
        elif code == BAD_RATE:
            raise InputError(_bad_rate(plan.physics, self.state, r))
        elif code == BAD_SHARE:
            process = plan.physics.processes[int(self.state.count[r, PROCESS])]
            assert isinstance(process, PairProcess)
            assert process.shared is not None
            raise InputError(_bad_share(process.called, process.shared, self.state, r))
        elif code == TOO_LARGE:
            raise InputError(
                "a cluster would reach 2**62 monomers, more than can be counted, near "
                f"t = {self.state.clock[r, TIME]:.6g}: end earlier"
            )

    def _keep(self, r: int) -> None:
        """Take what Python observes of a replica that has come to an output time."""
        plan = self.plan
        if not plan.model.attributes:
            self.distribution[r].append(plan.store.population(self.work, self.state, r))
            return
        sizes, rows = plan.store.rows(self.work, self.state, r)
        k = int(self.state.count[r, NEXT]) - 1
        observe_rows(plan, sizes, rows, self.work.account[r], self.tally.rows[r, k])
        if plan.distribution:
            sizes, counts, carried = joint_population(sizes, rows)
            self.distribution[r].append((sizes, counts))
            self.joint[r].append(carried)

    def _grow(self) -> None:
        """Make the store larger, if there is memory for that."""
        method, before = self.plan.store, size_of(self.work)
        last = self.first + len(self.codes) - 1
        which = f"replicas {self.first} to {last}" if last > self.first else f"replica {last}"
        time_ = self.state.clock[self.codes == GROW, TIME].max()
        what = f"the particles of {which}, more and more until t = {time_:.6g},"
        with room.needed(method.growth(self.work, self.state), what):
            self.work = method.grow(self.work, self.state)
            room.grown(self, size_of(self.work) - before)
        self.codes[self.codes == GROW] = BUDGET

    def _repair_factor(self, r: int) -> None:
        """Raise the bounds of a factor that was found above one; the event itself takes place."""
        process = int(self.state.count[r, PROCESS])
        value, window = float(self.state.clock[r, VALUE]), int(self.state.count[r, WINDOW])
        found = self.plan.model.processes[process]
        name, text = found.called, text_of(found, self.plan.model.kernel)
        if not (np.isfinite(value) and value >= 0):
            raise InputError(
                f"the rate of {name}, {text}, is {value:.6g} at "
                f"t = {self.state.clock[r, PENDING]:.6g}; it must be a finite number, zero or more"
            )
        # for this replica alone: what others do must not depend on when this one came here
        clock, known = self.state.clock[r], float(self.windows.bounds[window, process])
        bound = known + clock[CLOCKS + process]
        if bound > 0.0:  # see `smolux.core.bounds.repair`
            self.state.missed[r, BY_FACTOR + process] += value / bound - 1.0
        clock[CLOCKS + process] = 1.1 * value - known
        clock[EXCESS] = clock[CLOCKS:].sum()


def empty_state(plan: Plan, rng: Any) -> State:
    """Return the state at the start but for the particles, for as many replicas as streams."""
    processes = plan.model.processes
    unary = sum(isinstance(p, UnaryProcess) for p in processes)
    state = new_state(rng, len(processes), max(p.entries for p in processes), unary)
    state.clock[:, VOLUME] = plan.volume
    state.clock[:, EXTINCT] = np.nan
    return state


def initial_populations(plan: Plan, replicas: Sequence[int]) -> list[tuple[Int, Int]]:
    """Draw the initial sizes of replicas and their counts."""
    initial = plan.start
    if isinstance(initial, Sizes) and len(initial.sizes) == 1:  # nothing to draw
        return [(np.array(initial.sizes), np.array([plan.particles]))] * len(replicas)
    sequences = (np.random.SeedSequence(plan.seed, spawn_key=(r, 1)) for r in replicas)
    draws = (float(np.random.default_rng(sequence).random()) for sequence in sequences)
    return [initial.sample(plan.particles, u) for u in draws]


def _bad_share(name: str, share: Kernel, state: State, r: int) -> str:
    i, j = int(state.count[r, WORST_I]), int(state.count[r, WORST_J])
    return (
        f"the share of {name}, {share.label}, is {float(share(i, j)):.6g} for the sizes {i} and "
        f"{j}, met at t = {state.clock[r, TIME]:.6g}; a share is between 0 and 1: correct the "
        "function there"
    )


def _bad_rate(model: Model, state: State, r: int) -> str:
    i, j = int(state.count[r, WORST_I]), int(state.count[r, WORST_J])
    if i == j == 0:  # of all particles together, see `smolux.methods.inverse.pieces`
        return (
            f"the rates of the kernel {model.kernel.label} of all pairs have no finite sum at "
            f"t = {state.clock[r, TIME]:.6g}: take a longer unit of time, in which rates are "
            "smaller, or method = 'low-rank'"
        )
    culprit = int(state.count[r, CULPRIT])
    if culprit == 0 and isinstance(model.kernel, Shared):
        share = model.kernel.share
        if not 0.0 <= float(share(i, j)) <= WHOLE:
            name = next(p.called for p in model.processes if isinstance(p, PairProcess))
            return _bad_share(name, share, state, r)
    if culprit == 0:
        whose, where = f"the kernel {model.kernel.label}", f"sizes {i} and {j}"
    else:
        process = [p for p in model.processes if isinstance(p, UnaryProcess)][culprit - 1]
        whose = f"the rate of {process.called}"
        where = f"fragments {i} and {j}" if j else f"size {i}"
    return (
        f"{whose} gave {state.clock[r, VALUE]:.6g} for the {where}, met at "
        f"t = {state.clock[r, TIME]:.6g}; a rate must be a finite number, zero or more: correct "
        "the function there"
    )
