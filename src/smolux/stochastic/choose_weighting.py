"""The choice of a weighting by what it is worth for an observable, from a short pilot.

Weightings change how many simulated particles there are of which size, and how many events. Both
are seen in a few replicas of a small system: the efficiency ``1 / (cost variance)`` of one
weighting over that of another hardly depends on the number of particles. Cost is the number of
events times the estimate of what one costs by which methods are chosen, not the time that the pilot
took: the same arguments give the same choice on any machine.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from smolux.core.state import EVENTS, TRIALS
from smolux.methods import SizeClass
from smolux.model import Model
from smolux.observables import recorded
from smolux.settings import Settings
from smolux.settings.target_error import Target
from smolux.weighting import MassFlow, Number, WeightFunction
from smolux.weighting.base import Weighting

from .choose_method import event_cost
from .observe import observable
from .plan import Plan
from .replicas import Group

Float = NDArray[np.float64]

#: powers of the size that are tried; the first is preferred to those that are hardly better
_POWERS = (0.0, 0.5, 1.0, 1.5)
#: how many times as efficient another one must be: with so many replicas less may be chance
_WORTH = 1.3
#: particles of a replica, replicas that are run together, and at most
_PARTICLES, _TOGETHER, _REPLICAS = 500, 32, 256
#: output times, sizes that are counted one by one if none is asked for, and numbers observed
_TIMES, _SIZES, _OBSERVED = 16, 128, 4_000_000
#: what powers of the size add to the cost of an event, as a factor
_POWER_COST = 1.7
#: candidates and events for each power at most
_EFFORT = 10_000_000
#: clusters of one size that must be seen for a variance; below, it is taken to be that of a count
_SEEN = 100
#: which random numbers the pilots have
_STREAM = 5


@dataclass(frozen=True)
class _Trial:
    """What a pilot with one weighting gives.

    Attributes
    ----------
    values : ndarray of shape (R, T)
        The observable.
    present : ndarray of shape (R, T)
        Simulated particles that a density of one would be.
    cost : float
        Of a replica, up to a factor.
    """

    weighting: Weighting
    values: Float
    present: Float
    cost: float


def chosen_weighting(model: Model, settings: Settings) -> tuple[Weighting, str]:
    """Return the weighting that is worth most for the target, and why.

    The model is frozen, and the settings have a seed.
    """
    target = Target(settings.target)
    trials = list(_trials(model, settings, target))
    if len(trials) == len(_POWERS):
        return _compared(target, trials)
    return _by_rule_of_thumb(model, target)


def named(power: float) -> Weighting:
    """Return the weighting by a power of the size, the one compiled for it if there is one."""
    return {0.0: Number(), 1.0: MassFlow()}.get(power) or WeightFunction(power)


def _trials(model: Model, settings: Settings, target: Target) -> Iterator[_Trial]:
    """Run the pilots, as long as they come to their ends."""
    seeds = np.random.SeedSequence(settings.seed, spawn_key=(0, _STREAM)).generate_state(
        len(_POWERS), np.uint64
    )
    times = settings.times
    some = np.linspace(0, len(times) - 1, min(len(times), _TIMES)).astype(int)
    small = replace(
        settings,
        particles=min(settings.particles, _PARTICLES),
        times=tuple(times[k] for k in some),
        orders=(target.order or 0.0,),
        sizes=max(target.size or 1, min(settings.sizes, _SIZES)),
        bins_per_octave=1,
        distribution=False,
        subvolumes=1,
    )
    for power, seed in zip(_POWERS, seeds.tolist(), strict=True):
        # one compiled loop for all: the power is data
        given = Plan.of(
            model, small, method=SizeClass(), weighting=WeightFunction(power), seed=seed
        )
        # in the run itself
        meant = Plan.of(model, settings, method=SizeClass(), weighting=named(power))
        trial = _trial(given, target, meant)
        if trial is None:
            return
        yield trial


def _trial(small: Plan, target: Target, meant: Plan) -> _Trial | None:
    """Run one pilot; None if it takes too long."""
    values, present, events, effort = [], [], 0, 0
    together = max(1, min(_TOGETHER, _OBSERVED // (len(small.times) * small.sizes)))
    for first in range(0, _REPLICAS, together):
        group = Group.start(small, first, together)
        group.advance(lambda group=group: _effort(group) > _EFFORT)  # type: ignore[misc]
        effort += _effort(group)
        # that it came to its end in the last slice says something of the machine, and is left out
        if _effort(group) > _EFFORT:
            return None
        values.append(observable(small, target, [group])[0])
        present.append(recorded(group.tally, "volume").astype(float))
        events += int(group.state.events.sum())
        if effort > _EFFORT // 2:
            break
    weighting = meant.weighting
    if target.size is not None:
        weight = weighting.weights(np.array([float(target.size)]))[0]
        present = [weight * volume for volume in present]
    cost = events / (together * len(values)) * event_cost(meant)
    cost *= _POWER_COST if isinstance(weighting, WeightFunction) else 1.0
    return _Trial(weighting, np.concatenate(values), np.concatenate(present), cost)


def _effort(group: Group) -> int:
    return int(group.state.count[:, (TRIALS, EVENTS)].sum())


def _compared(target: Target, trials: list[_Trial]) -> tuple[Weighting, str]:
    """Choose the weighting that is worth most."""
    worst = _scatter(target, trials).max(axis=1)
    replicas = min(len(trial.values) for trial in trials)
    pilots = f"in pilots of {replicas} replicas or more"
    if not worst.max() > 0.0:
        return trials[0].weighting, f"{target.target} has no scatter {pilots}"
    with np.errstate(divide="ignore"):
        worth = 1.0 / (worst * [trial.cost for trial in trials])
        ratio = worth / worth[0]
    best = int(np.argmax(_WORTH * worth >= worth.max()))
    others = ", ".join(
        f"{_label(trial.weighting)} {r:.2g}" for trial, r in zip(trials[1:], ratio[1:], strict=True)
    )
    return trials[best].weighting, (
        f"efficiency for {target.target} over that of number {pilots}: {others}"
    )


def _scatter(target: Target, trials: list[_Trial]) -> Float:
    """Return the variance over the squared mean, for each trial and time.

    That of a size that is hardly seen is taken to be that of a count: one over the number that is
    expected, from the density that all trials together have seen. Times at which none has seen any
    are left out, unless all are so.
    """
    found = []
    count = np.sum([(trial.values * trial.present).sum(axis=0) for trial in trials], axis=0)
    density = np.maximum(count, 1.0) / sum(trial.present.sum(axis=0) for trial in trials)
    for trial in trials:
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = trial.values.mean(axis=0)
            spread = trial.values.var(axis=0, ddof=1)
            scatter = np.where(spread > 0.0, spread / mean**2, 0.0)
            if target.size is not None:
                rare = (trial.values * trial.present).sum(axis=0) < _SEEN
                expected = 1.0 / (density * trial.present.mean(axis=0))
                scatter = np.where(rare, expected, scatter)
        found.append(scatter)
    seen = count > 0.0 if target.size is not None and count.any() else np.ones(len(count), bool)
    return np.array(found)[:, seen]


def _label(weighting: Weighting) -> str:
    if isinstance(weighting, WeightFunction):
        return f"l^{weighting.exponent:g}"
    return weighting.name


def _by_rule_of_thumb(model: Model, target: Target) -> tuple[Weighting, str]:
    """Choose by the name of the observable alone."""
    sizes, counts = model.initial.sample(1000, 0.5) if model.initial.total else (1, 1)
    mean = float(np.sum(sizes * counts) / np.sum(counts))
    large = (target.order or 0.0) > 1.0 or (target.size or 0.0) > mean
    return (MassFlow() if large else Number()), (
        f"a pilot takes more than {_EFFORT:g} events; by rule mass-flow for moments of an order "
        "above 1 and sizes above the mean one at the start, number for all else"
    )
