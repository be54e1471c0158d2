"""Any weight: a power of the size, or a function of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from smolux.checks import is_number
from smolux.errors import InputError, Problem
from smolux.functions.intervals import Interval
from smolux.functions.size import SizeFunction
from smolux.kernels.base import Kernel
from smolux.kernels.majorant import Majorant

from .base import Float, Weighting

#: the largest power of the size that makes sense
STEEPEST = 8.0


def power(size: Any, q: Any) -> Any:
    """Weight ``size**q``; a root costs a quarter of what a power does."""
    return np.sqrt(size) if q == 0.5 else size**q


def power_ratio(i: Any, j: Any, q: Any) -> Any:
    """Return the largest of ``(i + j)**q``, ``i**q`` and ``j**q`` over ``(i j)**q``."""
    if q < 0.0:
        return np.maximum(i, j) ** (-q)
    total = 1.0 / i + 1.0 / j
    return np.sqrt(total) if q == 0.5 else total**q


def larger(x: Any, y: Any) -> Interval:
    """Return the larger one of two intervals."""
    greatest: Any = np.maximum
    found: Interval = greatest(x, y)
    return found


def power_interval(i: Interval, j: Interval, q: float) -> Interval:
    """Bounds of `power_ratio` over intervals: it is monotonic in each size."""
    if q < 0.0:
        return larger(i, j) ** (-q)
    return (1.0 / i + 1.0 / j) ** q


@dataclass(frozen=True)
class WeightFunction(Weighting):
    """A simulated particle of size l stands for ``1 / w(l)`` particles, ``w`` being any function.

    What grows with the size puts more simulated particles where the large ones are. For ``l**q``
    mass is conserved on average, exactly for q = 0 (`Number`) and q = 1 (`MassFlow`).

    Parameters
    ----------
    w : float, str or callable
        The power q of ``w(l) = l**q``, which may be negative; or a formula in l such as
        ``"1 + l/100"``; or a plain Python function of l. Positive for all sizes.

    References
    ----------
    A. Kolodko and K. Sabelfeld, WIAS Preprint 842 (2003), section 3, with the rate and the removal
    as corrected on the page of errata.
    """

    w: Any = 1.0
    name: ClassVar[str] = "weight-function"

    def __post_init__(self) -> None:
        given = self.w
        if is_number(given):
            if not abs(float(given)) <= STEEPEST:
                limits = f"must be a number from -{STEEPEST:g} to {STEEPEST:g}"
                what = "weight function"
                raise InputError([Problem(what, f"the power of the size {limits}", given)])
            object.__setattr__(self, "w", float(given))
            return
        if not (isinstance(given, str) or callable(given)):
            raise InputError(
                f"weight function = {given!r}: must be the power of the size, a formula in l such "
                'as "1 + l/100", or a function of the size'
            )
        self._law.check_positive("weight function")

    @cached_property
    def _law(self) -> SizeFunction:
        return SizeFunction.of(self.w, "weight function", "l")

    @property
    def exponent(self) -> float | None:
        """The power q, if it is one."""
        return self.w if isinstance(self.w, float) else None

    @property
    def weight(self) -> Callable[..., Any]:
        return self._law.rate if self.exponent is None else power

    @property
    def rate_ratio(self) -> Callable[..., Any] | None:
        return None if self.exponent is None else power_ratio

    @property
    def parameters(self) -> tuple[Any, ...]:
        return self._law.parameters if self.exponent is None else (self.exponent,)

    @property
    def settings(self) -> dict[str, Any]:
        return {"w": self._law.text if self.exponent is None else self.exponent}

    @property
    def rigorous(self) -> bool:
        return self.exponent is not None or self._law.rigorous

    def weights(self, sizes: ArrayLike) -> Float:
        if self.exponent is not None:
            return super().weights(sizes)
        # a function that takes no arrays is slow, and the same few sizes come in many pairs
        found, place = np.unique(np.asarray(sizes, float), return_inverse=True)
        return self._law(found)[place].reshape(np.shape(sizes))

    def interval(self, i: Interval, j: Interval) -> Interval:
        if self.exponent is not None:
            return power_interval(i, j, self.exponent)
        one, two = self._law.interval(i), self._law.interval(j)
        both = self._law.interval(i + j)
        # max(w(i), w(j), w(i + j)) / (w(i) w(j)), each weight standing as rarely as it can
        return larger(larger(1.0 / one, 1.0 / two), both / (one * two))

    def majorant(self, kernel: Kernel) -> Majorant | None:
        """See `Weighting.majorant`; for powers, from that of the kernel."""
        return None if self.exponent is None else power_majorant(kernel.majorant(), self.exponent)


def power_majorant(majorant: Majorant | None, q: float) -> Majorant | None:
    """Multiply a majorant by one of `power_ratio`; None is left as it is.

    With ``x = i**-q`` and ``y = j**-q`` the ratio lies between ``x + y`` and ``2**(q - 1)`` times
    that, for a negative power between half of it and ``x + y``.
    """
    if majorant is None:
        return None
    other = 2.0 ** (q - 1.0) if q >= 0.0 else 0.5
    least, most = min(1.0, other), max(1.0, other)
    weights: dict[tuple[float, float], float] = {}
    positive = all(weight > 0.0 for weight, _, _ in majorant.terms)
    for weight, left, right in majorant.terms:
        for pair in ((left - q, right), (left, right - q)):
            key = (min(pair), max(pair)) if positive else pair  # a term and its transpose are one
            weights[key] = weights.get(key, 0.0) + most * weight
    terms = tuple((weight, *pair) for pair, weight in weights.items() if weight != 0.0)
    return Majorant(terms, majorant.least * least / most)
