"""From the tallies of groups of replicas to records."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .core.state import DOUBLINGS, EXTINCT
from .plan import Plan
from .records import Records
from .replicas import Group


def to_records(plan: Plan, groups: Sequence[Group]) -> Records:
    """Turn counts into densities; output times not reached are NaN.

    Parameters
    ----------
    plan : Plan
    groups : sequence of Group
        In the order of their replicas.
    """
    scalars = np.concatenate([g.tally.scalars for g in groups])
    _, particles, collisions, volume, largest = np.moveaxis(scalars, -1, 0)
    missing = np.isnan(volume)
    counts = np.concatenate([g.tally.counts for g in groups])[:, :, 1:]
    bins = np.concatenate([g.tally.bins for g in groups])
    used = int(np.max(np.nonzero(bins.any(axis=(0, 1)))[0], initial=-1)) + 1
    sizes = np.arange(1, plan.sizes + 1, dtype=float)
    weights = plan.weighting.stands_for(sizes)
    per_volume = 1.0 / volume[..., None]  # NaN where missing, so that all that follows is too
    n = counts * weights * per_volume
    sums = np.concatenate([g.tally.sums for g in groups])
    moment = n @ (sizes[:, None] ** np.array(plan.orders)[None, :]) + sums * per_volume
    events = np.concatenate([g.tally.events for g in groups]).astype(float)
    events[missing] = np.nan
    clock = np.concatenate([g.state.clock for g in groups])
    edges = plan.grid.edges.astype(float)
    return Records(
        times=np.array(plan.times),
        orders=np.array(plan.orders),
        processes=tuple(process.name for process in plan.model.processes),
        bin_edges=np.append(edges, 2.0**62)[: used + 1],
        number_density=particles / volume,
        largest=largest,
        particles=particles,
        collisions=collisions,
        volume=volume,
        moment=moment,
        n=n,
        n_bin=bins[:, :, :used] * per_volume,
        events=events,
        extinction_time=clock[:, EXTINCT],
        distribution=[rows for g in groups for rows in g.distribution]
        if plan.distribution
        else None,
        attributes=_attributes(plan, groups),
        warnings=_warnings(groups, int(missing.any(axis=1).sum())),
    )


def _attributes(plan: Plan, groups: Sequence[Group]) -> dict[str, object]:
    return {
        "method": plan.method.name,
        "method_settings": dict(vars(plan.method)),
        "weighting": plan.weighting.name,
        "population": plan.population,
        "initial_particles": plan.particles,
        "seed": str(plan.entropy),
        "doublings": int(max(g.state.count[:, DOUBLINGS].max() for g in groups)),
        "events": sum(g.events for g in groups),
        "compute_seconds": sum(g.seconds for g in groups),
        "compile_seconds": max(g.compile_seconds for g in groups),
        "complete": all(g.done for g in groups),
    }


def _warnings(groups: Sequence[Group], unfinished: int) -> list[str]:
    found = dict.fromkeys(text for g in groups for text in g.findings())
    extinct = np.concatenate([g.state.clock[:, EXTINCT] for g in groups])
    count = int(np.isfinite(extinct).sum())
    if count:
        found[
            f"{count} of {len(extinct)} replicas ended as one cluster (extinction), the first at "
            f"t = {np.nanmin(extinct):.6g}: more particles, or population='doubling', put this off"
        ] = None
    if unfinished:
        found[f"{unfinished} replicas did not reach the last output time"] = None
    return list(found)
