"""Exact laws of the finite stochastic process (Marcus-Lushnikov).

N monomers in a volume V; each pair of clusters of sizes i and j merges at the rate ``K(i, j) / V``.
For the constant, additive and multiplicative kernels the laws are closed forms for any N; for any
kernel, with shattering too, the whole Markov chain on the partitions of a small N is solved.
"""

from .additive import Additive
from .base import FiniteLaw
from .chain import collision_moments, partition_pmf, partitions
from .constant import Constant
from .find import find, law, number_mean, number_variance
from .multiplicative import Multiplicative

__all__ = [
    "Additive",
    "Constant",
    "FiniteLaw",
    "Multiplicative",
    "collision_moments",
    "find",
    "law",
    "number_mean",
    "number_variance",
    "partition_pmf",
    "partitions",
]
