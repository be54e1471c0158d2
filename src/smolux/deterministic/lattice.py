"""A kernel between the multiples of a unit of size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.kernels.base import Kernel

Float = NDArray[np.float64]


def on_multiples(kernel: Kernel, unit: int) -> Kernel:
    """Return the kernel as a function of sizes in a unit: ``K(unit i, unit j)``."""
    return kernel if unit == 1 else _OnMultiples(kernel, float(unit))


@dataclass(frozen=True)
class _OnMultiples(Kernel):
    """See `on_multiples`; what the rate equations ask of a kernel."""

    kernel: Kernel
    unit: float

    @property
    def label(self) -> str:
        return self.kernel.label

    def __call__(self, i: ArrayLike, j: ArrayLike) -> Float:
        """Evaluate for sizes in the unit."""
        return self.kernel(self.unit * np.asarray(i, float), self.unit * np.asarray(j, float))

    def bounds(self, *box: ArrayLike) -> tuple[Float, Float]:
        return self.kernel.bounds(*(self.unit * np.asarray(side, float) for side in box))

    def low_rank_factors(self, sizes: Float) -> Any:
        return self.kernel.low_rank_factors(self.unit * sizes)

    @property
    def singled_out(self) -> Float:
        return self.kernel.singled_out / self.unit
