"""The plan of a stochastic run: all that decides its outcome, checked once."""

from __future__ import annotations

import math
import pickle
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .assembly import rates_for
from .checks import is_number, numbers, orders_of_moments, whole
from .content import frozen
from .core.state import Grid
from .errors import InputError, did_you_mean
from .goal import Goal, make_goal
from .initial import Initial
from .methods import METHODS, AcceptanceRejection, SizeClass
from .methods.auto import Auto, Circumstances, choose, costs, unforeseen
from .methods.base import Method
from .model import Model
from .observables import observed
from .population import POPULATIONS, doubles_at
from .processes.base import PairProcess
from .resources import available_memory
from .weighting import WEIGHTINGS
from .weighting.auto import Auto as AutoWeighting
from .weighting.base import Weighting
from .windows import inflow

#: particles that a sub-volume has at least: with less, fewer sub-volumes are used
LEAST = 1000


#: the replicas from this number on are pilots, see `smolux.goal`
PILOT = 2**31


@dataclass(frozen=True)
class Plan:
    """All that decides the outcome of a stochastic run."""

    model: Model
    times: tuple[float, ...]
    method: Method
    weighting: Weighting
    population: str
    particles: int
    replicas: int
    entropy: int
    orders: tuple[float, ...]
    sizes: int
    bins_per_octave: int
    distribution: bool
    #: why the method was chosen, if it was
    reason: str = ""
    #: what replicas are added for; `replicas` are those planned so far
    goal: Goal | None = None
    #: parts of each replica that are simulated side by side, and collisions for each particle
    #: from one mixing to the next
    subvolumes: int = 1
    remix: float = 1.0
    #: why the weighting was chosen, if it was
    weighting_reason: str = ""

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by value: frozen functions are found in no module."""
        import cloudpickle

        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return _unpickled, (cloudpickle.dumps(values),)

    @cached_property
    def start(self) -> Initial:
        """The law of the simulated particles at the start: ``z_k = w(k) n_k``."""
        initial = self.model.initial
        if self.weighting.weight is None:
            return initial
        return initial.weighted(self.weighting.weights)

    @property
    def volume(self) -> float:
        """Volume simulated at the start."""
        if self.start.total > 0.0:
            return self.particles / self.start.total
        # so many particles come in per unit of time
        return self.particles / inflow(self.model.processes, self.weighting, self.times[-1])

    @property
    def doubles_at(self) -> int:
        """How few particles double the volume, 0 for never: as what begins empty."""
        return doubles_at(self.population, self.particles) if self.start.total > 0.0 else 0

    @property
    def mass(self) -> int:
        """What the mass of no replica exceeds at its start."""
        return self.particles * self.start.largest

    @cached_property
    def grid(self) -> Grid:
        """Output times, bin edges above the exact sizes, orders of moments."""
        first = self.sizes + 1
        steps = np.arange(int((62 - np.log2(first)) * self.bins_per_octave) + 1)
        edges = np.unique([int(first * 2.0 ** (k / self.bins_per_octave)) for k in steps])
        # the mass itself is looked at where it may change
        orders = (*self.orders, 1.0) if self.model.open else self.orders
        edges = edges.astype(np.int64)
        octaves = np.int64(1) << np.arange(63)
        before = np.maximum(np.searchsorted(edges, octaves, side="right") - 1, 0)
        return observed(np.array(self.times), edges, np.array(orders), before)

    def begin(self, workers: int) -> list[tuple[int, int]]:
        """Return the groups to begin with: pilots if there is a goal, else all replicas."""
        return self.groups(workers) if self.goal is None else self.pilots(workers)

    def pilots(self, workers: int, start: int = 0) -> list[tuple[int, int]]:
        """Split as many pilots as there are replicas, with random numbers of their own."""
        return [(PILOT + first, count) for first, count in self.groups(workers, start)]

    def groups(self, workers: int, start: int = 0) -> list[tuple[int, int]]:
        """Split the replicas from `start` on: first and number of each group."""
        together = max(1, 200_000 // self.particles) if self.subvolumes == 1 else 1
        each = max(1, min(together, -(-(self.replicas - start) // max(workers, 1))))
        return [(r, min(each, self.replicas - r)) for r in range(start, self.replicas, each)]


def _unpickled(values: bytes) -> Plan:
    return Plan(**frozen(pickle.loads(values)))


def make_plan(
    model: Model,
    times: ArrayLike,
    method: str | Method,
    weighting: str | Weighting,
    population: str,
    particles: int,
    replicas: int,
    seed: int | None,
    orders: Sequence[float],
    sizes: int,
    bins_per_octave: int,
    distribution: bool,
    target_error: float | None = None,
    target: str = "number_density",
    max_replicas: int = 1000,
    subvolumes: int = 1,
    remix: float = 1.0,
) -> Plan:
    """Check the arguments of `simulate`, all at once; parameters as there.

    A weighting that is to be chosen is left to `smolux.pilot.settled`.

    Raises
    ------
    InputError
        With every mistake.
    """
    problems: list[str] = []
    if not isinstance(model, Model):
        problems.append(f"model = {model!r}: must be a smolux.Model(kernel=..., ...)")
    found = {
        "method": _chosen("method", method, (*METHODS, Auto), Method, problems),
        "weighting": _chosen(
            "weighting", weighting, (*WEIGHTINGS, AutoWeighting), Weighting, problems
        ),
    }
    if isinstance(found["weighting"], AutoWeighting):
        found["weighting"] = AutoWeighting(target)
        if target == "largest":
            problems.append(
                'weighting = "auto", target = "largest": the largest of the simulated particles is '
                "another quantity with each weighting; name a density or a moment as target, or a "
                "weighting"
            )
    if population not in POPULATIONS:
        problems.append(
            f"population = {population!r}: unknown"
            + did_you_mean(str(population), list(POPULATIONS))
        )
    numbers = {
        "particles": _whole("particles", particles, 2, problems),
        "replicas": _whole("replicas", replicas, 1, problems),
        "sizes": _whole("sizes", sizes, 1, problems),
        "bins_per_octave": _whole("bins_per_octave", bins_per_octave, 1, problems, 1024),
    }
    entropy = (
        np.random.SeedSequence().entropy if seed is None else _whole("seed", seed, 0, problems)
    )
    output = check_times(times, problems)
    powers = _orders(orders, problems)
    parts = _subvolumes(subvolumes, remix, numbers["particles"], problems)
    goal = make_goal(
        target_error, target, max_replicas, replicas, powers, numbers["sizes"], problems
    )
    if problems:
        raise InputError(problems)
    found["weighting"] = frozen(found["weighting"])
    plan = Plan(
        model=frozen(model),
        times=output,
        population=population,
        entropy=int(entropy),  # type: ignore[arg-type]
        orders=powers,
        distribution=bool(distribution),
        goal=goal,
        subvolumes=parts,
        remix=float(remix),
        **found,
        **numbers,  # type: ignore[arg-type]
    )
    plan.start  # noqa: B018  initial sizes that cannot be weighted are refused here
    if isinstance(plan.method, Auto):
        plan = with_method(plan)
    check_memory(plan)
    return plan


#: the replicas of a group depend on how many workers there are, the choice must not
_WORKERS = 2


def with_method(plan: Plan) -> Plan:
    """Let the method be chosen."""
    if plan.subvolumes > 1:
        return replace(plan, method=SizeClass(), reason="it mixes sub-volumes in the least time")
    chosen = unforeseen(plan.model.processes) or choose(_circumstances(plan))
    return replace(plan, method=chosen[0], reason=chosen[1])


def event_cost(plan: Plan) -> float:
    """Estimate what an event costs, relative to other weightings of the same run.

    By the method of the plan, or by the best one if it was chosen. One where all weightings are
    alike or nothing is known.
    """
    known = plan.subvolumes == 1 and unforeseen(plan.model.processes) is None
    if not known or not (plan.reason or isinstance(plan.method, AcceptanceRejection)):
        return 1.0
    found, _ = costs(_circumstances(plan))
    return min(found.values()) if plan.reason else found[AcceptanceRejection]


def _circumstances(plan: Plan) -> Circumstances:
    """Return what the estimate of costs takes."""
    initial = plan.model.initial
    sizes, counts = initial.sample(min(plan.particles, 1000), 0.5)
    mass = float(sizes @ counts)
    means = mass / float(counts.sum()), float(sizes.astype(float) ** 2 @ counts) / mass
    return Circumstances(
        rates_for(plan.model, plan.weighting),
        [p for p in plan.model.processes if isinstance(p, PairProcess)],
        plan.particles,
        initial.total,
        means,
        plan.times[-1],
        plan.groups(_WORKERS)[0][1],
        plan.doubles_at > 0,
    )


def _chosen(what: str, value: Any, registry: Sequence[Any], kind: type, problems: list[str]) -> Any:
    if isinstance(value, kind):
        return value
    names = {entry.name: entry for entry in registry}
    if isinstance(value, str) and value in names:
        return names[value]()
    problems.append(f"{what} = {value!r}: unknown{did_you_mean(str(value), list(names))}")
    return None


def _whole(what: str, value: Any, least: int, problems: list[str], most: float = math.inf) -> int:
    number = whole(value)
    if number is not None and least <= number <= most:
        return number
    limits = f"of at least {least}" if most == math.inf else f"from {least} to {most}"
    problems.append(f"{what} = {value!r}: must be a whole number {limits}")
    return least


def _subvolumes(subvolumes: Any, remix: Any, particles: int, problems: list[str]) -> int:
    parts = _whole("subvolumes", subvolumes, 1, problems)
    if parts > 1 and particles < LEAST * parts:
        problems.append(
            f"subvolumes = {parts}: each needs {LEAST} particles or more, and particles = "
            f"{particles}: use fewer sub-volumes, or several replicas instead"
        )
    if not (is_number(remix) and 0 < remix <= 10):
        problems.append(
            f"remix = {remix!r}: must be a number of collisions for each particle, above 0 and "
            "at most 10"
        )
    return parts


def _orders(orders: Any, problems: list[str]) -> tuple[float, ...]:
    try:
        return tuple(orders_of_moments(orders).tolist())
    except InputError as error:
        problems += error.problems
        return ()


def check_times(times: ArrayLike, problems: list[str]) -> tuple[float, ...]:
    """Return output times as floats; add what is wrong with them to `problems`."""
    try:
        output = np.atleast_1d(numbers("times", times))
    except InputError as error:
        problems += error.problems
        return ()
    if output.ndim != 1 or not output.size:
        problems.append(f"times = {times!r}: must be a list of at least one number")
    elif not (np.isfinite(output).all() and output[0] >= 0 and output[-1] > 0):
        problems.append(f"times = {times!r}: must be finite, zero or more, and end above zero")
    elif (np.diff(output) <= 0).any():
        k = int(np.argmax(np.diff(output) <= 0))
        problems.append(f"times: must ascend, but {output[k + 1]:g} follows {output[k]:g}")
    return tuple(float(t) for t in output.ravel())


def check_memory(plan: Plan, done: int = 0) -> None:
    """Refuse a run whose arrays cannot fit, before anything is computed.

    Of the replicas that are `done`, only what was observed is kept.

    Raises
    ------
    InputError
    """
    available = available_memory()
    if available is None:
        return
    grid = plan.grid
    row = 8 * (plan.sizes + len(grid.edges) + len(grid.orders) + 8)
    observations = plan.replicas * len(plan.times) * row
    # sub-volumes are dealt out anew: what goes from one to the other is there besides
    mixing = 8 * plan.particles if plan.subvolumes > 1 else 0
    stores = (plan.replicas - done) * plan.method.bytes_per_replica(plan.particles) + mixing
    if observations + stores > 0.9 * available:
        raise InputError(
            f"the run needs about {(observations + stores) / 1e9:.1f} GB ({stores / 1e9:.1f} GB of "
            f"particles, {observations / 1e9:.1f} GB of observations) and this process may use "
            f"{available / 1e9:.1f} GB of memory: lower particles = {plan.particles}, "
            f"replicas = {plan.replicas}, sizes = {plan.sizes} or the number of times"
        )
