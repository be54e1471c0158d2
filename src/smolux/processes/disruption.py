"""Two particles fall apart into fragments of random sizes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Any, ClassVar

import numpy as np

from smolux.checks import is_number
from smolux.errors import InputError, Problem, about
from smolux.functions.size import SizeFunction
from smolux.functions.time import TimeFunction

from .base import Float, PairProcess
from .daughters import Debris

#: the largest fragment, unless another one is given, and the largest that may be
_LARGEST, _MOST = 64, 1 << 16


def _disrupt(uniform: Callable[..., Any]) -> Callable[..., Any]:
    def outcome(i: int, j: int, sizes: Any, counts: Any, rng: Any, cumulative: Any) -> int:
        left = i + j
        most = min(left, len(cumulative))
        for k in range(most):
            counts[k] = 0
        while left > 0:
            low, high = 0, min(left, len(cumulative)) - 1
            x = uniform(rng) * cumulative[high]
            while low < high:
                middle = (low + high) // 2
                if cumulative[middle] > x:
                    high = middle
                else:
                    low = middle + 1
            counts[low] += 1
            left -= low + 1
        made = 0
        for k in range(most):
            if counts[k] > 0:
                sizes[made], counts[made] = k + 1, counts[k]
                made += 1
        return made

    return outcome


@dataclass(frozen=True)
class CollisionalFragmentation(PairProcess):
    """Colliding particles fall apart: ``(i) + (j) -> fragments``, which have the mass ``i + j``.

    One fragment after the other is drawn: the size k, of those up to what is left, with a
    probability proportional to ``debris(k)``. So mass is conserved exactly, and of a mass that is
    large against the fragments there are ``debris(k)`` of each size, up to a factor.

    Parameters
    ----------
    rate : float, callable or str
        How often, relative to the kernel: a number, a function of time or a formula in t.
    debris : float, str, callable or sequence of float
        The exponent of a power law ``k**-debris``; or a formula in k such as ``"exp(-k/5)"``, a
        function of k, or the values for k = 1, 2, ...; above zero for k = 1, so that something
        always fits. ``[1]`` leaves monomers alone, as `Shattering` does.
    largest : int, optional
        The largest fragment; 64, or as many as there are values.
    share : float, callable or str
        The share of these encounters in which that happens, between 0 and 1: a number, a function
        of both sizes, or a formula in i and j.
    label : str, optional
        What it is called in results, if not by its name.

    References
    ----------
    N. V. Brilliantov et al., PNAS 112, 9536 (2015), doi:10.1073/pnas.1503957112 (debris in
    power laws).
    """

    rate: Any
    debris: Any
    largest: int | None = None
    name: ClassVar[str] = "collisional-fragmentation"
    random: ClassVar[bool] = True
    outcome: ClassVar[Callable[..., Any]] = staticmethod(_disrupt)
    variables: ClassVar[Mapping[str, str]] = {"rate": "t", "debris": "k", "share": "i and j"}

    def __post_init__(self) -> None:
        _ = self.factor, self.shared
        number = isinstance(self.largest, (int, float, np.number))
        if self.largest is not None:
            if not (number and 1 <= self.largest <= _MOST and self.largest == int(self.largest)):
                cure = f"the largest fragment must be a whole number from 1 to {_MOST}"
                raise InputError([Problem("largest", cure, self.largest)])
            object.__setattr__(self, "largest", int(self.largest))
        shares = self.shares
        if not (np.isfinite(shares).all() and (shares >= 0.0).all() and shares[0] > 0.0):
            cure = "must be finite, zero or more, and above zero for k = 1"
            raise InputError([Problem("debris", cure, self.debris)])

    @cached_property
    def shares(self) -> Float:
        """Probabilities of the sizes 1, 2, ... of a fragment, if all fit."""
        given, largest = self.debris, self.largest or _LARGEST
        if is_number(given):
            with np.errstate(all="ignore"):
                values = np.arange(1.0, largest + 1.0) ** -float(given)
        else:
            with about("debris"):
                law = SizeFunction.of(given, "the debris")
            largest = self.largest or (len(law.values) if law.values else _LARGEST)
            values = law(np.arange(1.0, largest + 1.0))
        return values / values.sum()

    @property
    def entries(self) -> int:
        return len(self.shares)

    @property
    def parameters(self) -> tuple[Any, ...]:
        return (np.cumsum(self.shares),)

    @property
    def factor(self) -> TimeFunction:
        with about("rate"):
            return TimeFunction.of(self.rate, "the rate of collisional fragmentation")

    @property
    def daughters(self) -> Debris:
        shares = tuple(self.shares.tolist())
        return Debris(shares, partial(fragments, shares) if len(shares) > 1 else None)


@lru_cache(maxsize=4)
def fragments(shares: tuple[float, ...], largest: int) -> Float:
    """Return the mean numbers of fragments of masses ``1 .. largest``.

    By the first fragment, of size k: ``x(m) = sum_k p_k(m) (e_k + x(m - k))``.

    Returns
    -------
    ndarray of shape (largest, K)
        For each mass, of each size.
    """
    b = np.array(shares)[:largest]
    found = np.zeros((largest + 1, len(b)))
    for m in range(1, largest + 1):
        p = b[:m] / b[:m].sum()
        found[m] = p @ found[m - len(p) : m][::-1]
        found[m, : len(p)] += p
    return found[1:]
