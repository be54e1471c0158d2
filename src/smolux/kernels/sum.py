"""Several mechanisms of encounter at once: sums of laws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from smolux.checks import is_number
from smolux.errors import InputError
from smolux.functions.content import frozen
from smolux.functions.intervals import Interval
from smolux.functions.time import TimeFunction

from .base import Float, Kernel
from .composite import MadeOfKernels
from .majorant import Majorant
from .varying import ONE


@dataclass(frozen=True)
class Sum(MadeOfKernels):
    """Several mechanisms at once: ``K(i, j) = sum_r c_r K_r(i, j)``.

    Made by ``+`` and ``*``: ``kernels.Brownian.continuum(...) + 0.5 * kernels.Shear(...)``. Terms
    may be multiplied by functions of time, too: ``kernels.Shear(...) * "exp(-t)"``.

    That rates add is exact for mechanisms that do not change each other, and an approximation for
    others, such as Brownian motion and a flow (M. Elimelech, J. Gregory, X. Jia and R. Williams,
    Particle Deposition and Aggregation, Butterworth-Heinemann 1995, section 6.6).

    Parameters
    ----------
    terms : sequence of Kernel
    coefficients : sequence of float, optional
        Positive; 1 each by default.

    Raises
    ------
    InputError
        With every problem found.
    """

    terms: tuple[Kernel, ...]
    coefficients: tuple[float, ...] = ()
    name: ClassVar[str] = "sum"

    def __post_init__(self) -> None:
        terms = tuple(self.terms) if isinstance(self.terms, Sequence) else (self.terms,)
        numbers = tuple(self.coefficients) or (1.0,) * len(terms)
        problems = [
            f"sum of kernels: term {k} = {term!r}: must be a kernel of smolux.kernels"
            for k, term in enumerate(terms)
            if not isinstance(term, Kernel)
        ]
        problems += [
            f"sum of kernels: coefficient {number!r}: must be a positive finite number"
            for number in numbers
            if not (is_number(number) and np.isfinite(number) and number > 0)
        ]
        if not terms:
            problems.append("sum of kernels: has no terms; give one kernel at least")
        elif len(numbers) != len(terms):
            problems.append(
                f"sum of kernels: {len(terms)} terms and {len(numbers)} coefficients; give one each"
            )
        if problems:
            raise InputError(problems)
        flat: list[tuple[float, Kernel]] = []
        for number, term in zip(numbers, terms, strict=True):
            flat += [(float(number) * each, kernel) for each, kernel in term.parts]
        _check_monomers([kernel for _, kernel in flat])
        object.__setattr__(self, "terms", tuple(kernel for _, kernel in flat))
        object.__setattr__(self, "coefficients", tuple(number for number, _ in flat))

    @property
    def parts(self) -> tuple[tuple[float, Kernel], ...]:
        return tuple(zip(self.coefficients, self.terms, strict=True))

    @property
    def in_time(self) -> tuple[tuple[TimeFunction, Kernel], ...]:
        """See `Kernel.in_time`; terms with the same factor are one law."""
        by_factor: dict[TimeFunction, list[tuple[float, Kernel]]] = {}
        for number, kernel in self.parts:
            ((factor, plain),) = kernel.in_time or ((ONE, kernel),)
            by_factor.setdefault(factor, []).append((number, plain))
        if list(by_factor) == [ONE]:
            return ()
        return tuple(
            (factor, Sum(tuple(k for _, k in terms), tuple(c for c, _ in terms)))
            for factor, terms in by_factor.items()
        )

    @property
    def made_of(self) -> tuple[Kernel, ...]:
        return self.terms

    def __repr__(self) -> str:
        return " + ".join(f"{'' if c == 1 else f'{c!r} * '}{k!r}" for c, k in self.parts)

    @property
    def label(self) -> str:
        return " + ".join(kernel.label for kernel in self.terms)

    @property
    def formula(self) -> str:  # type: ignore[override]
        """The formulas of the terms, each of which has its own parameters."""
        return " + ".join(f"{c!r} * ({k.formula})" for c, k in self.parts)

    @property
    def rate(self) -> Callable[..., Any]:  # type: ignore[override]
        """See `Kernel.rate`; the same object for sums of the same laws."""
        return _added(tuple((frozen(k.rate), len(k.parameters)) for _, k in self.parts))

    @property
    def parameters(self) -> tuple[float, ...]:
        """See `Kernel.parameters`; of each term its coefficient and then its own."""
        return tuple(p for number, kernel in self.parts for p in (number, *kernel.parameters))

    @property
    def cheap(self) -> bool:  # type: ignore[override]
        """See `Kernel.cheap`."""
        return all(kernel.cheap for kernel in self.terms)

    @property
    def exact(self) -> str | None:  # type: ignore[override]
        """See `Kernel`; a sum of bilinear laws is one."""
        return None if any(kernel.exact is None for kernel in self.terms) else "bilinear"

    @property
    def degree(self) -> float | None:
        """See `Kernel.degree`; that of all terms, if they have one."""
        degrees = {kernel.degree for kernel in self.terms}
        return degrees.pop() if len(degrees) == 1 else None

    @property
    def gels(self) -> bool | None:
        """See `Kernel.gels`; what no term does alone, a sum may be not known to do."""
        known = [kernel.gels for kernel in self.terms]
        return True if any(known) else None if None in known else False

    def __call__(self, i: ArrayLike, j: ArrayLike) -> Float:
        return np.asarray(sum(number * kernel(i, j) for number, kernel in self.parts))

    def bounds(self, a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> tuple[Float, Float]:
        """See `Kernel.bounds`; the sums of those of the terms."""
        found = [(number, kernel.bounds(a, b, c, d)) for number, kernel in self.parts]
        lower, upper = (np.asarray(sum(c * ends[k] for c, ends in found)) for k in (0, 1))
        return lower, upper

    def interval(self, i: Interval, j: Interval) -> Interval:
        first, *others = (number * kernel.interval(i, j) for number, kernel in self.parts)
        for other in others:
            first = first + other
        return first

    def low_rank_factors(self, sizes: Float) -> tuple[Float, Float] | None:
        """See `Kernel.low_rank_factors`; known if those of all terms are."""
        found = [(number, kernel.low_rank_factors(sizes)) for number, kernel in self.parts]
        if any(factors is None for _, factors in found):
            return None
        pairs = [(number * u, v) for number, (u, v) in found]  # type: ignore[misc]
        left, right = zip(*pairs, strict=True)
        return np.concatenate(left), np.concatenate(right)

    def majorant(self) -> Majorant | None:
        """See `Kernel.majorant`; the sum of those of the terms, if all are known."""
        found = [(number, kernel.majorant()) for number, kernel in self.parts]
        if any(majorant is None for _, majorant in found):
            return None
        known = [(number, majorant) for number, majorant in found if majorant is not None]
        terms = tuple((number * w, p, q) for number, m in known for w, p, q in m.terms)
        return Majorant(terms, min(m.least for _, m in known))

    def to_dict(self) -> dict[str, Any]:
        """See `Kernel.to_dict`: the terms, each with its coefficient."""
        return {"name": self.name, "terms": [_term(c, k.to_dict()) for c, k in self.parts]}

    def describe(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "terms": [_term(c, k.describe()) for c, k in self.parts],
            "formula": self.formula,
            "degree": self.degree,
            "gels": self.gels,
        }


def _check_monomers(terms: Sequence[Kernel]) -> None:
    """Check that the terms mean the same particles by a size."""
    known: dict[str, tuple[float, Kernel]] = {}
    for kernel in terms:
        for key, value in kernel.monomer.items():
            before, other = known.setdefault(key, (value, kernel))
            if abs(before - value) > 1e-9 * before:
                raise InputError(
                    f"sum of kernels: {key} = {before:g} of {other.label} and {value:g} of "
                    f"{kernel.label}: the monomers differ; give all terms the same"
                )


def _term(coefficient: float, table: dict[str, Any]) -> dict[str, Any]:
    return table if coefficient == 1.0 else {**table, "coefficient": coefficient}


@lru_cache(maxsize=64)
def _added(laws: tuple[tuple[Callable[..., Any], int], ...]) -> Callable[..., Any]:
    """Bind the sum of laws, of each of which the number of parameters is given."""
    (first, own), *others = laws

    if not others:

        def rate(i: Any, j: Any, *p: Any) -> Any:
            return p[0] * first(i, j, *p[1:])

        return frozen(rate)

    rest, end = _added(tuple(others)), own + 1

    def rates(i: Any, j: Any, *p: Any) -> Any:
        return p[0] * first(i, j, *p[1:end]) + rest(i, j, *p[end:])

    return frozen(rates)
