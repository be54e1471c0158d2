"""Lognormal law of sizes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from smolux.errors import Problem

from .base import Float, Initial, Int, as_number, check_positive, is_above, refuse

#: change of M1 by rounding to whole sizes, relative, above which a result warns of it
MASS_CHANGE = 0.01
#: above this size rounding changes no mass: it is as often up as down
_ROUNDED = 1 << 16


@dataclass(frozen=True)
class Lognormal(Initial):
    """Lognormal law rounded to whole sizes; see `lognormal`."""

    median: float
    sigma: float
    density: float = 1.0
    name: ClassVar[str] = "lognormal"

    def __post_init__(self) -> None:
        problems: list[str] = []
        check_positive(problems, median=self.median, density=self.density)
        if not is_above(1.0, self.sigma):
            cure = "the geometric standard deviation must exceed 1 (1.3 is narrow, 2 is wide)"
            problems.append(Problem("sigma", cure, self.sigma))
        most = 0.0
        if not problems:  # the tail is cut off 8.2 standard deviations from the median
            most = math.exp(min(math.log(self.median) + 8.3 * math.log(self.sigma), 700.0))
        refuse(problems, self, most)

    @property
    def total(self) -> float:
        return self.density

    def cumulative(self, sizes: Float) -> Float:
        """See `Initial.cumulative`; what lies below 1/2 counts as size 1."""
        from scipy import special

        sizes = np.floor(np.asarray(sizes, float))
        return np.where(sizes >= 1, special.ndtr(self._deviations(sizes)), 0.0)

    def _deviations(self, sizes: Float) -> Float:
        """How many standard deviations the upper edges of sizes lie above the median."""
        return np.log(np.maximum(sizes, 1) / self.median + 0.5 / self.median) / np.log(self.sigma)

    def densities(self, largest: int) -> Float:
        """See `Initial.densities`; exact far into both tails."""
        from scipy import special

        z = self._deviations(np.arange(1.0, largest + 1.0))
        below, above = special.ndtr(z), special.ndtr(-z)
        # what lies in the upper half is a difference of what lies above
        shares = np.where(z[1:] < 0.0, np.diff(below), -np.diff(above))
        return self.density * np.concatenate([below[:1], shares])

    def quantile(self, share: Float) -> Int:
        from scipy import special

        size = self.median * self.sigma ** special.ndtri(np.asarray(share, float))
        return np.maximum(np.ceil(size - 0.5), 1).astype(np.int64)

    def _mass(self, most: float) -> float:
        """M1 of what the law has up to a size, before rounding."""
        from scipy import special

        width = math.log(self.sigma)
        whole = self.density * self.median * math.exp(width**2 / 2)
        return whole * float(special.ndtr(math.log(most / self.median) / width - width))

    @property
    def mass(self) -> tuple[float, float]:
        """M1 of the law, and of the whole sizes that stand for it."""
        few = min(self.largest, _ROUNDED)
        rounded = float(np.diff(self.cumulative(np.arange(few + 1.0))) @ np.arange(1.0, few + 1.0))
        above = self._mass(self.largest + 0.5) - self._mass(few + 0.5)
        return self._mass(math.inf), self.density * rounded + above

    @property
    def remarks(self) -> list[str]:
        law, found = self.mass
        change = found / law - 1
        if abs(change) <= MASS_CHANGE:
            return []
        cut = self._mass(self.largest + 0.5) < (1 - MASS_CHANGE / 2) * law
        cure = (
            "most of the mass is in particles too rare to be drawn; take a smaller sigma"
            if cut
            else "choose a smaller monomer, so that the law lies above the size 1"
        )
        return [
            f"M1 of the lognormal law is {law:.4g}, and {found:.4g} when it is rounded to whole "
            f"sizes of at least 1 ({100 * change:+.3g} %): {cure}"
        ]


def lognormal(median: float, sigma: float, density: float = 1.0) -> Lognormal:
    """Sizes lognormally distributed, rounded to whole numbers of at least 1.

    A size is a number of monomers, so a mass, not a diameter: an aerosol whose diameters have the
    geometric standard deviation GSD has ``sigma = GSD**3`` here, and ``median`` is the cube of its
    count median diameter over the diameter of a monomer. Rounding changes the moments where much
    of the law lies near or below one monomer: if M1 changes by more than 1 %, a warning says so.

    Parameters
    ----------
    median : float
        Median size (count median), in monomers.
    sigma : float
        Geometric standard deviation of the size, above 1.
    density : float
        Particles per unit volume.
    """
    return Lognormal(as_number(median), as_number(sigma), as_number(density))
