"""Particles are taken out of the system."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from smolux.checks import is_number
from smolux.errors import InputError, Problem

from .base import Float, RatedBySize, UnaryProcess
from .daughters import Nothing


def _vanish(k: int, part: int, sizes: Any, counts: Any) -> int:
    return 0


@dataclass(frozen=True)
class Removal(RatedBySize, UnaryProcess):
    """Particles leave the system: ``(k) -> nothing``, at a rate or as soon as they are too large.

    Parameters
    ----------
    rate : float, str, callable or sequence of float
        Rate for each size: a number, a formula in k, a function of the size, or the values for
        k = 1, 2, ... (the last one holds beyond).
    above : int, optional
        Particles of sizes above this leave at once.
    varying : float, callable or str
        A function of time by which the rate is multiplied.
    label : str, optional
        What it is called in results, if not by its name.
    """

    rate: Any = 0.0
    above: int | None = None
    varying: Any = 1.0
    name: ClassVar[str] = "removal"
    opens: ClassVar[bool] = True
    outcome: ClassVar[Callable[..., Any]] = staticmethod(_vanish)
    variables: ClassVar[Mapping[str, str]] = {"rate": "k", "varying": "t"}

    def __post_init__(self) -> None:
        problems = []
        for make in (
            lambda: self.factor,
            lambda: self.of_size,
        ):
            try:
                make()
            except InputError as error:
                problems += error.problems
        if self.above is not None:
            if not (
                is_number(self.above) and 1 <= self.above < 2**62 and float(self.above).is_integer()
            ):
                text = f"removal: above = {self.above!r}: must be a whole number of at least 1"
                problems.append(Problem.at(text, "above"))
            else:
                object.__setattr__(self, "above", int(self.above))
        elif not problems and self.of_size.constant == 0.0:
            problems.append(
                "removal: nothing would be removed: give a rate, or the size above which particles "
                "leave, as in Removal(above=1000)"
            )
        if problems:
            raise InputError(problems)

    def rates(self, sizes: Float) -> Float:
        return self.of_size(sizes)

    @property
    def daughters(self) -> Nothing:
        return Nothing()
