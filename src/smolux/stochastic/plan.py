"""The plan of a stochastic run: its settings, with nothing left open, of a model."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from smolux.core.state import Grid, TimeWindows
from smolux.errors import InputError
from smolux.functions.content import frozen
from smolux.initial import Initial
from smolux.methods.base import Method, Rates
from smolux.model import Model
from smolux.observables import observed
from smolux.runtime.resources import available_memory
from smolux.settings import PILOT, Settings
from smolux.settings.population import doubles_at
from smolux.settings.target_error import StoppingRule
from smolux.weighting.base import Weighting

from .assembly import loop_for
from .rates import rates_for
from .time_windows import inflow, time_windows_for


@dataclass(frozen=True, kw_only=True)
class Plan(Settings):
    """All that decides the outcome of a stochastic run.

    Its `replicas` are those planned so far: with a stopping rule more are added.

    Attributes
    ----------
    model : Model
        Frozen.
    asked : Settings
        What the user gave, and the seed that was drawn if none was given.
    reason, weighting_reason : str
        Why the method and the weighting were chosen, if they were.
    """

    model: Model
    asked: Settings
    method: Method
    weighting: Weighting
    seed: int
    reason: str = ""
    weighting_reason: str = ""

    @classmethod
    def of(cls, model: Model, settings: Settings, **decided: Any) -> Plan:
        """Make a plan of settings and what was decided beside them, or in place of them."""
        given = {f.name: getattr(settings, f.name) for f in fields(Settings)}
        return cls(**{"model": model, "asked": settings, **given, **decided})

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by value: frozen functions are found in no module."""
        import cloudpickle

        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return _unpickled, (cloudpickle.dumps(values),)

    @property
    def rule(self) -> StoppingRule | None:
        """What replicas are added for, if they are."""
        return self.asked.rule

    @cached_property
    def start(self) -> Initial:
        """The law of the simulated particles at the start: ``z_k = w(k) n_k``."""
        initial = self.model.initial
        if self.weighting.weight is None:
            return initial
        return initial.weighted(self.weighting.weights)

    @property
    def physics(self) -> Model:
        """The model as it is simulated, see `Model.reduced`."""
        return self.model.reduced

    @cached_property
    def rates(self) -> Rates:
        """What a method needs to know of the simulated rate."""
        return rates_for(self.physics, self.weighting)

    @cached_property
    def _windows(self) -> TimeWindows:
        return time_windows_for(
            self.model.processes, self.times[-1], self.weighting, self.model.kernel
        )

    def windows(self) -> TimeWindows:
        """Return bounds of the rate factors, which a run may correct as its own."""
        return TimeWindows(*(np.array(column) for column in self._windows))

    @cached_property
    def store(self) -> Method:
        """The method as particles are stored: with rows, if they carry anything."""
        return (self.method.carrying() or self.method) if self.model.attributes else self.method

    @cached_property
    def loop(self) -> Any:
        """The compiled loop."""
        return loop_for(self.physics, self.store, self.weighting)

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
        """Return the groups to begin with: pilots if replicas are added, else all replicas."""
        return self.groups(workers) if self.rule is None else self.pilots(workers)

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
    # sub-volumes are filled anew: what goes from one to the other is there besides
    mixing = 8 * plan.particles if plan.subvolumes > 1 else 0
    stores = (plan.replicas - done) * plan.store.bytes_per_replica(plan.particles) + mixing
    if observations + stores > 0.9 * available:
        raise InputError(
            f"the run needs about {(observations + stores) / 1e9:.1f} GB ({stores / 1e9:.1f} GB of "
            f"particles, {observations / 1e9:.1f} GB of observations) and this process may use "
            f"{available / 1e9:.1f} GB of memory: lower particles = {plan.particles}, "
            f"replicas = {plan.replicas}, sizes = {plan.sizes} or the number of times"
        )
