"""The account of number and mass: what processes make and take, against what densities hold."""

from __future__ import annotations

from dataclasses import dataclass

#: by so many tolerances number and mass may differ from the account in the end, or by one for each
#: step; and by so many the terms of a step from what processes say that they are
_CLOSED, _STEP = 10.0, 1.0


@dataclass(frozen=True)
class Entry:
    """Number or mass over a step.

    Attributes
    ----------
    before, after : float
        What the densities hold.
    terms : float
        The sum of the terms that the sizes get.
    account_of_terms, account : float
        What it is by the account of the processes, for the densities that the terms are of, and for
        those at the end of the iteration.
    """

    before: float
    after: float
    terms: float
    account_of_terms: float
    account: float

    @property
    def apart(self) -> float:
        """How far terms and account are apart, relative to what there is."""
        return abs(self.terms - self.account_of_terms) / max(
            abs(self.before), abs(self.after), 1e-300
        )


class Account:
    """What does not close, relative to all that was ever there.

    Two things are told apart. The terms that all sizes get must add up to what processes say that
    they make and take: else the sums over pairs are wrong, by the factors of the kernel or by the
    rounding of the transforms. And what densities hold must be what they held at the start and all
    that the account says since: else steps were not solved to the end.

    Parameters
    ----------
    tolerance : float
        Of the solution.
    number, mass : float
        At the start.

    Attributes
    ----------
    number, mass : float
        The difference up to now.
    apart : float
        The largest distance of terms and account over a step.
    steps : int
    """

    def __init__(self, tolerance: float, number: float, mass: float) -> None:
        self.number = self.mass = self.apart = 0.0
        self.steps = 0
        self._tolerance, self._most = tolerance, [number, mass]

    def closes(self, *entries: Entry) -> bool:
        """Whether the terms of a step add up."""
        return all(entry.apart <= _STEP * self._tolerance for entry in entries)

    def add(self, number: Entry, mass: Entry) -> None:
        """Enter a step."""
        self.apart = max(self.apart, number.apart, mass.apart)
        missing = []
        self.steps += 1
        for k, entry in enumerate((number, mass)):
            self._most[k] = max(self._most[k], entry.after)
            missing.append((entry.after - entry.before - entry.account) / self._most[k])
        self.number += missing[0]
        self.mass += missing[1]

    @property
    def problem(self) -> str | None:
        """What does not close, if it is more than it may be."""
        for what, found in (("number", self.number), ("mass", self.mass)):
            if not abs(found) <= max(_CLOSED, self.steps) * self._tolerance:
                return (
                    f"the {what} of particles differs from what the processes make and take by "
                    f"{abs(found):.1e} of all that there was"
                ).replace("mass of particles", "mass")
        return None
