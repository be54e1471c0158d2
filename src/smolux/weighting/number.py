"""Direct simulation: one simulated particle is one particle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from smolux.kernels.base import Kernel
from smolux.kernels.majorant import Majorant

from .base import Float, Weighting


@dataclass(frozen=True)
class Number(Weighting):
    """Every simulated particle stands for one particle, and pairs react at the rate of the kernel.

    The Marcus-Lushnikov process (A. H. Marcus, Technometrics 10, 133 (1968); A. A. Lushnikov, J.
    Colloid Interface Sci. 65, 276 (1978)).
    """

    name: ClassVar[str] = "number"
    cheap: ClassVar[bool] = True

    @property
    def weight(self) -> None:
        return None

    def weights(self, sizes: ArrayLike) -> Float:
        return np.ones(np.shape(sizes))

    def arrays(self, kernel: Callable[[Any, Any], Float]) -> Callable[[Any, Any], Float]:
        return kernel

    def bounds(self, kernel: Kernel) -> Callable[..., tuple[Float, Float]]:
        return kernel.bounds

    def majorant(self, kernel: Kernel) -> Majorant | None:
        return kernel.majorant()
