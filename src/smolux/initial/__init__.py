"""Initial size distributions: one file per law.

A distribution gives number densities of integer sizes. A simulation draws its particles by
systematic sampling, one uniform number for the whole population, so every size is met to within one
particle of its share and the expected counts are exact.
"""

from .base import Initial, Tabulated
from .empty import Empty, empty
from .exponential import Exponential, exponential
from .lognormal import Lognormal, lognormal
from .sizes import Sizes, from_sizes, monodisperse

#: every initial condition; case files know it by its ``name``, and one size as "monodisperse"
INITIALS: tuple[type[Initial], ...] = (Sizes, Exponential, Lognormal, Empty)

__all__ = [
    "INITIALS",
    "Empty",
    "Exponential",
    "Initial",
    "Lognormal",
    "Sizes",
    "Tabulated",
    "empty",
    "exponential",
    "from_sizes",
    "lognormal",
    "monodisperse",
]
