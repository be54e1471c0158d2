"""The simulated rate of a model with a weighting, as methods need to know it."""

from __future__ import annotations

from typing import Any

from smolux.functions.content import frozen
from smolux.methods.base import Rates
from smolux.model import Model
from smolux.weighting.base import Weighting

from .bounds_cache import bounds_of, timed
from .tables import evaluated, latest


def rates_for(model: Model, weighting: Weighting) -> Rates:
    """Return what a method needs to know of the simulated rate."""
    kernel, weighting = frozen(model.kernel), frozen(weighting)
    weighted = weighting.weight is not None
    arrays = timed(weighting.arrays(evaluated(kernel)))

    @timed
    def table(largest: int) -> Any:
        return latest(kernel, weighting, arrays, largest)

    return Rates(
        (*kernel.parameters, *weighting.parameters),
        arrays,
        table,
        timed(bounds_of(kernel, weighting)),
        kernel.cheap and weighting.cheap,
        kernel.rigorous and weighting.rigorous,
        weighting.majorant(kernel),
        kernel if weighted else None,
        weighting.weights if weighted else None,
    )
