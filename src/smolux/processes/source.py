"""Particles come into the system."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from smolux.checks import is_number
from smolux.errors import InputError, Problem

from .base import Float, Process, Varying


@dataclass(frozen=True)
class Source(Varying, Process):
    """Particles come in: ``nothing -> (k)`` at the rate ``J_k`` per volume and time.

    Parameters
    ----------
    rates : float or mapping of int to float
        The rate for monomers, or sizes and their rates: ``{1: 1.0, 10: 0.1}``.
    varying : float, callable or str
        A function of time by which the rates are multiplied.
    label : str, optional
        What it is called in results, if not by its name.

    References
    ----------
    G. B. Field and W. C. Saslaw, Astrophys. J. 142, 568 (1965), doi:10.1086/148318.
    """

    rates: Any = 1.0
    varying: Any = 1.0
    name: ClassVar[str] = "source"
    kind: ClassVar[int] = 2
    opens: ClassVar[bool] = True
    variables: ClassVar[Mapping[str, str]] = {"varying": "t"}

    def __post_init__(self) -> None:
        _ = self.factor
        given = self.rates
        if isinstance(given, Mapping):  # files have sizes as texts
            given = {int(k) if str(k).isdecimal() else k: rate for k, rate in given.items()}
            object.__setattr__(self, "rates", given)
        pairs = list(given.items()) if isinstance(given, Mapping) else [(1, given)]
        problems = [] if pairs else ["source: rates = {}: at least one size is needed"]
        for size, rate in pairs:
            if not (is_number(rate) and 0.0 <= rate < np.inf):
                text = f"source: the rate {rate!r} of size {size!r}: must be finite, zero or more"
                problems.append(Problem.at(text, "rates"))
            if not (is_number(size) and 1 <= size < 2**61 and float(size).is_integer()):
                text = f"source: the size {size!r}: must be a whole number of at least 1"
                problems.append(Problem.at(text, "rates"))
        if not problems and not sum(float(rate) for _, rate in pairs) > 0.0:
            problems.append("source: every rate is zero; take the source out")
        if problems:
            raise InputError(problems)

    @property
    def table(self) -> tuple[NDArray[np.int64], Float]:
        """The sizes, ascending, and their rates."""
        given = self.rates if isinstance(self.rates, Mapping) else {1: self.rates}
        pairs = sorted((int(size), float(rate)) for size, rate in given.items())
        sizes, rates = zip(*pairs, strict=True)
        return np.array(sizes, np.int64), np.array(rates)
