"""What decides the numbers of a simulation, besides its model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from smolux.errors import Problem

from .arguments import Arguments
from .kinds import Choice, Flag, Number, Orders, Registered, Text, Times, Whole, setting
from .population import POPULATIONS
from .target_error import FEWEST, StoppingRule, named

if TYPE_CHECKING:
    from smolux.methods.base import Method
    from smolux.model import Model
    from smolux.weighting.base import Weighting

#: the replicas from this number on are pilots, see `smolux.settings.target_error`
PILOT = 2**31
#: particles that a sub-volume has at least: with less, fewer sub-volumes are used
LEAST = 1000
#: densities that are given size by size at most; there are bins above
MOST_SIZES = 100_000_000

METHOD = Registered("smolux.methods", "METHODS", "NAMES", "Method")
WEIGHTING = Registered("smolux.weighting", "WEIGHTINGS", "NAMES", "Weighting")


@dataclass(frozen=True)
class Settings(Arguments):
    """The arguments of `smolux.simulate` that decide its numbers, as it describes them."""

    times: tuple[float, ...] = setting(Times(), kw_only=False)
    method: str | Method = setting(METHOD, "auto")
    weighting: str | Weighting = setting(WEIGHTING, "number")
    population: str = setting(Choice(POPULATIONS), "doubling")
    particles: int = setting(Whole(2, 2**50), 100_000)
    replicas: int = setting(Whole(1, PILOT - 1), 8)
    seed: int | None = setting(Whole(0, optional=True), None)
    orders: tuple[float, ...] = setting(Orders(), (0.0, 1.0, 2.0, 3.0))
    sizes: int = setting(Whole(1, MOST_SIZES), 1024)
    bins_per_octave: int = setting(Whole(1, 1024), 4)
    distribution: bool = setting(Flag(), False)
    target_error: float | None = setting(
        Number(
            lambda e: 0 < e < 1,
            "a number between 0 and 1, the half width of the 95 % interval over the mean, such "
            "as 0.001",
            optional=True,
        ),
        None,
    )
    target: str = setting(Text(), "number_density")
    max_replicas: int = setting(Whole(1, PILOT - 1), 1000)
    subvolumes: int = setting(Whole(1, 1024), 1)
    remix: float = setting(
        Number(
            lambda r: 0 < r <= 10,
            "a number of collisions for each particle, above 0 and at most 10",
        ),
        1.0,
    )

    @classmethod
    def disagreements(cls, good: Mapping[str, Any]) -> list[str]:
        problems: list[str] = []

        def known(*names: str) -> bool:
            return all(name in good for name in names)

        if known("target", "orders", "sizes"):
            named(good["target"], good["orders"], good["sizes"], problems)
        if good.get("weighting") == "auto" and good.get("target") == "largest":
            problems.append(
                Problem(
                    "target",
                    'with weighting = "auto" the largest of the simulated particles is another '
                    "quantity with each weighting; name a density or a moment as target, or a "
                    "weighting",
                    "largest",
                )
            )
        if known("subvolumes", "particles") and good["subvolumes"] > 1:
            parts, particles = good["subvolumes"], good["particles"]
            if particles < LEAST * parts:
                cure = (
                    f"each needs {LEAST} particles or more, and particles = {particles}: use fewer "
                    "sub-volumes, or several replicas instead"
                )
                problems.append(Problem("subvolumes", cure, parts))
        # what is not among the right ones was given
        if good.get("target_error", 1.0) is not None and "replicas" in good:
            problems += _too_few(good["replicas"], good.get("max_replicas"))
        return problems

    @classmethod
    def against(cls, model: Model, given: Mapping[str, Any]) -> list[str]:
        return _not_carried(given) if model.attributes else []

    @property
    def rule(self) -> StoppingRule | None:
        """What replicas are added for, if they are."""
        if self.target_error is None:
            return None
        return StoppingRule(self.target, self.target_error, self.replicas, self.max_replicas)


def _not_carried(given: Mapping[str, Any]) -> list[str]:
    """Say what does not go with particles that carry something."""
    problems: list[str] = []
    method = given.get("method", "auto")
    kinds = {m.name: m() for m in METHOD.entries()}
    carrying = [name for name, m in kinds.items() if m.carrying() is not None]
    if isinstance(method, str):
        method = kinds.get(method)
    if method is not None and getattr(method, "carrying", lambda: True)() is None:
        cure = f"its particles carry no composition; take {' or '.join(carrying)}"
        problems.append(Problem("method", cure, method.name))
    weighting = given.get("weighting", "number")
    if getattr(weighting, "name", weighting) != "number":
        cure = "a simulated particle stands for one, with its composition: take 'number'"
        problems.append(Problem("weighting", cure, getattr(weighting, "name", weighting)))
    if given.get("subvolumes", 1) != 1:
        cure = "compositions are not mixed among sub-volumes: take 1, and replicas instead"
        problems.append(Problem("subvolumes", cure, given["subvolumes"]))
    return problems


def _too_few(first: int, most: int | None) -> list[str]:
    """Say which numbers of replicas do not go with a target."""
    if first < FEWEST:
        cure = (
            f"with target_error at least {FEWEST}, with which the run begins; fewer say too little "
            "of the scatter"
        )
        return [Problem("replicas", cure, first)]
    if most is not None and most < first:
        return [Problem("max_replicas", f"must be at least replicas = {first!r}", most)]
    return []
