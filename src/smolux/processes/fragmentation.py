"""A particle falls into two by itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from smolux.errors import about
from smolux.functions.user_function import spread
from smolux.kernels.base import Kernel
from smolux.kernels.numeric_bounds import SAFETY
from smolux.kernels.shared import pair_law

from .base import Float, UnaryProcess, Varying
from .daughters import Split

#: splits of a bin that are tried for a bound, and for a mean
_TRIED, _FEW = 32, 8


def _split(k: int, part: int, sizes: Any, counts: Any) -> int:
    sizes[0], counts[0] = part, 1
    if part == k - part:
        counts[0] = 2
        return 1
    sizes[1], counts[1] = k - part, 1
    return 2


@dataclass(frozen=True)
class Fragmentation(Varying, UnaryProcess):
    """Particles fall into two: ``(i + j) -> (i) + (j)`` at the rate ``F(i, j)``.

    As in ``dn_k/dt = sum_j F(k, j) n_{k+j} - n_k sum_{i+j=k} F(i, j) / 2``. A constant F is random
    scission: each of the k - 1 bonds of a chain breaks at the rate F/2.

    Parameters
    ----------
    rate : float, str, callable or Kernel
        F: a number, a formula in i and j such as ``"1/(i*j)"``, a function of two sizes, or one of
        `smolux.kernels`. Symmetric and never negative.
    varying : float, callable or str
        A function of time by which the rate is multiplied.
    label : str, optional
        What it is called in results, if not by its name.

    References
    ----------
    P. J. Blatz and A. V. Tobolsky, J. Phys. Chem. 49, 77 (1945), doi:10.1021/j150440a004.
    """

    rate: Any
    varying: Any = 1.0
    name: ClassVar[str] = "fragmentation"
    least: ClassVar[int] = 2
    splits: ClassVar[bool] = True
    outcome: ClassVar[Callable[..., Any]] = staticmethod(_split)
    variables: ClassVar[Mapping[str, str]] = {"rate": "i and j", "varying": "t"}

    def __post_init__(self) -> None:
        _ = self.factor, self.pairs

    @cached_property
    def pairs(self) -> Kernel:
        """The law F, which is of the same kind as a kernel."""
        with about("rate"):
            return pair_law(self.rate, "the fragmentation rate")

    @property
    def entries(self) -> int:
        return 2

    @property
    def law(self) -> Callable[..., Any]:
        return self.pairs.rate

    @property
    def parameters(self) -> tuple[Any, ...]:
        return self.pairs.parameters

    def split_bounds(
        self, low: Float, high: Float, bounds: Callable[..., tuple[Float, Float]]
    ) -> tuple[Float, Float, Float, Any]:
        (a, b, c, d), widths = _bins(low, high)
        bound = bounds(a, b, c, d)[1]
        finite = np.isfinite(bound)
        # in no step with any period
        tried = spread(_FEW if finite.all() else _TRIED)
        i = np.rint(a + (b - a) * tried[:, None, None])
        sizes = low[:, None] + np.arange(2.0)[:, None, None, None]  # an even one and an odd one
        found = np.nan_to_num(self.pairs(i, np.maximum(sizes - i, 1.0)), posinf=0.0)
        # intervals may find no bound: then by trial, and raised where a rate is above
        bound = np.where(finite, bound, SAFETY * found.max(axis=(0, 1)))
        proved = finite.all(axis=1) & self.pairs.rigorous
        return bound, widths, found.mean(axis=1).min(axis=0), proved

    @property
    def daughters(self) -> Split:
        return Split(self.pairs)


def _bins(low: Float, high: Float) -> tuple[tuple[Float, Float, Float, Float], Float]:
    """Return the boxes of both fragments, the smaller first, in the bins of ranges of sizes.

    And how many splits of the largest size each has. Over all i and j below k a law would be
    bounded far too high: by F(1, 1) of small pieces, where it falls. Only i + j = k can occur, to
    which narrow bins come close.
    """
    ends = 2.0 ** np.arange(int(np.log2(low[0])) - 1)
    low, high = low[:, None], high[:, None]
    half, most = np.floor(low / 2.0), np.floor(high / 2.0)
    # 1, 2 and 3, 4 to 7, ... up to a quarter; half; and from there 1, 2 and 3, ... below
    top = np.minimum(2.0 * ends - 1.0, np.floor(most / 2.0))
    deep = np.minimum(2.0 * ends - 1.0, np.ceil(most / 2.0) - 1.0)
    a = np.hstack([np.broadcast_to(ends, top.shape), half, np.maximum(half - deep, 1.0)])
    b = np.hstack([top, most, most - ends])
    c = np.hstack([low - top, low - half, low - half + ends])
    d = np.hstack([high - ends, high - most, high - most + deep])
    widths = np.hstack([top - ends + 1.0, np.ones(half.shape), np.maximum(deep - ends + 1.0, 0.0)])
    return (np.minimum(a, b), b, np.minimum(c, d), d), widths
