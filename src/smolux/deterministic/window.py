"""The number of sizes: how it begins, when it must grow and by how much."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

Float = NDArray[np.float64]

_FIRST = 64
#: so many times the largest size at the start or from a source: room for pairs of them
_ROOM = 2
#: share of the tolerance that may go over the edge in a time as long as that since the start
_SHARE = 0.01
#: a step that loses more than so many times that is done again
_TOO_LATE = 10.0
_LEAST, _MOST = 1.25, 4.0
#: largest windows by default; for the direct sum, whose cost is quadratic; where a gel forms, and
#: where only other processes keep one from forming
_LIMIT, _DIRECT_LIMIT, _GEL_LIMIT, _HINDERED_LIMIT = 1 << 20, 1 << 13, 1 << 12, 1 << 16
#: where a gel forms, at least so many times the largest size at the start
_GEL_ROOM = 8


def usual_limit(largest: int, gels: bool, hindered: bool, direct: bool) -> int:
    """Return the largest number of sizes, where the user gives none.

    Parameters
    ----------
    largest : int
        The largest size at the start and from sources.
    gels : bool
        Whether a gel may form.
    hindered : bool
        Whether other processes may keep it from forming.
    direct : bool
        Whether sums are direct.
    """
    limit = _LIMIT
    if gels:
        limit = max(_HINDERED_LIMIT if hindered else _GEL_LIMIT, _GEL_ROOM * largest)
    if direct and limit > _DIRECT_LIMIT:
        limit = max(_DIRECT_LIMIT, _ROOM * largest)
    return min(limit, _LIMIT)


@dataclass(frozen=True)
class Window:
    """Rules for the number of sizes M.

    What decides is the flow over the edge: the pairs that merge into sizes above M, in the highest
    moment that is to be kept, against that moment.

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
        """Return M for sizes up to `largest` at the start and from outside."""
        if self.fixed:
            return self.limit
        return min(_even(max(_FIRST, _ROOM * largest)), self.limit)

    def share(self, n: Float, beyond: Float) -> float:
        """Return how fast the moments flow over the edge, relative to them.

        Parameters
        ----------
        n : ndarray of shape (M,)
        beyond : ndarray of shape (M,)
            What appears per time of the sizes ``M + 1 .. 2 M``.
        """
        m = len(n)
        inside, outside = np.arange(1.0, m + 1.0) / m, np.arange(m + 1.0, 2.0 * m + 1.0) / m
        found = 0.0
        for order in (0.0, self.order):
            whole = float(np.abs(n) @ inside**order)
            over = float(np.abs(beyond) @ outside**order)
            found = max(found, over / whole if whole > 0.0 else 0.0)
        return found

    def next(self, count: int, share: float, time: float, step: float) -> tuple[int, bool]:
        """Return the number of sizes to go on with, and whether the last step must be repeated.

        The densities fall about exponentially at their end, so the logarithm of what flows over it
        is proportional to the size at which it is taken.

        Parameters
        ----------
        count : int
            M now.
        share : float
            See `share`.
        time, step : float
            Since the start, and of the last step.
        """
        threshold = _SHARE * self.tolerance
        lost = share * max(time, step)
        if lost <= threshold or count >= self.limit:
            return count, False
        # 1 % or more says nothing of the slope
        ratio = np.log(threshold) / np.log(min(lost, 0.01))
        factor = float(np.clip(1.1 * ratio, _LEAST, _MOST))
        return min(_even(factor * count), self.limit), share * step > _TOO_LATE * threshold


def _even(sizes: float) -> int:
    """Return a number of sizes, `sizes` or a little more, whose transforms are fast."""
    return int(fft.next_fast_len(2 * int(np.ceil(sizes)), real=True)) // 2
