"""From the tallies of groups of replicas to records."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smolux import observables
from smolux.core.state import AT, DOUBLINGS, HIGHEST
from smolux.results.records import Records
from smolux.settings.target_error import Target

from .carrying import composition_of
from .plan import Plan
from .replicas import Group
from .subvolumes import SubvolumeReplica
from .totals import Totals, attempts_of

Float = NDArray[np.float64]


class Seen:
    """What groups have seen, by replica and time; NaN where a replica did not come to it."""

    def __init__(self, plan: Plan, groups: Sequence[Group | SubvolumeReplica]) -> None:
        self.plan, self.groups = plan, groups

    def _tallied(self, name: str) -> NDArray[Any]:
        return np.concatenate([getattr(g.tally, name) for g in self.groups])

    @cached_property
    def scalars(self) -> Float:
        """What is recorded as such, see `smolux.core.state.Tally`."""
        return self._tallied("scalars").astype(float, copy=False)

    @cached_property
    def missing(self) -> NDArray[np.bool_]:
        """Where nothing is recorded."""
        return np.isnan(self.scalars[..., AT])

    def recorded(self, name: str) -> Float:
        """Return an observable that is a column of the state, as it was recorded."""
        found = [observables.recorded(g.tally, name) for g in self.groups]
        values = np.concatenate(found).astype(float)
        values[self.missing] = np.nan
        return values

    @cached_property
    def volume(self) -> Float:
        """Simulated volume."""
        return self.recorded("volume")

    @cached_property
    def sizes(self) -> Float:
        """Sizes that are counted one by one."""
        return np.arange(1, self.plan.sizes + 1, dtype=float)

    @cached_property
    def stood(self) -> Float:
        """What the particles of each of these stand for."""
        return self._tallied("counts")[:, :, 1:] * self.plan.weighting.stands_for(self.sizes)

    @cached_property
    def bins(self) -> Float:
        """What those of other sizes stand for, by bins."""
        return self._tallied("bins").astype(float, copy=False)

    @cached_property
    def used(self) -> int:
        """How many bins there are up to the last in which anything was seen."""
        return int(np.max(np.nonzero(self.bins.any(axis=(0, 1)))[0], initial=-1)) + 1

    @cached_property
    def sums(self) -> Float:
        """Sums of powers of those sizes."""
        return self._tallied("sums").astype(float, copy=False)

    @cached_property
    def attempts(self) -> Float:
        """Candidates for each process up to the end."""
        return attempts_of(self.plan, self.groups)

    def number_density(self) -> Float:
        """Return what there is of all sizes for a unit of volume."""
        if self.plan.weighting.weight is None:
            return self.recorded("particles") / self.volume
        weights = self.plan.weighting.stands_for(self.sizes)
        tallies = (g.tally for g in self.groups)
        stood = [t.counts[:, :, 1:] @ weights + t.bins.sum(axis=-1) for t in tallies]
        return np.asarray(np.concatenate(stood) / self.volume)

    def moment(self) -> Float:
        """Return the moments; whole numbers until the last step, so that the mass is exact."""
        powers = self.sizes[:, None] ** np.array(self.plan.orders)
        sums = self.sums[..., : len(self.plan.orders)]
        return (self.stood @ powers + sums) / self.volume[..., None]

    def mass(self) -> Float:
        """Return the mass in the simulated volume, for which the grid has the last sum."""
        return np.where(self.missing, np.nan, self.stood @ self.sizes + self.sums[..., -1])

    @cached_property
    def rows(self) -> Float:
        """What was observed of the rows, see `smolux.stochastic.carrying.observe_rows`."""
        found = self._tallied("rows")
        found[self.missing] = np.nan
        return found

    def carried(self, sized: bool) -> tuple[Float, Float]:
        """Return mean and variance over the particles of each size, or of each bin."""
        first = self.plan.sizes
        counts = self._tallied("counts")[:, :, 1:] if sized else self.bins[:, :, : self.used]
        part = slice(0, first) if sized else slice(first, first + self.used)
        sums = self.rows[:, :, part]
        with np.errstate(all="ignore"):
            mean = sums[..., 0] / np.where(counts > 0, counts, np.nan)[..., None]
            square = sums[..., 1] / np.where(counts > 0, counts, np.nan)[..., None]
        return mean, np.maximum(square - mean**2, 0.0)

    def mixing(self) -> Float:
        """Return the scatter of the composition by mass, over that of pure particles."""
        x, square = self.rows[..., -2, :, 0], self.rows[..., -2, :, 1]
        with np.errstate(all="ignore"):
            mass = x.sum(axis=-1)
            pure = mass - (x**2).sum(axis=-1) / mass
            found = (square - x**2 / mass[..., None]).sum(axis=-1) / pure
        return np.where(pure > 0.0, found, np.nan)


#: observables that are no column of the state
COMPUTED: dict[str, Callable[[Seen], Float]] = {
    "number_density": Seen.number_density,
    "moment": Seen.moment,
    "largest": lambda seen: seen.scalars[..., HIGHEST],
    "n": lambda seen: seen.stood / seen.volume[..., None],
    "n_bin": lambda seen: seen.bins[:, :, : seen.used] / seen.volume[..., None],
    "attempts": lambda seen: seen.attempts,
    "mass": Seen.mass,
    "composition": lambda seen: seen.carried(sized=True)[0],
    "composition_variance": lambda seen: seen.carried(sized=True)[1],
    "fraction_bin": lambda seen: seen.carried(sized=False)[0],
    "fraction_bin_variance": lambda seen: seen.carried(sized=False)[1],
    "monomers": lambda seen: seen.rows[..., -2, :, 0],
    "mixing": Seen.mixing,
    "monomers_in": lambda seen: seen.rows[..., -1, :, 0],
    "monomers_out": lambda seen: seen.rows[..., -1, :, 1],
}
#: observables of systems that are open alone
_OPEN = ("mass", "mass_in", "mass_out")
#: those of particles that carry a composition, and of open systems of these
_CARRIED = (
    "composition", "composition_variance", "fraction_bin", "fraction_bin_variance", "monomers",
    "mixing",
)  # fmt: skip
_CARRIED_OPEN = ("monomers_in", "monomers_out")


def to_records(plan: Plan, groups: Sequence[Group | SubvolumeReplica]) -> Records:
    """Turn counts into densities; output times not reached are NaN.

    Parameters
    ----------
    plan : Plan
    groups : sequence of Group
        In the order of their replicas.
    """
    seen, values = Seen(plan, groups), {}
    for o in observables.OBSERVABLES:
        if o.name in (*_OPEN, *_CARRIED_OPEN) and not plan.model.open:
            continue
        if o.name in (*_CARRIED, *_CARRIED_OPEN) and not plan.model.attributes:
            continue
        if o.name in COMPUTED:
            values[o.name] = COMPUTED[o.name](seen)
        elif o.recorded:
            values[o.name] = seen.recorded(o.name)
        else:
            values[o.name] = np.concatenate([o.ended(g.state) for g in groups]).astype(float)
    edges = plan.grid.edges.astype(float)
    return Records(
        times=np.array(plan.times),
        orders=np.array(plan.orders),
        processes=tuple(process.called for process in plan.model.processes),
        bin_edges=np.append(edges, 2.0**62)[: seen.used + 1],
        values=values,
        distribution=[rows for g in groups for rows in g.distribution]
        if plan.distribution
        else None,
        joint=[rows for g in groups for rows in getattr(g, "joint", [])]
        if plan.distribution and plan.model.attributes
        else None,
        components=composition_of(plan).kinds if plan.model.attributes else (),
        attributes=_attributes(plan, groups),
        warnings=Totals.of(groups, seen.attempts).warnings(plan),
    )


def observable(
    plan: Plan, target: Target, groups: Sequence[Group | SubvolumeReplica]
) -> tuple[Float, NDArray[np.bool_]]:
    """Return an observable at all output times of replicas that are done.

    Returns
    -------
    values : ndarray of shape (R, T)
    moved : ndarray of bool, shape (T,)
        Whether anything has happened in any replica.
    """
    seen = Seen(plan, groups)
    if target.target == "largest":
        values = seen.scalars[..., HIGHEST]
    elif target.size is not None:
        count = np.concatenate([g.tally.counts[:, :, target.size] for g in groups])
        values = count * plan.weighting.stands_for(np.array([float(target.size)])) / seen.volume
    elif target.order is not None:
        powers = seen.sizes**target.order * plan.weighting.stands_for(seen.sizes)
        column = plan.orders.index(target.order)
        sums = [g.tally.counts[:, :, 1:] @ powers + g.tally.sums[..., column] for g in groups]
        values = np.concatenate(sums) / seen.volume
    else:
        values = seen.number_density()
    events, collisions = seen.recorded("events"), seen.recorded("collisions")
    come, gone = seen.recorded("mass_in"), seen.recorded("mass_out")
    moved = (collisions > 0) | (events > 0).any(axis=-1) | (come > 0) | (gone > 0)
    return values, np.asarray(moved.any(axis=0))


def _attributes(plan: Plan, groups: Sequence[Group | SubvolumeReplica]) -> dict[str, object]:
    rule = plan.rule
    wanted = {} if rule is None else {"target": rule.target, "target_error": rule.error}
    return wanted | {
        "method": plan.method.name,
        "method_reason": plan.reason or "asked for",
        "method_settings": dict(vars(plan.method)),
        "weighting": plan.weighting.name,
        "weighting_reason": plan.weighting_reason or "asked for",
        "weighting_settings": plan.weighting.settings,
        "population": plan.population,
        "initial_particles": plan.particles,
        "subvolumes": plan.subvolumes,
        "seed": str(plan.seed),
        "doublings": int(max(g.state.count[:, DOUBLINGS].max() for g in groups)),
        "events": sum(g.events for g in groups),
        "compute_seconds": sum(g.seconds for g in groups),
        "bounds_seconds": sum(g.bounds_seconds for g in groups),
        "compile_seconds": max(g.compile_seconds for g in groups),
        "complete": all(g.done for g in groups),
    }
