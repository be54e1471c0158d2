"""The rate equations of a model on a window of sizes ``1 .. M``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from smolux.functions.time import TimeFunction
from smolux.model import Model
from smolux.processes.base import PairProcess, Process

from .encounters import Encounters, merges
from .gel import gel_affinity
from .terms import SUMS, Flow, Leaving, term_of
from .timemesh import factor_at

Float = NDArray[np.float64]

#: bands of the Jacobian, at most
_BANDS = 32
#: what the bands leave out may amount to so much over a step
_LEFT_OUT = 0.1
#: share of the mass below which there is no gel
_NO_GEL = 1e-10


class Equations:
    """Rates of a model on a window that can grow.

    Parameters
    ----------
    model : Model
    encounters : Encounters
        Of this model.
    count : int
        The number of sizes M at first.
    mass : float
        Mass per unit volume of the whole system, for the gel.
    gel_reacts : bool
        Whether the mass beyond the window reacts with the sizes in it.
    unit : int
        The sizes are ``unit, 2 unit, ...``, as those of the encounters.

    Attributes
    ----------
    span : (float, float)
        Times to which the factors of the processes are held: they may jump at either.
    """

    def __init__(
        self,
        model: Model,
        encounters: Encounters,
        count: int,
        mass: float,
        gel_reacts: bool = False,
        unit: int = 1,
    ) -> None:
        self.model, self.mass, self._gel_reacts = model, mass, gel_reacts
        self.encounters = encounters
        self.unit, self.span = unit, (0.0, np.inf)
        self._factors = [p.factor for p in model.processes]
        self.pairs = [p for p in model.processes if isinstance(p, PairProcess)]
        self.evaluations = 0
        self.resize(count)

    def resize(self, count: int) -> None:
        """Take another number of sizes."""
        self.count = count
        self.sizes = self.unit * np.arange(1.0, count + 1.0)
        self.encounters.resize(count)
        self._terms = [term_of(process, self.sizes) for process in self.processes]
        self._beyond: list[Float | None] = []
        #: of each law of encounters, if the gel reacts
        self._gel = [
            gel_affinity(law, self.sizes) for law in self.encounters.laws if self._gel_reacts
        ]

    def refine(self, n: Float) -> bool:
        """Find the sums over pairs more exactly near densities `n`; see `Encounters.refine`."""
        return self.encounters.refine(n)

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
        meetings = self.encounters.meet(self.sizes, n)
        flow = Flow(n, len(self.processes))
        for p, term in enumerate(self._terms):
            for law, factor in self._ways(p, times):
                term.add(p, factor, n, meetings[law], flow)
        self._beyond = [None if m.beyond is None else m.beyond[-1] for m in meetings]
        if self._gel:
            for p in range(len(self.pairs)):  # which all aggregate
                for law, factor in self._ways(p, times):
                    self._to_gel(p, law, factor, n, flow)
        if self.cut:
            flow.leave()
        return flow.rates, flow.along

    def beyond(self, t: float, n: Float) -> Float:
        """Return what appears per time of the sizes above the last one, up to twice that.

        Nothing where it leaves the system. For the densities of the last call of `rates` if the
        sums held it, which are those of the end of a step, else for `n`.
        """
        weights = self._weights(t)[1]
        if self.cut or not any(weights):
            return np.zeros_like(n)
        if any(w > 0.0 and b is None for w, b in zip(weights, self._beyond, strict=True)):
            return self.encounters.beyond(weights, n)
        found = zip(weights, self._beyond, strict=True)
        return np.asarray(sum(w * b for w, b in found if b is not None))

    def _to_gel(self, p: int, law: int, factor: Float, n: Float, flow: Flow) -> None:
        """Let the mass beyond the window take up particles."""
        lost = n * self._gel[law] * (factor * (self.mass - n @ self.sizes))[:, None]
        events = lost.sum(axis=1)
        flow.rates -= lost
        flow.events[:, p] += events
        flow.number -= events
        flow.over_mass += lost @ self.sizes

    def _factor(self, p: int, times: Float) -> Float:
        """Return how often a process takes place at some times, relative to its rate."""
        return self._at(self._factors[p], times, f"the rate of {self.processes[p].called}")

    def _at(self, law: TimeFunction, times: Float, what: str) -> Float:
        if law.constant is not None:
            return np.full(len(times), law.constant)
        return factor_at(law, np.clip(times, *self.span), what)

    def _ways(self, p: int, times: Float) -> list[tuple[int, Float]]:
        """Return the laws of encounters of a process, each with how often it takes place by it.

        For what needs no encounter, the first law and the rate.
        """
        factor = self._factor(p, times)
        if p >= len(self.pairs):
            return [(0, factor)]
        terms = zip(self.encounters.laws_of(p), self.encounters.factors, strict=True)
        what = "the factor of the kernel"
        return [(law, factor * self._at(each, times, what)) for law, each in terms]

    def conserves(self, n: Float) -> bool:
        """Whether no mass leaves at a rate that depends on what is there."""
        if any(isinstance(term, Leaving) and term.vanishing.any() for term in self._terms):
            return False
        return not self._gel or self.mass - float(n @ self.sizes) <= _NO_GEL * self.mass

    def _weights(self, t: float) -> tuple[list[float], list[float]]:
        """Return how often loss and gain of each law of encounters enter the rates.

        ``1 + λ`` and 1 with shattering.
        """
        at = np.array([t])
        factors = [
            [float(factor[0]) for _, factor in self._ways(p, at)] for p in range(len(self.pairs))
        ]
        merged = [
            each if merges(process) else [0.0] * len(each)
            for each, process in zip(factors, self.pairs, strict=True)
        ]
        return self.encounters.by_law(factors), self.encounters.by_law(merged)

    def loss(self, t: float, n: Float) -> Float:
        """Return the rate at which a particle of each size vanishes in all, shape (M,)."""
        return self.encounters.loss(self._weights(t)[0], n) + self.unary_losses(t)

    def gain_by(self, t: float, n: Float, count: int) -> Float:
        """Return how particles merge with those of the sizes ``1 .. count``, shape (M, count)."""
        return self.encounters.merging_by(self._weights(t)[1], n, count)

    def overflow(self, t: float, n: Float) -> Float:
        """Return what `beyond` does, from these densities."""
        return self.encounters.beyond(self._weights(t)[1], n)

    def jacobian(self, t: float, n: Float, h: float) -> tuple[Float, Float]:
        """Return the stiff part: minus its diagonal, shape (M,), and J bands below, shape (M, J).

        A large cluster meets small ones often and grows a little each time: gain and loss by
        partners of the sizes ``1 .. J`` nearly cancel, so they must be taken together. J is the
        least for which other partners matter little over a step of length h. If there is none, all
        of the loss is taken, which then damps more than the gain left out can add.
        """
        losses, gains = self._weights(t)
        count, loss = self._near(losses, n, _LEFT_OUT / h)
        if self._gel:
            missing = self.mass - float(n @ self.sizes)
            for weight, gel in zip(losses, self._gel, strict=True):
                loss = loss + weight * gel * missing
        return loss + self.unary_losses(t), self.encounters.merging_by(gains, n, count)

    def unary_losses(self, t: float) -> Float:
        """Return the rate at which a particle of each size vanishes by itself, shape (M,)."""
        total, at = np.zeros(self.count), np.array([t])
        for p, term in enumerate(self._terms):
            if term.vanishing is not None:
                total += self._factor(p, at) * term.vanishing
        return total

    def _near(self, weights: list[float], n: Float, enough: float) -> tuple[int, Float]:
        """Return how many partners are near, and the loss; `enough` of it may be missing."""
        total = self.encounters.loss(weights, n)
        most = min(_BANDS, self.count)

        def left_out(count: int) -> float:
            return float(np.max(total - self.encounters.near(weights, n, count)))

        count = 1
        if left_out(1) > enough and most > 1:
            # not more bands where partners of all sizes matter alike
            least = 1.5 * left_out(most)
            while 2 * count <= most and left_out(count) > max(enough, least):
                count *= 2
        if left_out(count) > enough:
            return count, total
        return count, self.encounters.near(weights, n, count)
