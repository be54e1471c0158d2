"""From a model and arguments to a plan: all is checked, then weighting and method are chosen."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from smolux.functions.content import frozen
from smolux.methods import SizeClass
from smolux.model import Model
from smolux.settings import Settings
from smolux.settings.simulation import METHOD, WEIGHTING

from .choose_method import chosen_method
from .choose_weighting import chosen_weighting
from .plan import Plan, check_memory


def make_plan(model: Any, times: Any, **given: Any) -> Plan:
    """Check the arguments of `simulate`, all at once, and decide what they leave open.

    Raises
    ------
    InputError
        With every mistake, or if there is not enough memory.
    """
    return decided(frozen(model), Settings.for_model(model, {"times": times, **given}))


def decided(model: Model, settings: Settings) -> Plan:
    """Decide on seed, weighting and method; the model is frozen.

    Raises
    ------
    InputError
        If sizes at the start cannot be weighted, or there is not enough memory.
    """
    if settings.seed is None:
        settings = replace(settings, seed=int(np.random.SeedSequence().entropy))  # type: ignore[arg-type]
    reason = ""
    if settings.weighting == "auto":
        weighting, reason = chosen_weighting(model, settings)
    else:
        weighting = frozen(WEIGHTING.made(settings.weighting))
    plan = Plan.of(
        model, settings, method=SizeClass(), weighting=weighting, weighting_reason=reason
    )
    plan.start  # noqa: B018  initial sizes that cannot be weighted are refused here
    if settings.method == "auto":
        method, reason = chosen_method(plan)
        plan = replace(plan, method=method, reason=reason)
    else:
        plan = replace(plan, method=METHOD.made(settings.method))
    check_memory(plan)
    return plan
