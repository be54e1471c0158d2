"""Given sizes, each with its density."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from smolux.errors import InputError, Problem

from .base import LARGEST, Float, Initial, Int, as_number, is_above


@dataclass(frozen=True)
class Sizes(Initial):
    """Given number densities of given sizes; see `from_sizes`."""

    sizes: tuple[int, ...]
    densities_: tuple[float, ...]
    name: ClassVar[str] = "sizes"

    def __post_init__(self) -> None:
        problems = []
        if not self.sizes:
            problems.append("initial sizes: at least one size is needed, for example {1: 1.0}")
        problems += [
            Problem.at(
                f"initial size {s!r}: sizes are whole numbers from 1 to 2**61", "densities", str(s)
            )
            for s in self.sizes
            if not isinstance(s, int) or isinstance(s, bool) or not 1 <= s <= LARGEST
        ]
        problems += [
            Problem.at(
                f"initial density {d!r} of size {s}: must be a finite number, zero or more",
                "densities",
                str(s),
            )
            for s, d in zip(self.sizes, self.densities_, strict=True)
            if not (d == 0.0 or is_above(0.0, d))
        ]
        if self.sizes and not problems and sum(self.densities_) <= 0:
            problems.append("initial sizes: every density is zero")
        if problems:
            raise InputError(problems)

    @property
    def total(self) -> float:
        return float(sum(self.densities_))

    def _shares(self) -> Float:
        shares = np.cumsum(self.densities_) / self.total
        shares[-1] = 1.0
        return shares

    def cumulative(self, sizes: Float) -> Float:
        shares = np.concatenate(([0.0], self._shares()))
        return shares[np.searchsorted(self.sizes, sizes, side="right")]

    def quantile(self, share: Float) -> Int:
        index = np.searchsorted(self._shares(), share, side="right")
        return np.asarray(self.sizes, np.int64)[np.minimum(index, len(self.sizes) - 1)]

    def weighted(self, weights: Callable[[Float], Float]) -> Initial:
        found = np.array(self.densities_) * weights(np.array(self.sizes, float))
        return Sizes(self.sizes, tuple(found.tolist()))

    def densities(self, largest: int) -> Float:
        """See `Initial.densities`; exact, not a difference of shares."""
        n = np.zeros(largest)
        for size, density in zip(self.sizes, self.densities_, strict=True):
            if size <= largest:
                n[size - 1] = density
        return n

    @property
    def largest(self) -> int:
        return max(s for s, d in zip(self.sizes, self.densities_, strict=True) if d > 0)


def monodisperse(density: float = 1.0, size: int = 1) -> Sizes:
    """All particles have one size.

    Parameters
    ----------
    density : float
        Particles per unit volume.
    size : int
        Their size.
    """
    return from_sizes({size: density})


def from_sizes(densities: Mapping[int, float]) -> Sizes:
    """Give the number density of each size: ``{1: 0.1, 2: 0.1}``.

    Parameters
    ----------
    densities : mapping of int to float
        Size to particles per unit volume.
    """
    if not isinstance(densities, Mapping):
        raise InputError(
            f"initial sizes = {densities!r}: must map sizes to densities, as {{1: 0.5, 2: 0.5}}"
        )
    pairs = [(_whole(size), as_number(density)) for size, density in densities.items()]
    if all(isinstance(size, int) for size, _ in pairs):
        pairs.sort()
    return Sizes(tuple(size for size, _ in pairs), tuple(density for _, density in pairs))


def _whole(size: Any) -> Any:
    """Return a whole number as an int, and anything else as it is."""
    number = as_number(size)
    return int(size) if isinstance(number, float) and number.is_integer() else size
