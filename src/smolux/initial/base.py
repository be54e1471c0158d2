"""A size distribution: what it gives, and how a population is drawn from it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from smolux.checks import is_number
from smolux.errors import InputError, Problem

Float = NDArray[np.float64]
Int = NDArray[np.int64]

#: the share of particles that a distribution without an end may leave out, and the largest double
#: below one
_TAIL = 2.0**-53
_BELOW_ONE = 1.0 - _TAIL

#: sizes are at most this at the start, so that two can still be added
LARGEST = 1 << 61

#: distributions up to this size are sampled size by size, others particle by particle in batches
_TABULATED = 1 << 20
_BATCH = 1 << 22
#: distributions up to this size can be weighted
_WEIGHTED = 1 << 22


@dataclass(frozen=True)
class Initial:
    """A size distribution at time zero: `density` particles per unit volume in all."""

    name: ClassVar[str]

    @property
    def total(self) -> float:
        """Number of particles per unit volume."""
        raise NotImplementedError

    def cumulative(self, sizes: Float) -> Float:
        """Share of the particles whose size is at most `sizes`."""
        raise NotImplementedError

    def quantile(self, share: Float) -> Int:
        """Smallest size below or at which `share` of the particles lie."""
        raise NotImplementedError

    def densities(self, largest: int) -> Float:
        """Return number densities of the sizes ``1 .. largest``."""
        edges = self.cumulative(np.arange(0, largest + 1, dtype=float))
        return self.total * np.diff(edges)

    @property
    def largest(self) -> int:
        """The largest size that is present, or beyond which a share of 1e-16 lies."""
        return int(self.quantile(np.array([_BELOW_ONE]))[0])

    @property
    def remarks(self) -> list[str]:
        """What should be known of it; stands among the warnings of every result."""
        return []

    def weighted(self, weights: Callable[[Float], Float]) -> Initial:
        """Return the law whose densities are those of this one times ``weights(sizes)``.

        Raises
        ------
        InputError
            If there are too many sizes.
        """
        if self.largest > _WEIGHTED:
            raise InputError(
                f"{self!r}: reaches the size {self.largest:.3g}; with a weighting other than "
                f"'number' initial sizes go to {_WEIGHTED} at most, or are listed one by one"
            )
        densities = self.densities(self.largest)
        return Tabulated(densities * weights(np.arange(1.0, self.largest + 1.0)))

    def sample(self, particles: int, u: float) -> tuple[Int, Int]:
        """Draw a population by systematic sampling.

        Parameters
        ----------
        particles : int
            How many.
        u : float
            A uniform number in [0, 1).

        Returns
        -------
        sizes, counts : ndarray of int64
            The sizes present, ascending, and how many particles have each.
        """
        if self.largest <= _TABULATED:
            shares = self.cumulative(np.arange(self.largest + 1, dtype=float))
            shares[-1] = 1.0
            before = np.clip(np.ceil(shares * particles - u), 0, particles).astype(np.int64)
            counts = np.diff(before)
            return np.flatnonzero(counts) + 1, counts[counts > 0]
        drawn = [
            np.unique(
                self.quantile((np.arange(a, min(a + _BATCH, particles)) + u) / particles),
                return_counts=True,
            )
            for a in range(0, particles, _BATCH)
        ]
        size, inverse = np.unique(np.concatenate([s for s, _ in drawn]), return_inverse=True)
        return size, np.bincount(inverse, np.concatenate([c for _, c in drawn])).astype(np.int64)


class Tabulated(Initial):
    """Number densities of the sizes 1, 2, ..., as an array."""

    name: ClassVar[str] = "tabulated"

    def __init__(self, densities: Float) -> None:
        self._densities = densities

    @property
    def total(self) -> float:
        return float(self._densities.sum())

    @property
    def largest(self) -> int:
        return len(self._densities)

    def cumulative(self, sizes: Float) -> Float:
        shares = np.concatenate(([0.0], np.cumsum(self._densities)))
        return (shares / shares[-1])[np.clip(sizes, 0, self.largest).astype(np.int64)]

    def quantile(self, share: Float) -> Int:
        shares = np.cumsum(self._densities)
        place = np.searchsorted(shares / shares[-1], share, side="right")
        return np.asarray(np.minimum(place, self.largest - 1) + 1, np.int64)

    def densities(self, largest: int) -> Float:
        found = np.zeros(largest)
        found[: min(largest, self.largest)] = self._densities[:largest]
        return found


def as_number(value: Any) -> Any:
    """Return a number as a float, and anything else as it is, to be refused by name."""
    return float(value) if is_number(value) else value


def is_above(least: float, value: Any) -> bool:
    """Whether a value is a finite number above `least`."""
    number = as_number(value)
    return isinstance(number, float) and math.isfinite(number) and number > least


def check_positive(problems: list[str], **values: float) -> None:
    """Note every value that is no positive finite number."""
    problems += [
        Problem(key, "must be a positive finite number", value)
        for key, value in values.items()
        if not is_above(0.0, value)
    ]


def refuse(problems: list[str], law: Initial, most: float) -> None:
    """Raise for every problem, or if the sizes reach beyond what can be counted."""
    if most > LARGEST:
        problems.append(f"{law!r}: reaches the size {most:.3g}; sizes are at most 2**61 = 2.3e18")
    if problems:
        raise InputError(problems)
