"""Collision kernels: one file per law, a user's own function, or a formula."""

from .additive import Additive
from .ballistic import Ballistic
from .base import Kernel
from .constant import Constant
from .generalized_brownian import GeneralizedBrownian
from .multiplicative import Multiplicative

#: every law; the name in a case file is its ``name``
KERNELS: tuple[type[Kernel], ...] = (
    Constant,
    Additive,
    Multiplicative,
    Ballistic,
    GeneralizedBrownian,
)

__all__ = [
    "KERNELS",
    "Additive",
    "Ballistic",
    "Constant",
    "GeneralizedBrownian",
    "Kernel",
    "Multiplicative",
]
