"""The weighting that is still to be chosen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .number import Number


@dataclass(frozen=True)
class Auto(Number):
    """Stands for the weighting that `smolux.pilot` finds, until a run is started.

    Parameters
    ----------
    target : str
        The observable that it is chosen for, as in `smolux.goal`.
    """

    target: str = "number_density"
    name: ClassVar[str] = "auto"
