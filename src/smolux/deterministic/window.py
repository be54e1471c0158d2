"""The number of sizes: how it begins, when it must grow and by how much."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

Float = NDArray[np.float64]

_FIRST = 64
#: share of the tolerance that the last quarter of the window may hold of the highest moment
_TAIL_SHARE = 0.01
#: a step that fills the tail more than so many times too much is done again
_TOO_LATE = 100.0
_LEAST, _MOST = 1.25, 4.0


@dataclass(frozen=True)
class Window:
    """Rules for the number of sizes M.

    Parameters
    ----------
    limit : int
        The largest M.
    order : float
        The highest moment to be kept, 3 or more.
    tolerance : float
        Of the solution.
    fixed : bool
        Whether M is given and stays.
    """

    limit: int
    order: float
    tolerance: float
    fixed: bool = False

    def first(self, largest: int) -> int:
        """Return M for sizes up to `largest` at the start."""
        if self.fixed:
            return self.limit
        return min(_even(max(_FIRST, 1.5 * largest)), self.limit)

    def tail(self, n: Float) -> float:
        """Return the share of the last quarter of the window in the highest moment."""
        m = len(n)
        weighted = np.abs(n) * (np.arange(1, m + 1) / m) ** self.order
        total = float(weighted.sum())
        return float(weighted[3 * m // 4 :].sum()) / total if total > 0 else 0.0

    def empty(self, n: Float) -> bool:
        """Whether so little is in the tail that nothing to speak of leaves the window."""
        return self.tail(n) <= _TOO_LATE * _TAIL_SHARE * self.tolerance

    def next(self, n: Float) -> tuple[int, bool]:
        """Return the number of sizes to go on with, and whether the last step must be repeated.

        The densities fall about exponentially at their end, so the logarithm of the tail's share is
        proportional to the size at which it is taken.
        """
        m, threshold = len(n), _TAIL_SHARE * self.tolerance
        share = self.tail(n)
        if share <= threshold or m >= self.limit:
            return m, False
        # 1 % or more says nothing of the slope
        ratio = np.log(threshold) / np.log(min(share, 0.01))
        factor = float(np.clip(1.1 * ratio, _LEAST, _MOST))
        return min(_even(factor * m), self.limit), share > _TOO_LATE * threshold


def _even(sizes: float) -> int:
    """Return a number of sizes, `sizes` or a little more, whose transforms are fast."""
    return int(fft.next_fast_len(2 * int(np.ceil(sizes)), real=True)) // 2
