"""Terms of the rate equations on a lattice of sizes, made of what processes say of themselves.

Each term also keeps the account of its process: how many events there are, what number and what
mass of particles they should make and take. These come from what the process is, not from the terms
that the sizes get, so that both can be compared.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from smolux.model import Model
from smolux.processes.base import Process, UnaryProcess
from smolux.processes.daughters import Debris, Detached, Merged, Nothing, Split
from smolux.processes.source import Source

from .meeting import Meeting
from .splitting import Splits

Float = NDArray[np.float64]

#: what is integrated along beside the events, and the places of what leaves
SUMS = 5
MASS_OUT, OVER_MASS = -3, -1


class Flow:
    """Rates of the densities, and the account of them, of S densities at once.

    Parameters
    ----------
    n : ndarray of shape (S, M)
    processes : int
        The number of processes P.

    Attributes
    ----------
    rates : ndarray of shape (S, M)
        ``dn/dt``.
    along : ndarray of shape (S, P + 5)
        What is integrated along: all of the following.
    events : ndarray of shape (S, P)
        Of each process, per unit volume and time.
    number : ndarray of shape (S,)
        Change of the number of particles in the window.
    mass_in, mass_out : ndarray of shape (S,)
    over_number, over_mass : ndarray of shape (S,)
        What goes beyond the last size.
    """

    def __init__(self, n: Float, processes: int) -> None:
        self.rates = np.zeros_like(n)
        self.along = np.zeros((len(n), processes + SUMS))
        self.events = self.along[:, :processes]
        self.number, self.mass_in, self.mass_out, self.over_number, self.over_mass = self.along[
            :, processes:
        ].T

    def leave(self) -> None:
        """Take out of the system what goes beyond the last size."""
        self.mass_out += self.over_mass
        self.over_mass[:] = self.over_number[:] = 0.0


@dataclass(frozen=True)
class Totals:
    """What was integrated along, by name; see `Flow`."""

    events: Float
    number: float
    mass_in: float
    mass_out: float
    over_number: float
    over_mass: float

    @property
    def mass(self) -> float:
        """Change of the mass in the window."""
        return self.mass_in - self.mass_out - self.over_mass

    @classmethod
    def of(cls, along: Float) -> Totals:
        """Read what was integrated along."""
        return cls(along[:-SUMS].copy(), *(float(x) for x in along[-SUMS:]))


class Term(Protocol):
    """Of one process, on one lattice."""

    @property
    def vanishing(self) -> Float | None:
        """Rate at which a particle of each size vanishes by itself; None for pairs and sources."""

    def add(self, p: int, factor: Float, n: Float, meeting: Meeting, flow: Flow) -> None:
        """Add to `flow` what process number p does at `factor`, shape (S,), times its rate."""


class Merging:
    """``gain - loss``: two particles become one."""

    vanishing = None

    def add(self, p: int, factor: Float, n: Float, meeting: Meeting, flow: Flow) -> None:
        """See `Term.add`."""
        over_number, over_mass = meeting.over
        flow.rates += factor[:, None] * (meeting.gain - meeting.loss)
        flow.events[:, p] += factor * meeting.pairs
        flow.number -= factor * (meeting.pairs + over_number)
        flow.over_number += factor * over_number
        flow.over_mass += factor * over_mass


class FallingApart:
    """Both particles of a pair become fragments, as many as their mass makes.

    Pairs that together are larger than the last size make as many more as those of that size as
    their mass is larger: so the mean numbers grow for large masses.
    """

    vanishing = None

    def __init__(self, debris: Debris, count: int) -> None:
        self._by_mass = debris.by_mass[:count]
        self._by_mass /= self._by_mass @ np.arange(1.0, len(self._by_mass) + 1.0)
        self._numbers = None if debris.numbers is None else debris.numbers(count)

    def add(self, p: int, factor: Float, n: Float, meeting: Meeting, flow: Flow) -> None:
        """See `Term.add`."""
        made = self._made(meeting)
        flow.rates -= factor[:, None] * meeting.loss
        flow.rates[:, : made.shape[1]] += factor[:, None] * made
        flow.events[:, p] += factor * meeting.pairs
        flow.number += factor * (made.sum(axis=1) - 2.0 * meeting.pairs)

    def _made(self, meeting: Meeting) -> Float:
        if self._numbers is None:
            return meeting.mass[:, None] * self._by_mass
        number, mass = meeting.over
        beyond = mass - len(self._numbers) * number
        return (
            meeting.gain @ self._numbers
            + number[:, None] * self._numbers[-1]
            + beyond[:, None] * self._by_mass
        )


class Leaving:
    """Particles leave the system."""

    def __init__(self, rates: Float, sizes: Float) -> None:
        self.vanishing, self._sizes = rates, sizes

    def add(self, p: int, factor: Float, n: Float, meeting: Meeting, flow: Flow) -> None:
        """See `Term.add`."""
        lost = factor[:, None] * self.vanishing * n
        flow.rates -= lost
        events = lost.sum(axis=1)
        flow.events[:, p] += events
        flow.number -= events
        flow.mass_out += lost @ self._sizes


class Detaching:
    """A piece of a given size comes off."""

    def __init__(self, rates: Float, piece: int) -> None:
        self.vanishing, self._piece = rates, piece
        self.vanishing[:piece] = 0.0

    def add(self, p: int, factor: Float, n: Float, meeting: Meeting, flow: Flow) -> None:
        """See `Term.add`."""
        lost = factor[:, None] * self.vanishing * n
        events, piece = lost.sum(axis=1), self._piece
        flow.rates -= lost
        flow.rates[:, :-piece] += lost[:, piece:]
        flow.rates[:, piece - 1] += events
        flow.events[:, p] += events
        flow.number += events


class Splitting:
    """A particle falls into two."""

    def __init__(self, splits: Splits) -> None:
        self._splits = splits
        self.vanishing = splits.rates

    def add(self, p: int, factor: Float, n: Float, meeting: Meeting, flow: Flow) -> None:
        """See `Term.add`."""
        lost = self.vanishing * n
        flow.rates += factor[:, None] * (self._splits.gain(n) - lost)
        events = factor * lost.sum(axis=1)
        flow.events[:, p] += events
        flow.number += events


class Entering:
    """Particles come in."""

    vanishing = None

    def __init__(self, source: Source, sizes: Float) -> None:
        unit, last = sizes[0], sizes[-1]
        table = source.table
        inside = table[0] <= last
        self._places = np.rint(table[0][inside] / unit).astype(np.int64) - 1
        self._rates = table[1][inside]
        self._number = float(table[1].sum())
        self._mass = float(table[0] @ table[1])
        self._over = float(table[1][~inside].sum()), float(table[0][~inside] @ table[1][~inside])

    def add(self, p: int, factor: Float, n: Float, meeting: Meeting, flow: Flow) -> None:
        """See `Term.add`."""
        flow.rates[:, self._places] += factor[:, None] * self._rates
        flow.events[:, p] += factor * self._number
        flow.number += factor * (self._number - self._over[0])
        flow.mass_in += factor * self._mass
        flow.over_number += factor * self._over[0]
        flow.over_mass += factor * self._over[1]


def term_of(process: Process, sizes: Float) -> Term:
    """Return the term of a process on the lattice `sizes`.

    Raises
    ------
    TypeError
        If it does not say what appears.
    """
    if isinstance(process, Source):
        return Entering(process, sizes)
    daughters = process.daughters  # type: ignore[attr-defined]
    match daughters:
        case Merged():
            return Merging()
        case Debris():
            return FallingApart(daughters, len(sizes))
        case Split():
            return Splitting(Splits(daughters.law, len(sizes)))
    if isinstance(process, UnaryProcess):
        match daughters:
            case Nothing():
                return Leaving(process.rates(sizes), sizes)
            case Detached():
                return Detaching(process.rates(sizes).copy(), daughters.size)
    raise TypeError(f"{process.name}: what appears is {daughters!r}, which has no term")


def unit_of(model: Model, start: Float) -> int:
    """Return the largest number of which all sizes are multiples that can ever be there.

    Where particles only merge, leave and come in, sizes stay multiples of what those at the start
    and from outside have in common; the lattice can have this unit.

    Parameters
    ----------
    model : Model
    start : ndarray
        Densities of the sizes 1, 2, ... at the start.
    """
    present = [np.flatnonzero(start) + 1]
    for process in model.processes:
        if isinstance(process, Source):
            present.append(process.table[0])
        elif not isinstance(process.daughters, (Merged, Nothing)):  # type: ignore[attr-defined]
            return 1
    return max(int(np.gcd.reduce(np.concatenate(present))), 1)
