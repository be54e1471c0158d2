"""What every kernel has: the law and what is known of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.checks import is_number
from smolux.errors import InputError, Problem
from smolux.functions.intervals import Interval
from smolux.functions.stated import Stated
from smolux.functions.time import TimeFunction

from .check import law_problems
from .majorant import Majorant

Float = NDArray[np.float64]

#: Boltzmann constant in J/K, exact in the SI
BOLTZMANN = 1.380649e-23

#: sizes are not larger
LARGEST = 2.0**62
#: bounds are widened by this share, so that rounding, which differs between NumPy and compiled
#: code, never breaks them
_ROUNDING = 1e-13


@dataclass(frozen=True)
class Kernel:
    """A collision rate ``K(i, j)`` of particles of sizes ``i`` and ``j``.

    A law is one frozen dataclass: its fields are the parameters, in the order in which `rate`
    takes them after the two sizes. An unordered pair of particles in a volume ``V`` meets at the
    rate ``K(i, j) / V``.

    Attributes
    ----------
    name : str
        The name in case files and in the registry.
    formula : str
        The law as text, in the language of `smolux.functions.formula`.
    cheap : bool
        Whether an evaluation costs no more than reading a table; methods then do not tabulate it.
    """

    name: ClassVar[str]
    formula: ClassVar[str]
    reference: ClassVar[str] = ""
    cheap: ClassVar[bool] = False
    #: whether `bounds` is proved (interval arithmetic or analysis) or only sampled
    rigorous: ClassVar[bool] = True
    #: whether `bounds` is a search, worth being remembered
    searched: ClassVar[bool] = False
    #: whether it may be anything, as what users write: it is tried at more sizes
    arbitrary: ClassVar[bool] = False
    #: key of the closed-form solution in `smolux.exact`, for monodisperse starts
    exact: ClassVar[str | None] = None

    #: parameters for examples and tests, where there is no default
    example: ClassVar[Mapping[str, float]] = {}
    #: names of the classmethods that make the law from physical quantities, in SI units
    constructors: ClassVar[tuple[str, ...]] = ()

    #: ``rate(i, j, *parameters) -> float``: plain Python that Numba compiles; sizes are floats
    rate: ClassVar[Callable[..., Any]]

    @property
    def parameters(self) -> tuple[float, ...]:
        """The parameters in the order `rate` takes them."""
        return tuple(float(getattr(self, f.name)) for f in fields(self))

    @property
    def parts(self) -> tuple[tuple[float, Kernel], ...]:
        """The terms of a sum, each after its coefficient; no sums are among them."""
        return ((1.0, self),)

    @property
    def in_time(self) -> tuple[tuple[TimeFunction, Kernel], ...]:
        """Laws that do not vary, each after what multiplies it in time; none if nothing does.

        These laws add up to this one, which as a function of two sizes has all factors one.
        """
        return ()

    @property
    def monomer(self) -> dict[str, float]:
        """What the law says of the monomer, in SI units; nothing if it knows none."""
        return {}

    @property
    def label(self) -> str:
        """What messages call the law."""
        return repr(self.name)

    @property
    def degree(self) -> float | None:
        """Homogeneity degree, ``K(c i, c j) = c**degree K(i, j)``; None if there is none known."""
        return None

    @property
    def gels(self) -> bool | None:
        """Whether aggregation alone loses mass to a gel in finite time; None if unknown.

        In the rate equations of the infinite system. Kernels that gel at once (their `gel_time` is
        zero) do so in a finite system after a time that falls slowly as it grows.
        """
        return None

    def gel_time(self) -> float | None:
        """Gelation time for monomers of unit density; None if unknown or without gelation."""
        return None

    def __call__(self, i: ArrayLike, j: ArrayLike) -> Float:
        """Evaluate the law on arrays of sizes, broadcast against each other."""
        i, j = np.broadcast_arrays(np.asarray(i, float), np.asarray(j, float))
        with np.errstate(all="ignore"):
            values = self.rate(i, j, *self.parameters)
        return np.array(np.broadcast_to(np.asarray(values, float), i.shape))

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

        Notes
        -----
        A law that does not state them has those of its rate: by intervals, or where these find
        none by trial, see `smolux.kernels.from_function`.
        """
        return self._by_rate.bounds(a, b, c, d)

    @cached_property
    def _by_rate(self) -> Kernel:
        """The law as a function of the user, of which nothing is known but the rate."""
        from .function import from_function

        rate, parameters = self.rate, self.parameters

        def law(i: Any, j: Any) -> Any:
            return rate(i, j, *parameters)

        return from_function(law)

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        if cls.bounds is Kernel.bounds:
            # what is known of bounds that are found from the rate depends on the rate
            for name in ("rigorous", "searched", "singled_out"):
                if name not in vars(cls):
                    told = f"See `Kernel.{name}`."
                    setattr(cls, name, property(partial(_of_rate, name), doc=told))

    def interval(self, i: Interval, j: Interval) -> Interval:
        """Bounds of the law over intervals of sizes, the best only where these are small.

        Raises
        ------
        TypeError
            If there are none but sampled ones.
        """
        return Interval(*self.bounds(i.lo, i.hi, j.lo, j.hi))

    def low_rank_factors(self, sizes: Float) -> tuple[Float, Float] | None:
        """Factors ``u, v`` of shape (rank, sizes), ``K(i, j) = sum_r u[r, i] v[r, j]``, or None.

        Only exact, finite-rank laws answer; for others the solver finds a cross approximation.
        """
        if not self.vanishes:
            return None
        none = np.zeros((1, len(sizes)))
        return none, none

    def majorant(self) -> Majorant | None:
        """Return a majorant of low rank that holds for all sizes from 1 on; None if none is known.

        Methods that need one then find one from `bounds`.
        """
        return None

    @property
    def vanishes(self) -> bool:
        """Whether the law is zero for all sizes, which is proved: nothing collides."""
        if not self.rigorous:
            return False
        return bool(np.max(self.bounds(1.0, LARGEST, 1.0, LARGEST)[1]) == 0.0)

    @property
    def singled_out(self) -> Float:
        """Whole sizes that the law names, where it may differ from what it is beside them."""
        return np.empty(0)

    def __add__(self, other: Any) -> Kernel:
        """Add the rates of two mechanisms, see `Sum`."""
        from .sum import Sum

        if isinstance(other, Kernel):
            return Sum((self, other))
        return self if is_number(other) and other == 0 else NotImplemented

    __radd__ = __add__  # of sum(kernels), which begins with 0

    def __mul__(self, number: Any) -> Kernel:
        """Multiply the rates by a positive number, or by a function of time.

        That is a formula in t such as ``"1 + 0.1*t"``, a Python function, or one with what is known
        of it, see `smolux.law`.
        """
        from .sum import Sum
        from .varying import varied

        if isinstance(number, Kernel):
            return NotImplemented
        if not is_number(number):
            return varied(self, number) if _in_time(number) else NotImplemented
        scale = {
            f.name: float(number) * getattr(self, f.name) for f in fields(self) if f.name == "scale"
        }
        if scale:
            return replace(self, **scale)
        return Sum((self,), (number,))

    __rmul__ = __mul__

    def problems(self, largest: float = 1.0) -> list[str]:
        """Return what is wrong with the law on a sample of sizes.

        Asymmetric, negative, not finite, or an error: with the sizes, the value and the cure. The
        sample holds small sizes, and powers of two and their neighbours up to `largest` or
        2**20, whichever is more: what a kernel does beyond the sizes that are commonly reached is
        not held against it.

        Parameters
        ----------
        largest : float
            The largest size at the start.
        """
        return law_problems(self, largest)

    def to_dict(self) -> dict[str, Any]:
        """Return the law as plain data, as in a case file: ``name`` and the parameters."""
        return {"name": self.name, **{f.name: float(getattr(self, f.name)) for f in fields(self)}}

    def describe(self) -> dict[str, Any]:
        """Return what is known of the law as plain data, for provenance."""
        return {
            **self.to_dict(),
            "formula": self.formula,
            "degree": self.degree,
            "gels": self.gels,
            "reference": self.reference,
        }


def _in_time(value: Any) -> bool:
    """Whether a value may be a function of time."""
    return isinstance(value, (str, Stated, TimeFunction)) or callable(value)


def _of_rate(name: str, kernel: Kernel) -> Any:
    return getattr(kernel._by_rate, name)


def check_parameters(kernel: Kernel, zero: bool = False, **ranges: tuple[float, float]) -> None:
    """Check that parameters are finite numbers within their ranges, and the scale is positive.

    Parameters
    ----------
    kernel : Kernel
        Its fields are checked.
    zero : bool
        Whether the scale may be zero.
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
        if not is_number(value):
            problems.append(Problem.at(f"{where}: must be a number", f.name))
        elif not np.isfinite(value):
            problems.append(Problem.at(f"{where}: must be a finite number", f.name))
        elif f.name == "scale" and not (value > 0 or (zero and value == 0)):
            sign = "zero or more" if zero else "positive"
            problems.append(Problem.at(f"{where}: must be {sign}", f.name))
        elif f.name in ranges and not ranges[f.name][0] <= value <= ranges[f.name][1]:
            low, high = ranges[f.name]
            limits = f"from {low:g} to {high:g}" if high < np.inf else f"at least {low:g}"
            problems.append(Problem.at(f"{where}: must be {limits}", f.name))
    if problems:
        raise InputError(problems)


def check_positive(what: str, **values: float) -> None:
    """Check the physical quantities of a constructor.

    Raises
    ------
    InputError
        With every problem found.
    """
    problems = [
        Problem.at(f"{what}: {key} = {value!r}: must be a positive finite number", key)
        for key, value in values.items()
        if not (is_number(value) and np.isfinite(value) and value > 0)
    ]
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
