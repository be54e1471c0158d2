"""What one simulated particle stands for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..kernels.base import Kernel
from ..kernels.majorant import Majorant

Float = NDArray[np.float64]


class Weighting:
    """Turns the kernel into the simulated pair rate and counts into number densities.

    Attributes
    ----------
    name : str
        The name in `simulate`, in case files and in the registry `WEIGHTINGS`.
    """

    name: ClassVar[str]

    def compiled(self, rate: Any) -> Any:
        """Return the simulated rate as a compiled piece, from the compiled rate of the kernel."""
        raise NotImplementedError

    def arrays(self, kernel: Kernel) -> Callable[[Any, Any], Float]:
        """Return the simulated rate on arrays of sizes."""
        raise NotImplementedError

    def bounds(self, kernel: Kernel) -> Callable[..., tuple[Float, Float]]:
        """Return the bounds of the simulated rate, see `smolux.kernels.base.Kernel.bounds`."""
        raise NotImplementedError

    def majorant(self, kernel: Kernel) -> Majorant | None:
        """Return a majorant of the simulated rate; None if none is known, see `bounds` then."""
        return None

    def stands_for(self, sizes: Float) -> Float:
        """How many physical particles a simulated particle of each size stands for."""
        raise NotImplementedError
