"""A kernel times the share of the encounters in which something happens."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.checks import is_number
from smolux.errors import InputError
from smolux.functions.content import frozen
from smolux.functions.intervals import Interval
from smolux.functions.time import TimeFunction

from .base import Kernel, widen
from .check import sample_sizes
from .composite import MadeOfKernels
from .constant import Constant
from .formula_kernel import formula
from .function import from_function
from .majorant import Majorant
from .registry import from_dict

Float = NDArray[np.float64]

#: what a share of one may be by rounding
WHOLE = 1.0 + 1e-12


def pair_law(given: Any, what: str, *, zero: bool = False) -> Kernel:
    """Return a law of two sizes that was given as a number, formula, function, table or kernel.

    Parameters
    ----------
    given : float, str, callable, mapping or Kernel
    what : str
        What messages call it.
    zero : bool
        Whether it may vanish.

    Raises
    ------
    InputError
        If it is none of these, or on a sample of sizes no rate.
    """
    try:
        made = _made(given, what, zero)
        wrong = made.problems()
    except InputError as error:
        wrong = error.problems
    if wrong:
        raise InputError([re.sub("^kernel", what, text) for text in wrong])
    return made


def _made(given: Any, what: str, zero: bool) -> Kernel:
    if isinstance(given, Kernel):
        return given
    if isinstance(given, Mapping):  # as in files
        return from_dict(given)
    if isinstance(given, str):
        return formula(given)
    if is_number(given):
        if not 0.0 < given < np.inf and not (zero and given == 0.0):
            least = ", zero or more" if zero else " above zero"
            raise InputError(f"{what} = {given!r}: must be a finite number{least}")
        return Constant(float(given))
    if callable(given):
        return from_function(given)
    raise InputError(
        f"{what} = {given!r}: must be a number, a formula in i and j, a function of two sizes or a "
        "kernel"
    )


def share_law(given: Any, what: str) -> Kernel:
    """Return the law of a share of encounters, which is between 0 and 1.

    Raises
    ------
    InputError
        If it is none, on a sample of sizes; with the pair.
    """
    law = pair_law(given, what, zero=True)
    sizes = np.unique(np.concatenate([sample_sizes(1.0), law.singled_out]))
    values = law(sizes[:, None], sizes)
    above = np.argwhere(values > WHOLE)
    if len(above):
        i, j = above[np.argmin(above.max(axis=1))]
        raise InputError(
            f"{what} = {law.label}: is {values[i, j]:.6g} for the sizes {sizes[i]:.0f} and "
            f"{sizes[j]:.0f}; a share is between 0 and 1, as in min({law.label.strip(chr(39))}, 1)"
        )
    return law


@dataclass(frozen=True)
class Shared(MadeOfKernels):
    """``K(i, j) s(i, j)`` with a share s of the encounters, between 0 and 1.

    The rate of a pair whose share is not is no number, which ends a run.
    """

    kernel: Kernel
    share: Kernel
    name: ClassVar[str] = "shared"

    @property
    def made_of(self) -> tuple[Kernel, ...]:
        return self.kernel, self.share

    @property
    def in_time(self) -> tuple[tuple[TimeFunction, Kernel], ...]:
        """See `Kernel.in_time`; each law times the share."""
        return tuple((factor, Shared(law, self.share)) for factor, law in self.kernel.in_time)

    @property
    def label(self) -> str:
        return f"{self.kernel.label} times the share {self.share.label}"

    @property
    def formula(self) -> str:  # type: ignore[override]
        """The formulas of both, each of which has its own parameters."""
        return f"({self.kernel.formula}) * ({self.share.formula})"

    @property
    def rate(self) -> Callable[..., Any]:  # type: ignore[override]
        """See `Kernel.rate`; the same object for products of the same laws."""
        own = len(self.kernel.parameters)
        return _times(frozen(self.kernel.rate), frozen(self.share.rate), own)

    @property
    def parameters(self) -> tuple[float, ...]:
        return (*self.kernel.parameters, *self.share.parameters)

    @property
    def gels(self) -> bool | None:
        """See `Kernel.gels`; fewer mergers may prevent a gel, and never make one."""
        return False if self.kernel.gels is False else None

    def __call__(self, i: ArrayLike, j: ArrayLike) -> Float:
        part = self.share(i, j)
        return np.where((part >= 0.0) & (part <= WHOLE), self.kernel(i, j) * part, np.nan)

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        """See `Kernel.bounds`; the products of those of both, of which none is negative."""
        lower, upper = self.kernel.bounds(a, b, c, d)
        least, most = self.share.bounds(a, b, c, d)
        return widen(np.asarray(lower * least), np.asarray(upper * np.minimum(most, 1.0)))

    def interval(self, i: Interval, j: Interval) -> Interval:
        return self.kernel.interval(i, j) * self.share.interval(i, j)

    def majorant(self) -> Majorant | None:
        """See `Kernel.majorant`; that of the kernel, as no share is above one."""
        return self.kernel.majorant()


@lru_cache(maxsize=64)
def _times(rate: Callable[..., Any], share: Callable[..., Any], own: int) -> Callable[..., Any]:
    """Bind the product of a rate with so many parameters of its own, and a share."""

    def shared(i: Any, j: Any, *p: Any) -> Any:
        part = share(i, j, *p[own:])
        return rate(i, j, *p[:own]) * part if 0.0 <= part <= WHOLE else math.nan

    return frozen(shared)
