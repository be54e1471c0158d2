"""Lognormal law of sizes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .base import Float, Initial, Int, as_number, check_positive, is_above, refuse


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
            problems.append(
                f"sigma = {self.sigma!r}: the geometric standard deviation must exceed 1 "
                "(1.3 is narrow, 2 is wide)"
            )
        most = 0.0
        if not problems:  # the tail is cut off 8.2 standard deviations from the median
            most = math.exp(min(math.log(self.median) + 8.3 * math.log(self.sigma), 700.0))
        refuse(problems, self, most)

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


def lognormal(median: float, sigma: float, density: float = 1.0) -> Lognormal:
    """Sizes lognormally distributed, rounded to whole numbers of at least 1.

    A size is a number of monomers, so a mass, not a diameter: an aerosol whose diameters have the
    geometric standard deviation GSD has ``sigma = GSD**3`` here, and ``median`` is the cube of its
    count median diameter over the diameter of a monomer. Rounding changes the moments where much
    of the law lies near or below one monomer.

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
