"""Batches of replicas of small systems: started together, advanced by one compiled call."""

from __future__ import annotations

import re
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from copy import deepcopy
from dataclasses import dataclass, replace
from threading import Event, local
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.checks import whole
from smolux.core.seeds import streams
from smolux.core.state import BUDGET, DONE, State
from smolux.functions.content import frozen
from smolux.initial import Sizes
from smolux.methods.base import Method
from smolux.model import Model
from smolux.runtime.progress import Progress
from smolux.settings import Settings
from smolux.settings.target_error import Target, named
from smolux.stochastic.make_plan import decided
from smolux.stochastic.observe import observable
from smolux.stochastic.plan import Plan
from smolux.stochastic.replicas import Group, empty_state, initial_populations
from smolux.stochastic.totals import Totals, attempts_of
from smolux.weighting.base import Weighting

from .moments import Moments

Float = NDArray[np.float64]

#: replicas of a batch at most: fewer cost more each, more leave the cache of a core
_TOGETHER = 1024
#: particles, and numbers observed, of a batch at most
_PARTICLES, _OBSERVED = 200_000, 1_000_000
#: batches that the replicas are cut into at least: their scatter is the error of the cost
_FEWEST = 20
#: sizes that are counted one by one at least: for those above, powers are taken one by one
_SIZES = 128
#: the largest size that can be observed by itself
_LARGEST = 2**20


@dataclass(frozen=True)
class Batch:
    """What is kept of a batch.

    Attributes
    ----------
    moments : Moments
        Of arrays of shape (observables, times).
    totals : Totals
    seconds : float
        Processor seconds, all included: seeds, initial populations, events, statistics.
    """

    moments: Moments
    totals: Totals
    seconds: float


class Sampler:
    """Makes batches of replicas of one plan and observes them.

    Parameters
    ----------
    plan : Plan
        Its `replicas` are those of a batch.
    observables : sequence of str
    """

    def __init__(self, plan: Plan, observables: Sequence[str]) -> None:
        self.plan = plan
        self.targets = [Target(name) for name in observables]
        first = Group.start(plan, 0, 1)
        first.compile()
        first.advance(lambda: False)
        self._loop = first.loop
        self._state: State | None = None
        self._work: Any = None
        self._tables: set[str] = set()
        self._own = local()
        start = plan.start
        if isinstance(start, Sizes) and len(start.sizes) == 1 and plan.replicas > 1:
            self._prepare(first.work)

    def _prepare(self, learnt: Any) -> None:
        """Store the start once, as all replicas begin alike, with the tables filled by a run.

        Arrays that do not get longer with the number of replicas are such tables.
        """
        plan = self.plan
        count = plan.replicas
        works = []
        for replicas in (1, count):
            self._state = empty_state(plan, streams(plan.seed, 0, replicas))
            populations = initial_populations(plan, range(replicas))
            works.append(plan.method.new_work(plan.rates, populations, self._state, plan.mass))
        one, many = (work._asdict() for work in works)
        self._tables = {k for k in one if np.shape(one[k]) == np.shape(many[k])}
        known = {k: getattr(learnt, k) for k in self._tables}
        # tables may be about stores of a certain length: those of a run that grew are no use
        grown = any(np.shape(getattr(learnt, k)) != np.shape(one[k]) for k in one)
        self._work = works[1] if grown else works[1]._replace(**known)

    def start(self, first: int, count: int) -> Group:
        """Start the replicas ``first .. first + count - 1``."""
        plan = self.plan
        if self._state is None or count != plan.replicas:
            return Group.start(plan, first, count, self._loop)
        rng = streams(plan.seed, first, count)
        state = State(rng, *(array.copy() for array in self._state[1:]))
        return Group.of(plan, first, state, self._fresh(), plan.windows(), self._loop)

    def _fresh(self) -> Any:
        """Return the stores at the start: each thread has its own, and its tables fill up."""
        if not hasattr(self._own, "work"):
            self._own.work = deepcopy(self._work)
        else:
            for name, array in self._work._asdict().items():
                if name not in self._tables:
                    np.copyto(getattr(self._own.work, name), array)
        return self._own.work

    def values(self, group: Group, stop: Callable[[], bool]) -> Float:
        """Run a group and return the observables, of shape (replicas, observables, times)."""
        # one runs ahead, so that the others find the bounds that all of them need
        group.codes[1:] = DONE
        group.advance(stop)
        group.codes[1:] = BUDGET
        group.advance(stop)
        found = [observable(self.plan, target, [group])[0] for target in self.targets]
        return np.stack(found, axis=1)

    def batch(self, first: int, count: int, stop: Callable[[], bool]) -> Batch:
        """Run these replicas on this thread."""
        begun = time.thread_time()
        group = self.start(first, count)
        moments = Moments.of(self.values(group, stop))
        totals = Totals.of([group], attempts_of(self.plan, [group]))
        return Batch(moments, totals, time.thread_time() - begun)


def make_sampler(
    model: Model,
    times: ArrayLike,
    observables: Any,
    method: str | Method,
    weighting: str | Weighting,
    population: str,
    particles: Any,
    replicas: Any,
    seed: int | None,
    problems: Sequence[str] = (),
) -> Sampler:
    """Check the arguments of `ensemble`, all at once, beside problems that are known.

    Raises
    ------
    InputError
        With every mistake.
    """
    problems = list(problems)
    names, orders, sizes = _parsed(observables, problems)
    number = whole(replicas)
    if number is None or number < 2:
        problems.append(f"replicas = {replicas!r}: must be a whole number of at least 2")
    if getattr(model, "attributes", ()):
        problems.append(
            "model: its particles carry a composition, which ensembles do not observe: leave the "
            "attributes out, or use smolux.simulate"
        )
    settings = Settings.for_model(
        model,
        {
            "times": times,
            "method": method,
            "weighting": weighting,
            "population": population,
            "particles": particles,
            "replicas": min(number or 1, _TOGETHER),
            "seed": seed,
            "orders": orders,
            "sizes": min(max(sizes, min(_SIZES, whole(particles) or 1)), _LARGEST),
            "bins_per_octave": 1,
            "target": names[0] if names and not problems else "number_density",
        },
        problems,
    )
    assert number is not None
    plan = decided(frozen(model), settings)
    row = len(plan.times) * (plan.sizes + 64)
    together = min(_TOGETHER, _PARTICLES // plan.particles, _OBSERVED // row, number // _FEWEST)
    return Sampler(replace(plan, replicas=max(1, together)), names)


def _parsed(observables: Any, problems: list[str]) -> tuple[list[str], tuple[float, ...], int]:
    """Return the names, and the orders of moments and the largest size that they ask for."""
    given = [observables] if isinstance(observables, str) else observables
    if not isinstance(given, (list, tuple)) or not given:
        problems.append(
            f"observables = {observables!r}: must be a list of names such as "
            "('number_density', 'M2', 'n_50')"
        )
        return [], (0.0,), 1
    texts = [str(name) for name in given]
    orders = {float(t[1:]) for t in texts if re.fullmatch(r"M-?\d+(\.\d+)?", t)} or {0.0}
    sizes = max((int(t[2:]) for t in texts if re.fullmatch(r"n_\d+", t)), default=1)
    for name in given:
        named(name, tuple(orders), min(sizes, _LARGEST), problems, "observables")
    if len(set(texts)) < len(texts):
        problems.append(f"observables = {observables!r}: a name comes twice")
    return texts, tuple(sorted(orders)), sizes


def interleaved(
    samplers: Sequence[Sampler],
    replicas: int,
    workers: int,
    progress: Callable[[Progress], None] | None = None,
) -> Iterator[tuple[Batch, ...]]:
    """Run the replicas of several samplers in turns; yield the batches of a turn, one of each.

    The order, and so every sum over batches, does not depend on the number of threads.
    """
    batches = _in_order(samplers, replicas, workers, progress)
    return zip(*[batches] * len(samplers), strict=True)


def _in_order(
    samplers: Sequence[Sampler],
    replicas: int,
    workers: int,
    progress: Callable[[Progress], None] | None,
) -> Iterator[Batch]:
    tasks = (
        (sampler.batch, first, min(sampler.plan.replicas, replicas - first))
        for first, sampler in _turns(samplers, replicas)
    )
    halt, waiting = Event(), deque[tuple[int, Future[Batch]]]()
    done, total, started = 0, replicas * len(samplers), time.perf_counter()

    def tell() -> None:
        if progress is not None:
            seconds, share = time.perf_counter() - started, done / total
            progress(
                Progress(
                    share, "sampling", done, "replicas", done / seconds if seconds > 0 else 0.0,
                    seconds * (1.0 / share - 1.0), counts={"replicas": done},
                )
            )  # fmt: skip

    with ThreadPoolExecutor(workers) as pool:
        try:
            for run, first, count in tasks:
                waiting.append((count, pool.submit(run, first, count, halt.is_set)))
                if len(waiting) < 4 * workers:
                    continue
                done += waiting[0][0]
                yield waiting.popleft()[1].result()
                tell()
            while waiting:
                done += waiting[0][0]
                yield waiting.popleft()[1].result()
                tell()
        finally:
            halt.set()
            for _, future in waiting:
                future.cancel()


def _turns(samplers: Sequence[Sampler], replicas: int) -> Iterator[tuple[int, Sampler]]:
    for first in range(0, replicas, samplers[0].plan.replicas):
        for sampler in samplers:
            yield first, sampler
