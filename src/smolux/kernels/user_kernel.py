"""Laws of the user, however they are given: what formulas and Python functions have in common."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from smolux.functions.intervals import Interval
from smolux.functions.law import Law, proved_or_tried

from .base import Float, Kernel
from .numeric_bounds import NUMBERS, always_bounded, interval_bounds, sampled_bounds

SIZES = ("i", "j")


@dataclass(frozen=True)
class OwnKernel(Kernel):
    """A kernel of a `Law` in i and j."""

    arbitrary: ClassVar[bool] = True

    @property
    def law(self) -> Law:
        """The law of the two sizes."""
        raise NotImplementedError

    @property
    def given(self) -> str:
        """The values of the parameters as text, each after a comma."""
        pairs = zip(self.law.names, self.law.parameters, strict=True)
        return "".join(f", {name}={value!r}" for name, value in pairs)

    @property
    def label(self) -> str:
        return repr(self.law.text)

    @property
    def rate(self) -> Callable[..., Any]:  # type: ignore[override]
        """See `Kernel.rate`; the same object for equal laws."""
        return self.law.rate

    @property
    def parameters(self) -> tuple[float, ...]:
        return self.law.parameters

    @cached_property
    def rigorous(self) -> bool:  # type: ignore[override]
        """Whether `bounds` is proved, by intervals; what is stated is checked at every pair."""
        return self.law.stated is None and always_bounded(self.law.interval)

    @property
    def searched(self) -> bool:  # type: ignore[override]
        """See `Kernel.searched`."""
        return self.law.stated is None

    def interval(self, i: Interval, j: Interval) -> Interval:
        """See `Kernel.interval`; as `bounds`, but never sampled."""
        if self.law.stated is not None:
            return Interval(*self.bounds(i.lo, i.hi, j.lo, j.hi))
        return self.law.interval(i, j)

    def __call__(self, i: ArrayLike, j: ArrayLike) -> Float:
        return self.law.on(i, j)

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        """See `Kernel.bounds`; stated, by interval arithmetic, or sampled, in this order."""
        if self.law.stated is not None:
            return self.law.stated_bounds(a, b, c, d)
        prove = partial(interval_bounds, self.law.interval)
        return proved_or_tried(prove, self._sampled, a, b, c, d)

    def _sampled(
        self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike
    ) -> tuple[Float, Float]:
        return sampled_bounds(self, a, b, c, d, self.law.numbers)

    @property
    def singled_out(self) -> Float:
        """See `Kernel.singled_out`; of the first numbers in the law."""
        numbers = self.law.numbers
        whole = np.unique(np.rint(numbers[(numbers >= 1) & (numbers < 2.0**20)]))
        return whole[:NUMBERS]
