"""What one simulated particle stands for."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.functions.intervals import Interval
from smolux.functions.law import proved_or_tried
from smolux.kernels.base import Kernel
from smolux.kernels.majorant import Majorant
from smolux.kernels.numeric_bounds import interval_bounds, sampled_bounds

Float = NDArray[np.float64]


class Weighting:
    """A simulated particle of size l stands for ``1 / w(l)`` particles.

    The densities ``z_l = w(l) n_l`` are simulated. A pair of the sizes i and j has an event at
    the rate ``K(i, j) W / (w(i) w(j))``, with W the largest of ``w(i)``, ``w(j)`` and ``w(i + j)``.
    In it i vanishes with probability ``w(i) / W``, j with probability ``w(j) / W``, and of a size k
    that appears c times ``c w(k) / W`` are put in on average. So the densities obey the rate
    equations of the model whatever w is; see the page on weightings.

    A weighting gives `weight`; all else follows. It is a plain function of numbers, arrays and, if
    `rigorous`, intervals, and compiles with Numba.

    Attributes
    ----------
    name : str
        The name in `simulate`, in case files and in the registry `WEIGHTINGS`.
    """

    name: ClassVar[str]
    #: whether what it adds to a rate costs no more than reading a table
    cheap: ClassVar[bool] = False

    @property
    def weight(self) -> Callable[..., Any] | None:
        """``weight(l, *parameters)``: w; None if it is one for all sizes."""
        raise NotImplementedError

    @property
    def rate_ratio(self) -> Callable[..., Any] | None:
        """``rate_ratio(i, j, *parameters)``: the simulated rate over that of the kernel.

        None if there is no shorter form than by the definition.
        """
        return None

    @property
    def parameters(self) -> tuple[Any, ...]:
        """What `weight` and `rate_ratio` take after the sizes."""
        return ()

    @property
    def settings(self) -> dict[str, Any]:
        """What a result says of it beside its name."""
        return {}

    @property
    def rigorous(self) -> bool:
        """Whether bounds of the simulated rate are proved where those of the kernel are."""
        return True

    def weights(self, sizes: ArrayLike) -> Float:
        """Evaluate w on an array of sizes."""
        assert self.weight is not None
        sizes = np.asarray(sizes, float)
        return np.asarray(np.broadcast_to(self.weight(sizes, *self.parameters), sizes.shape), float)

    def stands_for(self, sizes: ArrayLike) -> Float:
        """How many physical particles a simulated particle of each size stands for."""
        return 1.0 / self.weights(sizes)

    def rate_ratios(self, i: ArrayLike, j: ArrayLike) -> Float:
        """Return the simulated rate over that of the kernel, on arrays of sizes."""
        i, j = np.broadcast_arrays(np.asarray(i, float), np.asarray(j, float))
        with np.errstate(all="ignore"):
            if self.rate_ratio is not None:
                return np.asarray(self.rate_ratio(i, j, *self.parameters), float)
            one, two = self.weights(i), self.weights(j)
            return np.maximum(np.maximum(one, two), self.weights(i + j)) / (one * two)

    def interval(self, i: Interval, j: Interval) -> Interval:
        """Bounds of the same over intervals of sizes; `TypeError` if there are none."""
        raise NotImplementedError

    def arrays(self, kernel: Callable[[Any, Any], Float]) -> Callable[[Any, Any], Float]:
        """Return the simulated rate on arrays of sizes, of that of the kernel."""

        def rate(i: Any, j: Any) -> Float:
            with np.errstate(all="ignore"):
                return np.asarray(kernel(i, j) * self.rate_ratios(i, j))

        return rate

    def bounds(self, kernel: Kernel) -> Callable[..., tuple[Float, Float]]:
        """Return the bounds of the simulated rate, see `smolux.kernels.base.Kernel.bounds`.

        Those of kernel and ratio over small boxes, multiplied: over a large one both need not be
        attained for the same pair.
        """

        def cell(i: Interval, j: Interval) -> Interval:
            return kernel.interval(i, j) * self.interval(i, j)

        prove = partial(interval_bounds, cell)
        return partial(proved_or_tried, prove, partial(sampled_bounds, self.arrays(kernel)))

    def majorant(self, kernel: Kernel) -> Majorant | None:
        """Return a majorant of the simulated rate; None if none is known, see `bounds` then."""
        return None
