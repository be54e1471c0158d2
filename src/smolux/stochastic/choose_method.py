"""The choice of a method for a plan, by what an event costs."""

from __future__ import annotations

from smolux.methods import AcceptanceRejection, Method, SizeClass
from smolux.methods.costs import Circumstances, choose, costs, unforeseen
from smolux.processes.base import PairProcess

from .plan import Plan

#: the replicas of a group depend on how many workers there are, the choice must not
_WORKERS = 2


def chosen_method(plan: Plan) -> tuple[Method, str]:
    """Return the method that is best for a plan, whatever its own is, and why."""
    if plan.model.attributes:
        return SizeClass(), "its particles carry their composition"
    if plan.subvolumes > 1:
        return SizeClass(), "it mixes sub-volumes in the least time"
    return unforeseen(plan.physics) or choose(_circumstances(plan))


def event_cost(plan: Plan) -> float:
    """Estimate what an event costs, relative to other weightings of the same run.

    By the method that was asked for, or by the best one if it is to be chosen. One where all
    weightings are alike or nothing is known.
    """
    auto = plan.asked.method == "auto"
    known = plan.subvolumes == 1 and unforeseen(plan.physics) is None
    direct = plan.asked.method in (AcceptanceRejection.name, AcceptanceRejection())
    if not known or not (auto or direct):
        return 1.0
    found, _ = costs(_circumstances(plan))
    return min(found.values()) if auto else found[AcceptanceRejection]


def _circumstances(plan: Plan) -> Circumstances:
    """Return what the estimate of costs takes."""
    initial = plan.model.initial
    sizes, counts = initial.sample(min(plan.particles, 1000), 0.5)
    mass = float(sizes @ counts)
    means = mass / float(counts.sum()), float(sizes.astype(float) ** 2 @ counts) / mass
    return Circumstances(
        plan.rates,
        [p for p in plan.physics.processes if isinstance(p, PairProcess)],
        plan.particles,
        initial.total,
        means,
        plan.times[-1],
        plan.groups(_WORKERS)[0][1],
        plan.doubles_at > 0,
    )
