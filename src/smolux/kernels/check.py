"""What a user's kernel may get wrong, found on a sample of sizes."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.errors import InputError

Float = NDArray[np.float64]


class _Law(Protocol):
    """What is asked of a kernel, see `smolux.kernels.base.Kernel`."""

    @property
    def label(self) -> str: ...
    @property
    def degree(self) -> float | None: ...
    @property
    def vanishes(self) -> bool: ...
    @property
    def rigorous(self) -> bool: ...
    @property
    def singled_out(self) -> Float: ...

    def bounds(
        self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike
    ) -> tuple[Float, Float]: ...

    def __call__(self, i: ArrayLike, j: ArrayLike) -> Float: ...


#: all sizes up to this are in the sample
_SMALL = 16
#: sizes up to this power of two are reached by a common simulation
_REACHED = 20
#: relative difference of K(i, j) and K(j, i) that rounding may explain
_ASYMMETRY = 1e-9
_NEGATIVE = "negative; a rate is zero or more, as in max(K, 0)"
_LIMIT = "look for a division by zero, and limit what grows, as in exp(min(x, 500))"


def sample_sizes(largest: float) -> Float:
    """Return the sizes a law is checked at: small ones, then powers of two and neighbours."""
    top = min(max(_REACHED, math.ceil(math.log2(max(largest, 1.0)))), 62)
    powers = 2.0 ** np.arange(5, top + 1)
    return np.unique(
        np.concatenate([np.arange(1.0, _SMALL + 1), powers, powers[::3] - 1, powers[1::3] + 1])
    )


def verdict(value: float) -> str:
    """Return what is wrong with a rate that is negative or not finite, and the cure."""
    if np.isnan(value):
        return "not a number; look for 0/0 or a root or logarithm of a negative number"
    return f"infinite; {_LIMIT}" if np.isinf(value) else _NEGATIVE


def law_problems(kernel: _Law, largest: float) -> list[str]:
    """Return what is wrong with a law; see `Kernel.problems`."""
    where = f"kernel {kernel.label}"
    sizes = np.unique(np.concatenate([sample_sizes(largest), kernel.singled_out]))
    i, j = (x.ravel() for x in np.meshgrid(sizes, sizes, indexing="ij"))
    order = np.argsort(np.maximum(i, j), kind="stable")  # the smallest sizes are named first
    i, j = i[order], j[order]
    try:
        matrix = kernel(sizes[:, None], sizes)
    except Exception as error:  # a user's function may raise anything
        return [_raised(kernel, where, i, j, error)]
    values, mirrored = matrix.ravel()[order], matrix.T.ravel()[order]
    problems = []

    def report(wrong: NDArray[np.bool_], verdict: str) -> None:
        index = np.flatnonzero(wrong)
        if len(index):
            first = index[0]
            more = f" (and {len(index) - 1} more pairs of the sample)" if len(index) > 1 else ""
            pair = f"K({i[first]:.0f}, {j[first]:.0f}) = {values[first]:.6g}"
            problems.append(f"{where}: {pair}{more}: {verdict}")

    finite = np.isfinite(values)
    report(np.isnan(values), verdict(np.nan))
    report(np.isinf(values), verdict(np.inf))
    report(finite & (values < 0), verdict(-1.0))
    with np.errstate(all="ignore"):
        gap = np.abs(values - mirrored) > _ASYMMETRY * np.maximum(np.abs(values), np.abs(mirrored))
    index = np.flatnonzero(gap & finite & np.isfinite(mirrored))
    if len(index):
        first = index[0]
        report(
            gap & finite & np.isfinite(mirrored),
            f"not symmetric, as K({j[first]:.0f}, {i[first]:.0f}) = {mirrored[first]:.6g}; "
            "a pair has no order: take for example the mean of both",
        )
    if finite.all() and not values.any() and not kernel.vanishes:
        problems.append(
            f"{where}: is zero for every pair of the sample: nothing would ever collide; if that "
            "is meant, take smolux.kernels.Constant(0)"
        )
    return problems or _declared(kernel, where, sizes, values, i, j)


def _raised(kernel: _Law, where: str, i: Float, j: Float, error: Exception) -> str:
    for x, y in zip(i, j, strict=True):
        try:
            kernel(x, y)
        except Exception as single:  # the same, now for one pair
            name = type(single).__name__
            cure = _LIMIT if isinstance(single, ArithmeticError) else "correct the function"
            return f"{where}: K({x:.0f}, {y:.0f}) raises {name}: {single}; {cure}"
    return f"{where}: raises {type(error).__name__}: {error}; correct the function"


def _declared(
    kernel: _Law, where: str, sizes: Float, values: Float, i: Float, j: Float
) -> list[str]:
    """Compare the degree and the bounds that the law states with its values."""
    problems = []
    if kernel.degree is not None:
        with np.errstate(all="ignore"):
            expected = 2.0**kernel.degree * values
            doubled = kernel(2 * i, 2 * j)
            wrong = np.abs(doubled - expected) > 1e-6 * np.abs(expected) + 1e-300
        if wrong.any():
            k = np.flatnonzero(wrong)[0]
            problems.append(
                f"{where}: degree = {kernel.degree:g} is wrong: doubling the sizes ({i[k]:.0f}, "
                f"{j[k]:.0f}) multiplies the rate by {doubled[k] / values[k]:.6g}, not "
                f"{2.0**kernel.degree:.6g}; leave it out if the law is not homogeneous"
            )
    low, high = sizes[0], sizes[-1]
    try:
        lower, upper = (float(bound) for bound in kernel.bounds(low, high, low, high))
    except InputError as error:
        return [*problems, *(f"{where}: {problem}" for problem in error.problems)]
    except Exception as error:  # bounds of the user
        return [*problems, f"{where}: bounds raise {type(error).__name__}: {error}; correct them"]
    wrong = ~((values >= lower * (1 - 1e-9)) & (values <= upper * (1 + 1e-9)))
    claimed = kernel.rigorous or getattr(kernel, "declared_bounds", None) is not None
    if wrong.any() and claimed:
        k = np.flatnonzero(wrong)[0]
        problems.append(
            f"{where}: the bounds [{lower:g}, {upper:g}] of the sizes {low:.0f} to {high:.0f} do "
            f"not hold: K({i[k]:.0f}, {j[k]:.0f}) = {values[k]:.6g}; correct or leave out `bounds`"
        )
    return problems
