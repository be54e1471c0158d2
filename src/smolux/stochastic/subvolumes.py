"""One replica as sub-volumes, simulated side by side and mixed again and again.

Every particle of a well-mixed system is as likely in one place as in another. So between two
mixings each sub-volume is a jump process of its own, and at a mixing each particle is put into a
sub-volume at random. Two particles then meet at the exact rate on average: they share one of `p`
sub-volumes with probability ``1/p``, and meet there ``p`` times as often.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smolux.core.seeds import stream
from smolux.core.state import (
    BUDGET,
    CLOCKS,
    DONE,
    DOUBLINGS,
    EVENTS,
    EXCESS,
    EXTENSIVE,
    EXTINCT,
    FLOOR,
    NEXT,
    PARTICLES,
    TIME,
    VOLUME,
    WINDOW,
    WORST_I,
    WORST_J,
    State,
    Tally,
    TimeWindows,
    bring_together,
    hand_on,
    new_tally,
)
from smolux.methods.base import merged, size_of
from smolux.observables import add_up
from smolux.processes.base import PairProcess
from smolux.runtime import room
from smolux.settings.simulation import LEAST

from .plan import Plan
from .replicas import Group, empty_state, initial_populations

Int = NDArray[np.int64]

#: which random numbers a stream is for
_PART, _MIXING, _GUESS = 2, 3, 4


@dataclass
class SubvolumeReplica:
    """A replica in sub-volumes; has what a `smolux.stochastic.replicas.Group` of one replica has.

    A stretch is the time from one mixing to the next. It depends on the state at its start, not on
    output times, and its random numbers on its number, so that a run can go on from the latest
    mixing, bit for bit.
    """

    plan: Plan
    first: int
    state: State
    tally: Tally
    codes: Int
    windows: TimeWindows
    #: number of the stretch, and how long the next one is
    stretch: int
    length: float
    distribution: list[list[tuple[Int, Int]]] = field(default_factory=list)
    seconds: float = 0.0
    compile_seconds: float = 0.0
    bounds_seconds: float = 0.0
    #: the sub-volumes at the end of a stretch, or while it lasts
    parts: list[Group] = field(default_factory=list)
    #: the times of a stretch that has begun and is not yet over
    open: tuple[float, ...] = ()

    @classmethod
    def start(cls, plan: Plan, replica: int) -> SubvolumeReplica:
        """Draw the initial population, not yet in sub-volumes."""
        whole = Group.start(replace(plan, subvolumes=1, replicas=1, distribution=False), replica, 1)
        state = empty_state(plan, np.zeros((1, 4), np.uint64))
        state.count[0, PARTICLES] = whole.state.count[0, PARTICLES]
        return cls(
            plan,
            replica,
            state,
            new_tally(1, plan.grid, plan.sizes, len(plan.model.processes)),
            np.full(1, BUDGET, np.int64),
            whole.windows,
            stretch=0,
            length=_first_stretch(plan, replica),
            distribution=[[] for _ in range(int(plan.distribution))],
            bounds_seconds=whole.bounds_seconds,
            parts=[whole],
        )

    @property
    def done(self) -> bool:
        """Whether every output time is recorded."""
        return bool(self.codes[0] == DONE)

    @property
    def events(self) -> int:
        """Collisions so far."""
        # those of a stretch that is over are added up
        here = sum(part.events for part in self.parts) if self.open else 0
        return int(self.state.count[0, EVENTS]) + here

    @property
    def fraction(self) -> float:
        """Share of the simulated time that is done."""
        return min(float(self.state.clock[0, TIME]) / self.plan.times[-1], 1.0)

    def compile(self) -> None:
        """Compile the loop, or load it from the cache, before any clock runs."""
        self.parts[0].compile()
        self.compile_seconds = self.parts[0].compile_seconds

    def advance(self, stop: Callable[[], bool]) -> None:
        """Go on until done or until `stop` says so, asked after every stretch."""
        with ThreadPoolExecutor(self.plan.subvolumes) as pool:
            while not self.done:
                self._stretch(pool)
                if stop():
                    return

    @property
    def intact(self) -> bool:
        """Whether it could go on: not if memory ended while the particles were split."""
        return bool(self.parts) or self.done

    def release(self) -> None:
        """Give up the particles of a replica that does not go on; what was observed stays."""
        self.parts.clear()

    def _stretch(self, pool: ThreadPoolExecutor) -> None:
        """Mix, and simulate all sub-volumes up to the next mixing; or go on doing so."""
        if not self.open:
            self._mix(pool)
        begun = [pool.submit(part.advance, lambda: False) for part in self.parts]
        # all come to the end of the stretch, so that one that fails leaves the others complete
        wait(begun)
        for each in begun:
            each.result()
        left = np.array(self.plan.times[int(self.state.count[0, NEXT]) :])
        self._observe(int((left <= self.open[-1]).sum()))
        self._add_up(self.open[-1])
        self.open = ()

    def _mix(self, pool: ThreadPoolExecutor) -> None:
        """Put the particles into sub-volumes at random, for the next stretch."""
        clock, count = self.state.clock[0], self.state.count[0]
        start, end = clock[TIME], clock[TIME] + self.length
        left = self.plan.times[int(count[NEXT]) :]
        due = [t for t in left if t <= end]
        if len(due) == len(left):
            end = due[-1]
        times = tuple(due if due and due[-1] == end else [*due, end])
        plan = within(self.plan, times)
        copies = self._copies()
        size = sum(copies * size_of(part.work) for part in self.parts)
        what = f"the sub-volumes of replica {self.first}, filled anew at t = {start:.6g},"
        used = max(1, min(self.plan.subvolumes, copies * int(count[PARTICLES]) // LEAST))
        method, rates = plan.method, self.plan.rates
        carried = [method.carried(part.work, part.state) for part in self.parts]
        window = int(np.searchsorted(self.windows.edges, start, side="right")) - 1
        loop, parameters = self.parts[0].loop, [part.parameters for part in self.parts]

        def split(k: int) -> list[Any]:
            part, words = self.parts[k], stream(plan.seed, self.first, _MIXING, self.stretch, k)
            return method.split(part.work, part.state, used, copies, words)

        def fill(k: int) -> Group:
            words = stream(plan.seed, self.first, _PART, self.stretch, k)
            state = empty_state(plan, words[None])
            work = method.collect(rates, [given[k] for given in split_up], state, plan.mass)
            hand_on(self.state, state)
            state.clock[0, (TIME, VOLUME, EXCESS)] = start, clock[VOLUME] / used, clock[EXCESS]
            if used == 1:
                state.clock[0, EXTINCT] = clock[EXTINCT]
            state.count[0, WINDOW] = window
            method.carry_over(work, state, carried)
            known = parameters[k] if k < len(parameters) else None
            return Group.of(plan, self.first, state, work, self.windows, loop, known)

        with room.needed(size, what):
            split_up = list(pool.map(split, range(len(self.parts))))
            self._double(copies)
            self.parts.clear()  # room for what follows
            filled = list(pool.map(fill, range(used)))
        self.parts += filled
        self.open = times

    def _copies(self) -> int:
        """Return how often each particle comes when the volume is doubled as the policy says."""
        copies, particles = 1, int(self.state.count[0, PARTICLES])
        while 0 < copies * particles <= self.plan.doubles_at:
            copies *= 2
        return copies

    def _double(self, copies: int) -> None:
        """Make the volume so many times as large."""
        clock, count = self.state.clock[0], self.state.count[0]
        count[PARTICLES] *= copies
        count[DOUBLINGS] += copies.bit_length() - 1
        clock[[*EXTENSIVE]] *= float(copies)
        if copies > 1:
            clock[EXTINCT] = np.nan

    def _observe(self, due: int) -> None:
        """Add up what the sub-volumes recorded at the output times of this stretch."""
        first = int(self.state.count[0, NEXT])
        rows = slice(first, first + due)
        add_up(self.tally, rows, [part.tally for part in self.parts], self.state)
        for k in range(due if self.plan.distribution else 0):
            self.distribution[0].append(merged([part.distribution[0][k] for part in self.parts]))
        self.state.count[0, NEXT] += due

    def _add_up(self, end: float) -> None:
        """Bring the state of the whole up to the end of the stretch, and plan the next."""
        clock, count = self.state.clock[0], self.state.count[0]
        states = [part.state for part in self.parts]
        worst = max(states, key=lambda state: state.clock[0, FLOOR])
        if worst.clock[0, FLOOR] > clock[FLOOR]:
            count[[WORST_I, WORST_J]] = worst.count[0, [WORST_I, WORST_J]]
        before = count[EVENTS]
        bring_together(self.state, states)
        self.seconds += sum(part.seconds for part in self.parts)
        self.bounds_seconds += sum(part.bounds_seconds for part in self.parts)
        clock[EXCESS] = clock[CLOCKS:].sum()
        few = count[PARTICLES] <= 1
        clock[EXTINCT] = max(s.clock[0, EXTINCT] for s in states) if few else np.nan
        elapsed, clock[TIME] = end - clock[TIME], end
        self.stretch += 1
        self.length = 2.0 * elapsed
        if count[EVENTS] > before:
            wanted = self.plan.remix * count[PARTICLES] / (count[EVENTS] - before)
            self.length = min(self.length, wanted * elapsed)
        if count[NEXT] == len(self.plan.times):
            self.codes[0] = DONE


def within(plan: Plan, times: tuple[float, ...]) -> Plan:
    """Return the plan of a sub-volume for a stretch with these times."""
    return replace(plan, times=times, population="fixed-volume", subvolumes=1, replicas=1)


def _first_stretch(plan: Plan, replica: int) -> float:
    """Estimate how long it takes until the share of particles has collided after which to mix."""
    rng = np.random.default_rng(np.random.SeedSequence(plan.seed, spawn_key=(replica, _GUESS)))
    sizes, counts = initial_populations(plan, [replica])[0]
    if not counts.any():
        return 1e-3 * plan.times[-1]
    i, j = rng.choice(sizes, (2, 1000), p=counts / counts.sum()).astype(float)
    with np.errstate(all="ignore"):
        rates, kernel = plan.rates.arrays(i, j), plan.physics.kernel
        if kernel.in_time:
            now = sum(factor(0.0) * law(i, j) for factor, law in kernel.in_time)
            rates = np.where(rates > 0.0, rates * now / kernel(i, j), 0.0)
        mean = float(np.mean(rates))
    factors = sum(
        float(process.factor(0.0))
        for process in plan.model.processes
        if isinstance(process, PairProcess)
    )
    each = 0.5 * mean * factors * plan.particles / plan.volume
    if not (np.isfinite(each) and each > 0):
        return 1e-3 * plan.times[-1]
    return min(plan.remix / each, plan.times[-1])


def start(plan: Plan, first: int, count: int) -> Group | SubvolumeReplica:
    """Start the replicas from `first` on; those in sub-volumes one by one."""
    if plan.subvolumes > 1:
        return SubvolumeReplica.start(plan, first)
    return Group.start(plan, first, count)
