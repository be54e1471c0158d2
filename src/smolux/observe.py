"""From the tallies of groups of replicas to records."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .core.splits import EXACT
from .core.state import (
    BY_FACTOR,
    BY_KERNEL,
    BY_SPLITS,
    CLOCKS,
    DOUBLINGS,
    EVENTS,
    EXTINCT,
    FLOOR,
    RAISED,
    REPAIRS,
    TRIALS,
    WORST_I,
    WORST_J,
)
from .plan import Plan
from .processes.base import LoneProcess, PairProcess
from .records import Records
from .replicas import Group
from .subvolumes import Divided

Float = NDArray[np.float64]

#: share of candidates that become events, below which a run of so many of them warns
_RARE, _MANY = 1e-3, 1e5


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
        attempts=_attempts(plan, groups),
        extinction_time=clock[:, EXTINCT],
        distribution=[rows for g in groups for rows in g.distribution]
        if plan.distribution
        else None,
        balance=(inside, come, gone) if plan.model.open else None,
        attributes=_attributes(plan, groups),
        warnings=_warnings(plan, groups, int(missing.any(axis=1).sum())),
    )


def _attempts(plan: Plan, groups: Sequence[Group | Divided]) -> Float:
    """Candidates for each process, of shape (R, P).

    Which process an encounter belongs to is decided last: its candidates are shared among the
    processes of pairs in the ratio of their events.
    """
    found = np.concatenate([g.state.attempts for g in groups]).astype(float)
    pairs = sum(isinstance(process, PairProcess) for process in plan.model.processes)
    alone = pairs + sum(isinstance(process, LoneProcess) for process in plan.model.processes)
    if pairs:
        trials = np.concatenate([g.state.count[:, TRIALS] for g in groups])
        events = np.concatenate([g.state.events[:, :pairs] for g in groups]).astype(float)
        total = events.sum(axis=1, keepdims=True)
        share = np.divide(events, total, out=np.full(events.shape, 1 / pairs), where=total > 0)
        found[:, :pairs] = share * (trials - found[:, pairs:alone].sum(axis=1))[:, None]
    return found


def _rarely_accepted(plan: Plan, groups: Sequence[Group | Divided]) -> list[str]:
    """Warn of processes for which nearly all candidates come to nothing."""
    attempts = _attempts(plan, groups).sum(axis=0)
    events = np.concatenate([g.state.events for g in groups]).sum(axis=0)
    found = []
    for process, tried, done in zip(plan.model.processes, attempts, events, strict=True):
        # after every event of any kind a candidate for an encounter is drawn afresh
        each = events.sum() if isinstance(process, PairProcess) else done
        if tried >= _MANY and each < _RARE * tried:
            cure = (
                "another method, or 'auto', may be much faster"
                if isinstance(process, PairProcess)
                else "its rate differs much among sizes or splits that are nearly the same"
            )
            found.append(
                f"{process.name}: {tried:.3g} candidates for {done} events, fewer than 1 in "
                f"{1 / _RARE:g}; the result is right, but took long: {cure}"
            )
    return found


def _number_density(
    plan: Plan, groups: Sequence[Group | Divided], particles: Float, volume: Float
) -> Float:
    if plan.weighting.weight is None:
        return particles / volume
    weights = plan.weighting.stands_for(np.arange(1.0, plan.sizes + 1.0))
    stood = [g.tally.counts[:, :, 1:] @ weights + g.tally.bins.sum(axis=-1) for g in groups]
    return np.asarray(np.concatenate(stood) / volume)


def observable(plan: Plan, groups: Sequence[Group | Divided]) -> tuple[Float, NDArray[np.bool_]]:
    """Return what the goal of a plan is about, at all output times of replicas that are done.

    Returns
    -------
    values : ndarray of shape (R, T)
    moved : ndarray of bool, shape (T,)
        Whether anything has happened in any replica.
    """
    assert plan.goal is not None
    scalars = np.concatenate([g.tally.scalars for g in groups])
    _, particles, collisions, volume, largest, *_ = np.moveaxis(scalars, -1, 0)
    values = _number_density(plan, groups, particles, volume)
    if plan.goal.target == "largest":
        values = largest
    elif plan.goal.size is not None:
        count = np.concatenate([g.tally.counts[:, :, plan.goal.size] for g in groups])
        values = count * plan.weighting.stands_for(np.array([float(plan.goal.size)])) / volume
    elif plan.goal.order is not None:
        sizes = np.arange(1, plan.sizes + 1, dtype=float)
        powers = sizes**plan.goal.order * plan.weighting.stands_for(sizes)
        column = plan.orders.index(plan.goal.order)
        sums = [g.tally.counts[:, :, 1:] @ powers + g.tally.sums[..., column] for g in groups]
        values = np.concatenate(sums) / volume
    return values, (collisions > 0).any(axis=0)


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
        "seed": str(plan.entropy),
        "doublings": int(max(g.state.count[:, DOUBLINGS].max() for g in groups)),
        "events": sum(g.events for g in groups),
        "compute_seconds": sum(g.seconds for g in groups),
        "bounds_seconds": sum(g.bounds_seconds for g in groups),
        "compile_seconds": max(g.compile_seconds for g in groups),
        "complete": all(g.done for g in groups),
    }


def _lacking(missed: float, events: int) -> str:
    """Say how many events did not take place, by the estimate of `smolux.core.loop.repair`."""
    share = missed / max(events + missed, 1.0)
    return f"an estimated {missed:.3g} of its events, {share:.2g} of all, did not take place"


def _broken_bounds(plan: Plan, groups: Sequence[Group | Divided]) -> list[str]:
    """Say which bounds did not hold, and how many events did not take place before a repair."""
    count = np.concatenate([g.state.count for g in groups])
    clock = np.concatenate([g.state.clock for g in groups])
    missed = np.concatenate([g.state.missed for g in groups]).sum(axis=0)
    events = np.concatenate([g.state.events for g in groups]).sum(axis=0)
    found = []
    repairs = int(count[:, REPAIRS].sum())
    if repairs:
        i, j = count[clock[:, FLOOR].argmax(), [WORST_I, WORST_J]]
        lacking = _lacking(missed[BY_KERNEL], int(count[:, EVENTS].sum()))
        found.append(
            f"the kernel was found above its bound {repairs} times in {count[:, TRIALS].sum()} "
            f"candidates, for example at the sizes {i} and {j}: {lacking}, give or take "
            f"{1.0 / np.sqrt(repairs):.0%} of that, before the bound was raised, besides what no "
            "candidate has met. A kernel written as a formula, or bounds= of from_function that "
            "hold, have no such error"
        )
    splits = [isinstance(p, LoneProcess) and p.splits for p in plan.model.processes]
    cure = "A formula in i and j has proved bounds; of a function, from_function takes them"
    name = f"fragmentation, for a size above {EXACT},"
    _add(found, name, clock[:, RAISED], missed[BY_SPLITS], events[splits].sum(), cure)
    cure = "A formula in t has proved bounds; of a function, smolux.law states them"
    for k, process in enumerate(plan.model.processes):
        name = f"{process.name}, {process.factor.text},"
        _add(found, name, clock[:, CLOCKS + k], missed[BY_FACTOR + k], events[k], cure)
    return found


def _add(found: list[str], name: str, raised: Float, missed: float, events: int, cure: str) -> None:
    """Add a warning if the bound of a rate was `raised` in one of the replicas."""
    replicas = int((raised > 0.0).sum())
    if replicas:
        found.append(
            f"the rate of {name} was found above its sampled bound in {replicas} of {len(raised)} "
            f"replicas: {_lacking(missed, int(events))} before the bound was raised, besides what "
            f"no candidate has met. {cure}"
        )


def _warnings(plan: Plan, groups: Sequence[Group | Divided], unfinished: int) -> list[str]:
    clock = np.concatenate([g.state.clock for g in groups])
    found = [*plan.model.initial.remarks, *_broken_bounds(plan, groups)]
    found += _rarely_accepted(plan, groups)
    extinct = clock[:, EXTINCT]
    ended = int(np.isfinite(extinct).sum())
    if ended:
        found.append(
            f"{ended} of {len(extinct)} replicas ended as one cluster (extinction), the first at "
            f"t = {np.nanmin(extinct):.6g}: more particles, or population='doubling', put this off"
        )
    if unfinished:
        found.append(f"{unfinished} replicas did not reach the last output time")
    return found
