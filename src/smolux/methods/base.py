"""What every method has: how the next pair is found and how particles are stored for that."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from smolux.core.loop import Pieces
from smolux.core.state import State
from smolux.kernels.majorant import Majorant

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Words = NDArray[np.uint64]
#: sizes of particles, and what each carries, see `smolux.core.rows`
Rows = tuple[Int, Int]


@dataclass(frozen=True)
class Rates:
    """The simulated pair rate, as a method needs to know it.

    Attributes
    ----------
    parameters : tuple of float
    arrays : callable
        ``arrays(i, j)`` on arrays of sizes.
    table : callable
        ``table(largest)``: rates of the sizes ``1 .. largest`` with each other.
    bounds : callable
        See `smolux.kernels.base.Kernel.bounds`.
    cheap : bool
        Whether reading a table costs as much as computing the rate.
    rigorous : bool
        Whether `bounds` is proved.
    majorant : Majorant, optional
        A majorant of low rank for all sizes, if one is known.
    physical : callable, optional
        The rate of the kernel on arrays of sizes, if it is another one.
    weights : callable, optional
        ``weights(sizes)``: simulated particles for a particle of each size, if not one.
    """

    parameters: tuple[float, ...]
    arrays: Callable[[Any, Any], Float]
    table: Callable[[int], Float]
    bounds: Callable[..., tuple[Float, Float]]
    cheap: bool
    rigorous: bool
    majorant: Majorant | None = None
    physical: Callable[[Any, Any], Float] | None = None
    weights: Callable[[Any], Float] | None = None


class Method:
    """A way to draw the next event of the jump process.

    A method is a frozen dataclass of its settings. Its pieces, made by `bind`, are compiled; the
    rest runs in Python.

    Attributes
    ----------
    name : str
        The name in `simulate`, in case files and in the registry `METHODS`.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    reference: ClassVar[str] = ""

    #: the NamedTuple of arrays that `new_work` returns
    work_type: ClassVar[type]

    @staticmethod
    def bind(rate: Any, tally: Any) -> Pieces:
        """Return the compiled pieces for a rate, the compiled ``rate(i, j, *p)``.

        `tally` is what counts particles, see `smolux.core.record.tally_one`.
        """
        raise NotImplementedError

    def new_work(
        self, rates: Rates, populations: list[tuple[Int, Int]], state: State, mass: int
    ) -> Any:
        """Store the initial populations (sizes, counts), one a replica, and return the work arrays.

        `mass` bounds the mass of every replica at its start, and is the same for all groups of
        replicas.
        """
        raise NotImplementedError

    def grow(self, work: Any, state: State) -> Any:
        """Return the work arrays with more room; those given stay as they are if there is none."""
        raise NotImplementedError

    def growth(self, work: Any, state: State) -> int:
        """Return the bytes of the arrays that `grow` would make, or a little more."""
        return 2 * size_of(work)

    def supply_bound(self, work: Any, rates: Rates, state: State, replica: int) -> None:
        """Compute the bound for which the loop returned `BOUND`."""
        raise NotImplementedError

    def held(self, work: Any, state: State, replica: int) -> tuple[Int, Int]:
        """Return what a store holds: particles of each size 0, 1, ... counted, and single sizes."""
        raise NotImplementedError

    def population(self, work: Any, state: State, replica: int) -> tuple[Int, Int]:
        """Return the sizes present, ascending, and their counts."""
        counted, single = self.held(work, state, replica)
        small = np.flatnonzero(counted)
        large, counts = np.unique(single, return_counts=True)
        return (
            np.concatenate((small, large)).astype(np.int64),
            np.concatenate((counted[small], counts)).astype(np.int64),
        )

    def split(self, work: Any, state: State, number: int, copies: int, words: Words) -> list[Any]:
        """Put every particle of a store of one replica `copies` times into one of several parts.

        Each part is as likely as the others, and decided by the random `words` alone.
        """
        sizes, counts = self.population(work, state, 0)
        rng = np.random.default_rng(words)
        shares = rng.multinomial(copies * counts, np.full(number, 1 / number))
        return [(sizes[mine > 0], mine[mine > 0]) for mine in shares.T]

    def collect(self, rates: Rates, parts: list[Any], state: State, mass: int) -> Any:
        """Return the work arrays of one replica with what `split` has put into these parts."""
        sizes, counts = merged(parts)
        if not sizes.size:  # all have left: a size of which there is none, as in an empty start
            sizes, counts = np.ones(1, np.int64), np.zeros(1, np.int64)
        return self.new_work(rates, [(sizes, counts)], state, mass)

    def carried(self, work: Any, state: State) -> Any:
        """Return what was found out so far that holds for other stores of one replica, or None."""
        return None

    def carry_over(self, work: Any, state: State, carried: list[Any]) -> None:
        """Take over what `carried` has returned for other stores with the same rates."""

    def bytes_per_replica(self, particles: int) -> int:
        """Estimate the memory of one replica at its start."""
        raise NotImplementedError

    def carrying(self) -> Method | None:
        """Return this method for particles with rows, see `smolux.core.rows`; None if none is.

        It starts by `carrying_work`.
        """
        return None

    def carrying_work(
        self, rates: Rates, particles: list[Rows], born: Int, state: State, mass: int
    ) -> Any:
        """Store particles with their rows, of each replica, as `new_work` does without rows.

        `born` is that of `smolux.core.rows`.
        """
        raise NotImplementedError

    def rows(self, work: Any, state: State, replica: int) -> Rows:
        """Return the particles of a replica with their rows."""
        raise NotImplementedError


def spread(sizes: Int, counts: Int, out: Int) -> None:
    """Write every size as often as it counts, in batches: `numpy.repeat` would hold all twice."""
    ends = np.cumsum(counts)
    for start in range(0, len(out), 1 << 20):
        places = np.arange(start, min(start + (1 << 20), len(out)))
        out[places[0] : places[-1] + 1] = sizes[np.searchsorted(ends, places, side="right")]


def merged(populations: list[tuple[Int, Int]]) -> tuple[Int, Int]:
    """Return the sizes of all populations, ascending, and their counts."""
    given, numbers = (np.concatenate(arrays) for arrays in zip(*populations, strict=True))
    sizes, where = np.unique(given, return_inverse=True)
    counts = np.zeros(len(sizes), np.int64)
    np.add.at(counts, where, numbers)
    return sizes, counts


def size_of(arrays: Any) -> int:
    """Bytes of the arrays of a named tuple."""
    return sum(array.nbytes for array in arrays)


def enlarged(array: NDArray[Any], capacity: int) -> NDArray[Any]:
    """Return a copy whose last axis has a larger capacity."""
    new = np.zeros((*array.shape[:-1], capacity), array.dtype)
    new[..., : array.shape[-1]] = array
    return new
