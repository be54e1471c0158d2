"""Sums over pairs, by each law by which processes of pairs take place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from smolux.functions.time import TimeFunction
from smolux.kernels.base import Kernel
from smolux.kernels.shared import Shared
from smolux.model import Model
from smolux.processes.base import PairProcess
from smolux.processes.daughters import Merged

from .lattice import on_multiples
from .meeting import Meeting
from .operator import Direct, Operator, OperatorFactory

Float = NDArray[np.float64]

#: partners whose rates are found together
_BANDS = 32
#: the largest window on which low rank gives way to the direct sum
DIRECT_MOST = 1 << 13


def merges(process: PairProcess) -> bool:
    """Whether two particles become one."""
    return isinstance(process.daughters, Merged)


class Encounters:
    """The kernel of a model, and its products with the shares that processes have, on a window.

    Parameters
    ----------
    model : Model
    method : str
        How sums are taken, see `OperatorFactory`.
    tolerance : float
        Largest relative error of the entries of a law.
    unit : int
        The sizes are ``unit, 2 unit, ...``.

    Attributes
    ----------
    laws : list of Kernel
        One at least; processes with equal shares have one law.
    merging : list of Kernel
        Those by which particles merge.
    factors : list of TimeFunction
        What multiplies the terms of the kernel, of each of which the processes have laws.
    """

    def __init__(self, model: Model, method: str, tolerance: float, unit: int = 1) -> None:
        pairs = [p for p in model.processes if isinstance(p, PairProcess)]
        shares = [p.shared for p in pairs]
        different = [s for k, s in enumerate(shares) if s not in shares[:k]] or [None]
        terms = model.kernel.in_time or ((TimeFunction.of(1.0), model.kernel),)
        self.factors = [factor for factor, _ in terms]
        #: for each process of pairs, which laws it has, one of each term
        self._of = [
            [len(terms) * different.index(share) + k for k in range(len(terms))] for share in shares
        ]
        self.laws: list[Kernel] = [
            kernel if share is None else Shared(kernel, share)
            for share in different
            for _, kernel in terms
        ]
        merging = {k for ks, p in zip(self._of, pairs, strict=True) if merges(p) for k in ks}
        self.merging = [self.laws[k] for k in sorted(merging)]
        self._factories = [
            OperatorFactory(on_multiples(law, unit), method, tolerance) for law in self.laws
        ]
        self._operators: list[Operator] = []
        #: of each law the rates with small partners that were asked for so far
        self._known: list[Float] = []
        self._tilted = False

    @property
    def notes(self) -> list[str]:
        """Fallbacks, once each."""
        return list(dict.fromkeys(text for f in self._factories for text in f.notes))

    @property
    def direct(self) -> bool:
        """Whether large windows will need a direct sum."""
        return any(factory.direct for factory in self._factories)

    def resize(self, count: int) -> None:
        """Take another number of sizes."""
        self._operators = [factory(count) for factory in self._factories]
        self._known = [np.empty((count, 0)) for _ in self._factories]
        self._tilted = False

    @property
    def name(self) -> str:
        """How the sums are taken."""
        return ", ".join(dict.fromkeys(operator.name for operator in self._operators))

    @property
    def rank(self) -> int:
        """The highest number of transforms for a density."""
        return max(operator.rank for operator in self._operators)

    @property
    def error(self) -> float:
        """The largest relative error of a law that was found on random pairs."""
        return max(operator.error for operator in self._operators)

    def prepare(self, n: Float | None) -> None:
        """Adapt to densities near `n`, shape (M,), or to any."""
        for operator in self._operators:
            operator.prepare(n)

    def refine(self, n: Float) -> bool:
        """Find the sums more exactly near densities `n`; False if there is no way.

        By a tilt of the transforms for these densities; then, on windows where this can be, by the
        direct sum.
        """
        rough = [k for k, each in enumerate(self._operators) if not isinstance(each, Direct)]
        if not rough or not n.any():
            return False
        if not self._tilted:
            self._tilted = True
            self.prepare(n)
            return True
        if len(n) > DIRECT_MOST or not all(f.may_change for f in self._factories):
            return False
        for k in rough:
            self._operators[k] = self._factories[k].direct_sum(len(n))
            self._known[k] = np.empty((len(n), 0))
        return True

    def closed(self) -> None:
        """Note that the terms of a step have added up."""
        self._tilted = False

    def meet(self, sizes: Float, n: Float) -> list[Meeting]:
        """Return the encounters of each law, of densities of shape (S, M)."""
        return [Meeting(operator, sizes, n) for operator in self._operators]

    def laws_of(self, p: int) -> list[int]:
        """Return which laws process number `p` has, for each of `factors`."""
        return self._of[p]

    def by_law(self, factors: Sequence[Sequence[float]]) -> list[float]:
        """Return the sums of numbers for each process of pairs and term over those of each law."""
        sums = [0.0] * len(self.laws)
        for laws, each in zip(self._of, factors, strict=True):
            for law, factor in zip(laws, each, strict=True):
                sums[law] += factor
        return sums

    def loss(self, weights: Sequence[float], n: Float) -> Float:
        """Return ``sum_j K(k, j) n_j`` of all laws, each times its weight; shape (M,)."""
        found = zip(weights, self._operators, strict=True)
        return np.asarray(sum(w * operator.loss(n[None, :])[0] for w, operator in found))

    def near(self, weights: Sequence[float], n: Float, count: int) -> Float:
        """Return what `loss` does by partners of the sizes ``1 .. count`` alone."""
        found = (w * (self._columns(k, count) @ n[:count]) for k, w in enumerate(weights))
        return np.asarray(sum(found))

    def merging_by(self, weights: Sequence[float], n: Float, count: int) -> Float:
        """Return ``K(i, j) n_j`` of all laws for ``j = 1 .. count``, each times its weight."""
        found = (w * (self._columns(k, count) * n[:count]) for k, w in enumerate(weights))
        return np.asarray(sum(found))

    def _columns(self, k: int, count: int) -> Float:
        """Return the rates of law `k` with the sizes ``1 .. count``."""
        if self._known[k].shape[1] < count:
            # one is often enough; where it is not, more will be asked for
            more = 1 if count == 1 else max(count, min(_BANDS, len(self._known[k])))
            self._known[k] = self._operators[k].columns(more)
        return self._known[k][:, :count]

    def beyond(self, weights: Sequence[float], n: Float) -> Float:
        """Return the gain of the sizes ``M + 1 .. 2 M`` of all laws, each times its weight."""
        found = zip(weights, self._operators, strict=True)
        return np.asarray(sum((w * o.beyond(n) for w, o in found if w != 0.0), np.zeros_like(n)))
