"""Initial size distributions.

A distribution gives number densities of integer sizes. A simulation draws its particles by
systematic sampling, one uniform number for the whole population, so every size is met to within one
particle of its share and the expected counts are exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from .checks import is_number
from .errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]

#: the share of particles that a distribution without an end may leave out, and the largest double
#: below one
_TAIL = 2.0**-53
_BELOW_ONE = 1.0 - _TAIL


#: sizes are at most this at the start, so that two can still be added
_LARGEST = 1 << 61

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
        """See `Initial.total`."""
        return float(self._densities.sum())

    @property
    def largest(self) -> int:
        """See `Initial.largest`."""
        return len(self._densities)

    def cumulative(self, sizes: Float) -> Float:
        """See `Initial.cumulative`."""
        shares = np.concatenate(([0.0], np.cumsum(self._densities)))
        return (shares / shares[-1])[np.clip(sizes, 0, self.largest).astype(np.int64)]

    def quantile(self, share: Float) -> Int:
        """See `Initial.quantile`."""
        shares = np.cumsum(self._densities)
        place = np.searchsorted(shares / shares[-1], share, side="right")
        return np.asarray(np.minimum(place, self.largest - 1) + 1, np.int64)

    def densities(self, largest: int) -> Float:
        """See `Initial.densities`."""
        found = np.zeros(largest)
        found[: min(largest, self.largest)] = self._densities[:largest]
        return found


def _number(value: Any) -> Any:
    """Return a number as a float, and anything else as it is, to be refused by name."""
    return float(value) if is_number(value) else value


def _beyond(least: float, value: Any) -> bool:
    """Whether a value is a finite number above `least`."""
    number = _number(value)
    return isinstance(number, float) and math.isfinite(number) and number > least


def _positive(problems: list[str], **values: float) -> None:
    problems += [
        f"{key} = {value!r}: must be a positive finite number"
        for key, value in values.items()
        if not _beyond(0.0, value)
    ]


def _raise(problems: list[str], law: Initial, most: float) -> None:
    """Raise for every problem, or if the sizes reach beyond what can be counted."""
    if most > _LARGEST:
        problems.append(f"{law!r}: reaches the size {most:.3g}; sizes are at most 2**61 = 2.3e18")
    if problems:
        raise InputError(problems)


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
            f"initial size {s!r}: sizes are whole numbers from 1 to 2**61"
            for s in self.sizes
            if not isinstance(s, int) or isinstance(s, bool) or not 1 <= s <= _LARGEST
        ]
        problems += [
            f"initial density {d!r} of size {s}: must be a finite number, zero or more"
            for s, d in zip(self.sizes, self.densities_, strict=True)
            if not (d == 0.0 or _beyond(0.0, d))
        ]
        if self.sizes and not problems and sum(self.densities_) <= 0:
            problems.append("initial sizes: every density is zero")
        if problems:
            raise InputError(problems)

    @property
    def total(self) -> float:
        """See `Initial.total`."""
        return float(sum(self.densities_))

    def _shares(self) -> Float:
        shares = np.cumsum(self.densities_) / self.total
        shares[-1] = 1.0
        return shares

    def cumulative(self, sizes: Float) -> Float:
        """See `Initial.cumulative`."""
        shares = np.concatenate(([0.0], self._shares()))
        return shares[np.searchsorted(self.sizes, sizes, side="right")]

    def quantile(self, share: Float) -> Int:
        """See `Initial.quantile`."""
        index = np.searchsorted(self._shares(), share, side="right")
        return np.asarray(self.sizes, np.int64)[np.minimum(index, len(self.sizes) - 1)]

    def weighted(self, weights: Callable[[Float], Float]) -> Initial:
        """See `Initial.weighted`."""
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
        """See `Initial.largest`."""
        return max(s for s, d in zip(self.sizes, self.densities_, strict=True) if d > 0)


@dataclass(frozen=True)
class Empty(Initial):
    """No particles at all; see `empty`."""

    name: ClassVar[str] = "empty"

    @property
    def total(self) -> float:
        """See `Initial.total`."""
        return 0.0

    @property
    def largest(self) -> int:
        """See `Initial.largest`."""
        return 1

    def cumulative(self, sizes: Float) -> Float:
        """See `Initial.cumulative`."""
        return np.ones(np.shape(sizes))

    def quantile(self, share: Float) -> Int:
        """See `Initial.quantile`."""
        return np.ones(np.shape(share), np.int64)

    def weighted(self, weights: Callable[[Float], Float]) -> Initial:
        """See `Initial.weighted`."""
        return self

    def densities(self, largest: int) -> Float:
        """See `Initial.densities`."""
        return np.zeros(largest)

    def sample(self, particles: int, u: float) -> tuple[Int, Int]:
        """See `Initial.sample`."""
        return np.ones(1, np.int64), np.zeros(1, np.int64)


@dataclass(frozen=True)
class Exponential(Initial):
    """Geometric law ``n_k ~ exp(-k / c)`` on the whole sizes; see `exponential`."""

    mean: float
    density: float = 1.0
    name: ClassVar[str] = "exponential"

    def __post_init__(self) -> None:
        problems: list[str] = []
        _positive(problems, density=self.density)
        if not (_beyond(0.0, self.mean) and self.mean >= 1):
            problems.append(f"mean = {self.mean!r}: the mean size must be a number of at least 1")
        _raise(problems, self, 0.0 if problems else 37.0 * self.mean)

    @property
    def total(self) -> float:
        """See `Initial.total`."""
        return self.density

    @property
    def _log_ratio(self) -> float:
        return float(np.log1p(-1.0 / self.mean)) if self.mean > 1 else -np.inf

    def cumulative(self, sizes: Float) -> Float:
        """See `Initial.cumulative`."""
        sizes = np.floor(np.asarray(sizes, float))
        if self.mean == 1:
            return (sizes >= 1).astype(float)
        return -np.expm1(np.maximum(sizes, 0) * self._log_ratio)

    def densities(self, largest: int) -> Float:
        """See `Initial.densities`; exact far into the tail."""
        if self.mean == 1:
            return self.density * (np.arange(1, largest + 1) == 1)
        return self.density / self.mean * np.exp(np.arange(largest) * self._log_ratio)

    def quantile(self, share: Float) -> Int:
        """See `Initial.quantile`."""
        if self.mean == 1:
            return np.ones(np.shape(share), np.int64)
        return np.floor(np.log1p(-np.asarray(share)) / self._log_ratio).astype(np.int64) + 1


@dataclass(frozen=True)
class Lognormal(Initial):
    """Lognormal law rounded to whole sizes; see `lognormal`."""

    median: float
    sigma: float
    density: float = 1.0
    name: ClassVar[str] = "lognormal"

    def __post_init__(self) -> None:
        problems: list[str] = []
        _positive(problems, median=self.median, density=self.density)
        if not _beyond(1.0, self.sigma):
            problems.append(
                f"sigma = {self.sigma!r}: the geometric standard deviation must exceed 1 "
                "(1.3 is narrow, 2 is wide)"
            )
        most = 0.0
        if not problems:  # the tail is cut off 8.2 standard deviations from the median
            most = math.exp(min(math.log(self.median) + 8.3 * math.log(self.sigma), 700.0))
        _raise(problems, self, most)

    @property
    def total(self) -> float:
        """See `Initial.total`."""
        return self.density

    def cumulative(self, sizes: Float) -> Float:
        """See `Initial.cumulative`; what lies below 1/2 counts as size 1."""
        sizes = np.floor(np.asarray(sizes, float))
        z = np.log(np.maximum(sizes, 1) / self.median + 0.5 / self.median) / np.log(self.sigma)
        from scipy import special

        return np.where(sizes >= 1, special.ndtr(z), 0.0)

    def quantile(self, share: Float) -> Int:
        """See `Initial.quantile`."""
        from scipy import special

        size = self.median * self.sigma ** special.ndtri(np.asarray(share, float))
        return np.maximum(np.ceil(size - 0.5), 1).astype(np.int64)


def empty() -> Empty:
    """No particles at the start: for systems with a source.

    The volume of a simulation is then chosen so that the sources bring in as many `particles` in a
    unit of time, at their rates at time zero; it is never doubled.
    """
    return Empty()


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
    pairs = [(_whole(size), _number(density)) for size, density in densities.items()]
    if all(isinstance(size, int) for size, _ in pairs):
        pairs.sort()
    return Sizes(tuple(size for size, _ in pairs), tuple(density for _, density in pairs))


def _whole(size: Any) -> Any:
    """Return a whole number as an int, and anything else as it is."""
    number = _number(size)
    return int(size) if isinstance(number, float) and number.is_integer() else size


def exponential(mean: float, density: float = 1.0) -> Exponential:
    """Sizes exponentially (on whole numbers: geometrically) distributed.

    Parameters
    ----------
    mean : float
        Mean size, at least 1.
    density : float
        Particles per unit volume.
    """
    return Exponential(_number(mean), _number(density))


def lognormal(median: float, sigma: float, density: float = 1.0) -> Lognormal:
    """Sizes lognormally distributed, rounded to whole numbers of at least 1.

    Parameters
    ----------
    median : float
        Median size (count median).
    sigma : float
        Geometric standard deviation, above 1.
    density : float
        Particles per unit volume.
    """
    return Lognormal(_number(median), _number(sigma), _number(density))


#: every initial condition; case files know it by its ``name``, and one size as "monodisperse"
INITIALS: tuple[type[Initial], ...] = (Sizes, Exponential, Lognormal, Empty)
