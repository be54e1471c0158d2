"""The rate equations of a model on a window of sizes ``1 .. M``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..model import Model
from ..processes.base import PairProcess, Process
from ..processes.daughters import Merged
from .gel import gel_affinity
from .meeting import Meeting
from .operator import Direct, Operator, OperatorFactory
from .terms import SUMS, Flow, Leaving, term_of
from .timemesh import factor_at

Float = NDArray[np.float64]

#: bands of the Jacobian, at most
_BANDS = 32
#: what the bands leave out may amount to so much over a step
_LEFT_OUT = 0.1
#: the largest window on which low rank gives way to the direct sum
DIRECT_MOST = 1 << 13
#: share of the mass below which there is no gel
_NO_GEL = 1e-10


class Equations:
    """Rates of a model on a window that can grow.

    Parameters
    ----------
    model : Model
    factory : OperatorFactory
    count : int
        The number of sizes M at first.
    mass : float
        Mass per unit volume of the whole system, for the gel.
    gel_reacts : bool
        Whether the mass beyond the window reacts with the sizes in it.
    unit : int
        The sizes are ``unit, 2 unit, ...``; the kernel of `factory` takes them in this unit.

    Attributes
    ----------
    span : (float, float)
        Times to which the factors of the processes are held: they may jump at either.
    """

    def __init__(
        self,
        model: Model,
        factory: OperatorFactory,
        count: int,
        mass: float,
        gel_reacts: bool = False,
        unit: int = 1,
    ) -> None:
        self.model, self.mass, self._factory, self._gel_reacts = model, mass, factory, gel_reacts
        self.unit, self.span = unit, (0.0, np.inf)
        self._factors = [p.factor for p in model.processes]
        self.pairs = [p for p in model.processes if isinstance(p, PairProcess)]
        self.evaluations = 0
        self.resize(count)

    def resize(self, count: int) -> None:
        """Take another number of sizes."""
        self.count = count
        self.sizes = self.unit * np.arange(1.0, count + 1.0)
        self.operator: Operator = self._factory(count)
        self._terms = [term_of(process, self.sizes) for process in self.processes]
        self._bands, self._tilted = np.empty((count, 0)), False
        self._beyond: Float | None = None
        self._gel = gel_affinity(self.model.kernel, self.sizes) if self._gel_reacts else None

    def refine(self, n: Float) -> bool:
        """Find the sums over pairs more exactly near densities `n`; False if there is no way.

        By a tilt of the transforms for these densities; then, on windows where this can be, by the
        direct sum.
        """
        if isinstance(self.operator, Direct) or not n.any():
            return False
        if not self._tilted:
            self._tilted = True
            self.operator.prepare(n)
            return True
        if self.count > DIRECT_MOST or not self._factory.may_change:
            return False
        self.operator = self._factory.direct_sum(self.count)
        self._bands = np.empty((self.count, 0))
        return True

    def closed(self) -> None:
        """Note that the terms of a step have added up."""
        self._tilted = False

    @property
    def cut(self) -> bool:
        """Whether the window ends where particles leave the system at once."""
        return self.model.cut is not None and self.count == max(self.model.cut // self.unit, 1)

    @property
    def leaves(self) -> bool:
        """Whether anything ever leaves the system."""
        return self.cut or any(isinstance(term, Leaving) for term in self._terms)

    @property
    def quantities(self) -> int:
        """How many quantities `rates` gives to be integrated along, see `Totals`."""
        return len(self.processes) + SUMS

    @property
    def processes(self) -> tuple[Process, ...]:
        """The processes of the model."""
        return tuple(self.model.processes)

    def rates(self, times: Float, n: Float) -> tuple[Float, Float]:
        """Return ``dn/dt`` and what is integrated along, for several densities at once.

        Parameters
        ----------
        times : ndarray of shape (S,)
        n : ndarray of shape (S, M)

        Returns
        -------
        rates : ndarray of shape (S, M)
        along : ndarray of shape (S, Q)
            Events of each process per unit volume and time, and the account of number and mass, see
            `Totals`.
        """
        self.evaluations += len(n)
        meeting, flow = Meeting(self.operator, self.sizes, n), Flow(n, len(self.processes))
        for p, term in enumerate(self._terms):
            term.add(p, self._factor(p, times), n, meeting, flow)
        self._beyond = None if meeting.beyond is None else meeting.beyond[-1]
        if self._gel is not None:
            for p in range(len(self.pairs)):  # which all aggregate
                self._to_gel(p, self._factor(p, times), n, flow)
        if self.cut:
            flow.leave()
        return flow.rates, flow.along

    def beyond(self, t: float, n: Float) -> Float:
        """Return what appears per time of the sizes above the last one, up to twice that.

        Nothing where it leaves the system. For the densities of the last call of `rates` if the
        sums held it, which are those of the end of a step, else for `n`.
        """
        merged = [p for p, process in enumerate(self.pairs) if _merges(process)]
        if self.cut or not merged:
            return np.zeros_like(n)
        factor = sum(float(self._factor(p, np.array([t]))[0]) for p in merged)
        found = self._beyond if self._beyond is not None else self.operator.beyond(n)
        return factor * found

    def _to_gel(self, p: int, factor: Float, n: Float, flow: Flow) -> None:
        """Let the mass beyond the window take up particles."""
        assert self._gel is not None
        lost = n * self._gel * (factor * (self.mass - n @ self.sizes))[:, None]
        events = lost.sum(axis=1)
        flow.rates -= lost
        flow.events[:, p] += events
        flow.number -= events
        flow.over_mass += lost @ self.sizes

    def _factor(self, p: int, times: Float) -> Float:
        """Return how often a process takes place at some times, relative to its rate."""
        law = self._factors[p]
        if law.constant is not None:
            return np.full(len(times), law.constant)
        return factor_at(law, np.clip(times, *self.span), f"the rate of {self.processes[p].called}")

    def conserves(self, n: Float) -> bool:
        """Whether no mass leaves at a rate that depends on what is there."""
        if any(isinstance(term, Leaving) and term.vanishing.any() for term in self._terms):
            return False
        return self._gel is None or self.mass - float(n @ self.sizes) <= _NO_GEL * self.mass

    def shares(self, t: float) -> tuple[float, float]:
        """Return how often loss and gain enter the rates: ``1 + λ`` and 1 with shattering."""
        at = np.array([t])
        factors = [float(self._factor(p, at)[0]) for p in range(len(self.pairs))]
        merged = sum(f for f, p in zip(factors, self.pairs, strict=True) if _merges(p))
        return sum(factors), merged

    def jacobian(self, t: float, n: Float, h: float) -> tuple[Float, Float]:
        """Return the stiff part: minus its diagonal, shape (M,), and J bands below, shape (M, J).

        A large cluster meets small ones often and grows a little each time: gain and loss by
        partners of the sizes ``1 .. J`` nearly cancel, so they must be taken together. J is the
        least for which other partners matter little over a step of length h. If there is none, all
        of the loss is taken, which then damps more than the gain left out can add.
        """
        loss, gain = self.shares(t)
        near = self._near(n, _LEFT_OUT / max(loss * h, 1e-300))
        if self._gel is not None:
            near[0] += self._gel * (self.mass - float(n @ self.sizes))
        return loss * near[0] + self.lone_losses(t), gain * near[1]

    def lone_losses(self, t: float) -> Float:
        """Return the rate at which a particle of each size vanishes by itself, shape (M,)."""
        total, at = np.zeros(self.count), np.array([t])
        for p, term in enumerate(self._terms):
            if term.vanishing is not None:
                total += self._factor(p, at) * term.vanishing
        return total

    def _near(self, n: Float, enough: float) -> list[Float]:
        """Return the loss by near partners, together and each; `enough` of it may be missing."""
        total = self.operator.loss(n[None, :])[0]
        most = min(_BANDS, self.count)

        def left_out(count: int) -> float:
            return float(np.max(total - self._columns(count) @ n[:count]))

        count = 1
        if left_out(1) > enough and most > 1:
            # not more bands where partners of all sizes matter alike
            least = 1.5 * left_out(most)
            while 2 * count <= most and left_out(count) > max(enough, least):
                count *= 2
        columns = self._columns(count)
        all_of_it = left_out(count) > enough
        return [total if all_of_it else columns @ n[:count], columns * n[:count]]

    def _columns(self, count: int) -> Float:
        if self._bands.shape[1] < count:
            self._bands = self.operator.columns(1 if count == 1 else min(_BANDS, self.count))
        return self._bands[:, :count]


def _merges(process: PairProcess) -> bool:
    return isinstance(process.daughters, Merged)
