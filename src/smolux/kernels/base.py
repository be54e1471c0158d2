"""What every kernel has: the law and what is known of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError

Float = NDArray[np.float64]

#: bounds are widened by this share, so that rounding, which differs between NumPy and compiled
#: code, never breaks them
_ROUNDING = 1e-13


@dataclass(frozen=True)
class Kernel:
    """A collision rate ``K(i, j)`` of particles of sizes ``i`` and ``j``.

    A law is one frozen dataclass: its fields are the parameters, in the order in which `rate`
    takes them after the two sizes. An unordered pair of particles in a volume ``V`` meets at the rate
    ``K(i, j) / V``.

    Attributes
    ----------
    name : str
        The name in case files and in the registry.
    formula : str
        The law as text, in the language of `smolux.formula`.
    cheap : bool
        Whether an evaluation costs no more than reading a table, so that methods do not tabulate it.
    """

    name: ClassVar[str]
    formula: ClassVar[str]
    reference: ClassVar[str] = ""
    cheap: ClassVar[bool] = False
    #: whether `bounds` is proved (interval arithmetic or analysis) or only sampled
    rigorous: ClassVar[bool] = True
    #: key of the closed-form solution in `smolux.exact`, for monodisperse starts
    exact: ClassVar[str | None] = None

    #: ``rate(i, j, *parameters) -> float``: plain Python that Numba can compile; sizes come as floats
    rate: ClassVar[Callable[..., Any]]

    @property
    def parameters(self) -> tuple[float, ...]:
        """The parameters in the order `rate` takes them."""
        return tuple(float(getattr(self, f.name)) for f in fields(self))

    @property
    def degree(self) -> float | None:
        """Homogeneity degree: ``K(c i, c j) = c**degree K(i, j)``; None if not homogeneous or unknown."""
        return None

    @property
    def gels(self) -> bool | None:
        """Whether mass is lost to an infinite cluster in finite time; None if unknown."""
        return None

    def gel_time(self) -> float | None:
        """Gelation time for monomers of unit density; None if unknown or if the kernel does not gel."""
        return None

    def __call__(self, i: ArrayLike, j: ArrayLike) -> Float:
        """Evaluate the law on arrays of sizes, broadcast against each other."""
        i, j = np.broadcast_arrays(np.asarray(i, float), np.asarray(j, float))
        return np.asarray(self.rate(i, j, *self.parameters), float) + np.zeros(i.shape)

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        """Bounds of the law over boxes of sizes ``a <= i <= b``, ``c <= j <= d``.

        Parameters
        ----------
        a, b, c, d : array_like
            Edges of the boxes, broadcast against each other, ``1 <= a <= b`` and ``1 <= c <= d``.

        Returns
        -------
        lower, upper : ndarray
            ``lower <= K(i, j) <= upper`` for every real pair in the box.
        """
        raise NotImplementedError

    def factors(self, sizes: Float) -> tuple[Float, Float] | None:
        """Factors ``u, v`` of shape (rank, sizes), ``K(i, j) = sum_r u[r, i] v[r, j]``, or None.

        Only exact, finite-rank laws answer; for others the solver finds a cross approximation.
        """
        return None

    def problems(self, largest: float = 1.0) -> list[str]:
        """What is wrong with the law on a sample of sizes; empty for the laws of this package."""
        return []


def check_parameters(kernel: Kernel, **ranges: tuple[float, float]) -> None:
    """Check that parameters are finite numbers within their ranges, and the scale is positive.

    Parameters
    ----------
    kernel : Kernel
        Its fields are checked.
    **ranges : (float, float)
        The closed range of a parameter; a parameter without one may have any finite value.

    Raises
    ------
    InputError
        With every problem found.
    """
    problems = []
    for f in fields(kernel):
        value = getattr(kernel, f.name)
        where = f"kernel {kernel.name!r}: {f.name} = {value!r}"
        if isinstance(value, bool) or not isinstance(value, (int, float, np.number)):
            problems.append(f"{where}: must be a number")
        elif not np.isfinite(value):
            problems.append(f"{where}: must be a finite number")
        elif f.name == "scale" and value <= 0:
            problems.append(f"{where}: must be positive")
        elif f.name in ranges and not ranges[f.name][0] <= value <= ranges[f.name][1]:
            low, high = ranges[f.name]
            limits = f"from {low:g} to {high:g}" if high < np.inf else f"at least {low:g}"
            problems.append(f"{where}: must be {limits}")
    if problems:
        raise InputError(problems)


def widen(lower: Float, upper: Float) -> tuple[Float, Float]:
    """Widen bounds of a law that is never negative by the rounding of its evaluation."""
    return lower * (1.0 - _ROUNDING), upper * (1.0 + _ROUNDING)


def corners(
    kernel: Kernel, low: tuple[ArrayLike, ArrayLike], high: tuple[ArrayLike, ArrayLike]
) -> tuple[Float, Float]:
    """Bounds of a law that grows with either size: its values at two corners, of one shape."""
    lower, upper = np.broadcast_arrays(kernel(*low), kernel(*high))
    return widen(lower, upper)


def ratios(a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
    """Range of ``max(i/j, j/i)`` over boxes of sizes."""
    a, b, c, d = (np.asarray(x, float) for x in (a, b, c, d))
    return np.maximum(1.0, np.maximum(a / d, c / b)), np.maximum(b / c, d / a)
