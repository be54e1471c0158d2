"""The rate equations of a model on a window of sizes ``1 .. M``."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..model import Model
from ..processes.base import PairProcess, Process
from .beside import Beside
from .operator import Operator, OperatorFactory

Float = NDArray[np.float64]

#: bands of the Jacobian, at most
_BANDS = 32
#: what the bands leave out may amount to so much over a step
_LEFT_OUT = 0.3
#: share of the mass below which there is no gel
_NO_GEL = 1e-10
_GEL_SIZES = 1e14, 1e15


class Equations:
    """Rates of a model on a window that can grow.

    Parameters
    ----------
    model : Model
    factory : OperatorFactory
    largest : int
        The number of sizes M at first.
    mass : float
        Mass per unit volume of the whole system, for the gel.
    gel_reacts : bool
        Whether the mass beyond the window reacts with the sizes in it.
    """

    def __init__(
        self,
        model: Model,
        factory: OperatorFactory,
        largest: int,
        mass: float,
        gel_reacts: bool = False,
    ) -> None:
        self.model, self.mass, self._factory, self._gel_reacts = model, mass, factory, gel_reacts
        self._factors = [p.factor for p in model.processes]
        self.pairs = [p for p in model.processes if isinstance(p, PairProcess)]
        self._beside = Beside(model)
        self.evaluations = 0
        self.resize(largest)

    def resize(self, largest: int) -> None:
        """Take another number of sizes."""
        self.largest = largest
        self.sizes = np.arange(1.0, largest + 1.0)
        self.operator: Operator = self._factory(largest)
        self._bands = np.empty((largest, 0))
        self._gel = gel_affinity(self.model, self.sizes) if self._gel_reacts else None
        self._beside.resize(self.sizes)

    @property
    def quantities(self) -> int:
        """How many quantities `rates` gives to be integrated along."""
        return len(self.processes) + (2 if self.model.open else 0)

    @property
    def processes(self) -> tuple[Process, ...]:
        """The processes of the model."""
        return tuple(self.model.processes)

    def rates(self, times: Float, n: Float) -> tuple[Float, Float]:
        """Return ``dn/dt`` and the rates of collisions, for several densities at once.

        Parameters
        ----------
        times : ndarray of shape (S,)
        n : ndarray of shape (S, M)

        Returns
        -------
        rates : ndarray of shape (S, M)
        events : ndarray of shape (S, Q)
            Events of each process per unit volume and time; if the system is open, the mass that
            comes in and the mass that leaves, too.
        """
        self.evaluations += len(n)
        loss = n * self.operator.loss(n)
        pairs = 0.5 * loss.sum(axis=1)
        if self._gel is not None:
            to_gel = n * self._gel * (self.mass - n @ self.sizes)[:, None]
            loss = loss + to_gel
            pairs += to_gel.sum(axis=1)
        gains: list[Float] = []

        def gain(s: int) -> Float:
            if not gains:
                gains.append(self.operator.gain(n))
            return gains[0][s]

        total, events = np.zeros_like(n), np.zeros((len(n), self.quantities))
        for s, t in enumerate(times):
            for p, process in enumerate(self.pairs):
                total[s] += process.rhs(float(t), self.sizes, n[s], loss[s], partial(gain, s))
                events[s, p] = self._factor(p, float(t)) * pairs[s]
            if len(self.pairs) < len(self.processes):
                factors = [self._factor(p, float(t)) for p in range(len(self.processes))]
                total[s] += self._beside.rates(factors, n[s], events[s])
            if self.largest == self.model.cut:  # what would lie beyond the window leaves, too
                events[s, -1] = events[s, -2] - float(total[s] @ self.sizes)
        return total, events

    def _factor(self, p: int, t: float) -> float:
        factor = float(self._factors[p](t))
        if not (np.isfinite(factor) and factor >= 0.0):
            raise InputError(
                f"the rate of {self.processes[p].name} is {factor:g} at t = {t:.6g}: it must be a "
                "finite number, zero or more, up to the last output time"
            )
        return factor

    def conserves(self, n: Float) -> bool:
        """Whether what happens within the window keeps its mass: a gel takes some of it."""
        if self.model.open:
            return False
        return self._gel is None or self.mass - float(n @ self.sizes) <= _NO_GEL * self.mass

    def shares(self, t: float) -> tuple[float, float]:
        """Return how often loss and gain enter the rates: ``1 + λ`` and 1 with shattering."""
        nothing, one = np.zeros(2), np.array([0.0, 1.0])
        gain = sum(float(p.rhs(t, one, nothing, nothing, lambda: one)[1]) for p in self.pairs)
        return sum(self._factor(p, t) for p in range(len(self.pairs))), gain

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
        if len(self.pairs) == len(self.processes):
            return np.zeros(self.largest)
        return self._beside.losses([self._factor(p, t) for p in range(len(self.processes))])

    def _near(self, n: Float, enough: float) -> list[Float]:
        """Return the loss by near partners, together and each; `enough` of it may be missing."""
        total = self.operator.loss(n[None, :])[0]
        most = min(_BANDS, self.largest)

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
            self._bands = self.operator.columns(1 if count == 1 else min(_BANDS, self.largest))
        return self._bands[:, :count]


def gel_affinity(model: Model, sizes: Float) -> Float:
    """Return ``lim K(k, j) / j`` for large j: the rate at which a mass of gel takes up the size k.

    Zero for kernels that grow more slowly than j, ``(ij)**mu`` with mu < 1: the gel does not react.
    """
    small, large = (model.kernel(sizes, np.full_like(sizes, j)) / j for j in _GEL_SIZES)
    if not np.all(np.isfinite(large)) or np.any(large > small * (1 + 1e-6)):
        raise InputError(
            f"gel = 'reacts': the {model.kernel.label} kernel grows faster than the size of a "
            "partner, so the gel would take up everything at once; use gel='inert'"
        )
    return np.where(np.abs(large - small) <= 1e-6 * np.abs(large), large, 0.0)
