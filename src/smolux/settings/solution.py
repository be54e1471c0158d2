"""What decides a solution of the rate equations, besides its model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from smolux.errors import Problem
from smolux.model import Model

from .arguments import Arguments
from .kinds import Choice, Flag, Number, Orders, Times, Whole, setting
from .simulation import MOST_SIZES

#: how sums over pairs are taken, and what a gel does, see `smolux.solve`
METHODS = ("auto", "direct", "low-rank")
GELS = ("inert", "reacts")
_SMALLEST = 4
#: arguments that say what is observed: in a case file those of the simulation
OBSERVED = ("orders", "sizes", "bins_per_octave")


@dataclass(frozen=True)
class SolverSettings(Arguments):
    """The arguments of `smolux.solve` that decide its numbers, as it describes them."""

    times: tuple[float, ...] = setting(Times(), kw_only=False)
    method: str = setting(Choice(METHODS), "auto")
    tolerance: float = setting(
        Number(lambda e: 1e-12 <= e <= 0.1, "a number from 1e-12 to 0.1; 1e-8 is usual"), 1e-8
    )
    window: int | None = setting(Whole(_SMALLEST, MOST_SIZES, optional=True), None)
    max_window: int | None = setting(Whole(_SMALLEST, MOST_SIZES, optional=True), None)
    orders: tuple[float, ...] = setting(Orders(), (0.0, 1.0, 2.0, 3.0))
    sizes: int = setting(Whole(1, MOST_SIZES), 1024)
    bins_per_octave: int = setting(Whole(1, 1024), 4)
    gel: str = setting(Choice(GELS), "inert")
    check: bool = setting(Flag(), False)

    @classmethod
    def disagreements(cls, good: Mapping[str, Any]) -> list[str]:
        window, most = good.get("window"), good.get("max_window")
        if window is None or most is None:
            return []
        cure = (
            f"with max_window = {most!r}: the first fixes the number of sizes, the second limits "
            "its growth: give one of them"
        )
        return [Problem("window", cure, window)]

    @classmethod
    def against(cls, model: Model, given: Mapping[str, Any]) -> list[str]:
        if given.get("gel") != "reacts" or model.only_aggregates:
            return []
        others = [p.name for p in model.processes if p.name != "aggregation"]
        cure = (
            f"is for aggregation alone, not with {', '.join(others)}: what a gel would leave then "
            "is not defined; use gel='inert'"
        )
        return [Problem("gel", cure, "reacts")]
