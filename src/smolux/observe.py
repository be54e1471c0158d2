"""From the tallies of groups of replicas to records."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .core.state import DOUBLINGS, EXTINCT
from .goal import Goal
from .plan import Plan
from .records import Records
from .replicas import Group
from .subvolumes import Divided
from .totals import Totals, attempts_of

Float = NDArray[np.float64]


def to_records(plan: Plan, groups: Sequence[Group | Divided]) -> Records:
    """Turn counts into densities; output times not reached are NaN.

    Parameters
    ----------
    plan : Plan
    groups : sequence of Group
        In the order of their replicas.
    """
    scalars = np.concatenate([g.tally.scalars for g in groups])
    _, particles, collisions, volume, largest, come, gone = np.moveaxis(scalars, -1, 0)
    missing = np.isnan(volume)
    counts = np.concatenate([g.tally.counts for g in groups])[:, :, 1:]
    bins = np.concatenate([g.tally.bins for g in groups])
    used = int(np.max(np.nonzero(bins.any(axis=(0, 1)))[0], initial=-1)) + 1
    sizes = np.arange(1, plan.sizes + 1, dtype=float)
    weights = plan.weighting.stands_for(sizes)
    v = volume[..., None]  # NaN where missing, so that all that follows is too
    stood = counts * weights
    sums = np.concatenate([g.tally.sums for g in groups])
    powers = sizes[:, None] ** np.array(plan.orders)
    inside = np.where(missing, np.nan, stood @ sizes + sums[..., -1])
    sums = sums[..., : len(plan.orders)]
    events = np.concatenate([g.tally.events for g in groups]).astype(float)
    events[missing] = np.nan
    clock = np.concatenate([g.state.clock for g in groups])
    edges = plan.grid.edges.astype(float)
    attempts = attempts_of(plan, groups)
    return Records(
        times=np.array(plan.times),
        orders=np.array(plan.orders),
        processes=tuple(process.name for process in plan.model.processes),
        bin_edges=np.append(edges, 2.0**62)[: used + 1],
        number_density=_number_density(plan, groups, particles, volume),
        largest=largest,
        particles=particles,
        collisions=collisions,
        volume=volume,
        moment=(stood @ powers + sums) / v,  # whole numbers until here: the mass is exact
        n=stood / v,
        n_bin=bins[:, :, :used] / v,
        events=events,
        attempts=attempts,
        extinction_time=clock[:, EXTINCT],
        distribution=[rows for g in groups for rows in g.distribution]
        if plan.distribution
        else None,
        balance=(inside, come, gone) if plan.model.open else None,
        attributes=_attributes(plan, groups),
        warnings=Totals.of(groups, attempts).warnings(plan),
    )


def _number_density(
    plan: Plan, groups: Sequence[Group | Divided], particles: Float, volume: Float
) -> Float:
    if plan.weighting.weight is None:
        return particles / volume
    weights = plan.weighting.stands_for(np.arange(1.0, plan.sizes + 1.0))
    stood = [g.tally.counts[:, :, 1:] @ weights + g.tally.bins.sum(axis=-1) for g in groups]
    return np.asarray(np.concatenate(stood) / volume)


def observable(
    plan: Plan, goal: Goal, groups: Sequence[Group | Divided]
) -> tuple[Float, NDArray[np.bool_]]:
    """Return what a goal is about, at all output times of replicas that are done.

    Returns
    -------
    values : ndarray of shape (R, T)
    moved : ndarray of bool, shape (T,)
        Whether anything has happened in any replica.
    """
    scalars = np.concatenate([g.tally.scalars for g in groups])
    _, particles, collisions, volume, largest, come, gone = np.moveaxis(scalars, -1, 0)
    values = _number_density(plan, groups, particles, volume)
    if goal.target == "largest":
        values = largest
    elif goal.size is not None:
        count = np.concatenate([g.tally.counts[:, :, goal.size] for g in groups])
        values = count * plan.weighting.stands_for(np.array([float(goal.size)])) / volume
    elif goal.order is not None:
        sizes = np.arange(1, plan.sizes + 1, dtype=float)
        powers = sizes**goal.order * plan.weighting.stands_for(sizes)
        column = plan.orders.index(goal.order)
        sums = [g.tally.counts[:, :, 1:] @ powers + g.tally.sums[..., column] for g in groups]
        values = np.concatenate(sums) / volume
    events = np.concatenate([g.tally.events for g in groups])
    moved = (collisions > 0) | (events > 0).any(axis=-1) | (come > 0) | (gone > 0)
    return values, moved.any(axis=0)


def _attributes(plan: Plan, groups: Sequence[Group | Divided]) -> dict[str, object]:
    goal = plan.goal
    wanted = {} if goal is None else {"target": goal.target, "target_error": goal.error}
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
