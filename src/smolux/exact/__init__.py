"""Exact solutions: closed forms of the rate equations, and exact laws of finite systems.

`solution` finds the one that a model has. The laws of the finite stochastic process (means,
variances, whole distributions) are in `smolux.exact.finite`.
"""

from . import finite
from .additive import Additive
from .base import Solution
from .bilinear import Bilinear
from .constant import Constant
from .find import solution
from .multiplicative import Multiplicative
from .shattering import ConstantShattering
from .steady import MultiplicativeShattering

#: every exact solution of the rate equations
SOLUTIONS: tuple[type[Solution], ...] = (
    Constant,
    Additive,
    Multiplicative,
    Bilinear,
    ConstantShattering,
    MultiplicativeShattering,
)

__all__ = [
    "SOLUTIONS",
    "Additive",
    "Bilinear",
    "Constant",
    "ConstantShattering",
    "Multiplicative",
    "MultiplicativeShattering",
    "Solution",
    "finite",
    "solution",
]
