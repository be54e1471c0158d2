"""What happens beside encounters, in the rate equations: single particles, sources, mass."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..model import Model
from ..processes import Source
from ..processes.base import LoneProcess, PairProcess

Float = NDArray[np.float64]


class Beside:
    """Terms of single particles and of sources on a window of sizes."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.first = sum(isinstance(p, PairProcess) for p in model.processes)

    def resize(self, sizes: Float) -> None:
        """Take another number of sizes."""
        self.sizes = sizes
        self._rates = {
            k: p.rates(sizes) if isinstance(p, LoneProcess) else p.densities(len(sizes))
            for k, p in enumerate(self.model.processes)
            if isinstance(p, (LoneProcess, Source))
        }

    def rates(self, factors: Sequence[float], n: Float, events: Float) -> Float:
        """Return ``dn/dt``; write the events of each process, and mass that comes in and leaves."""
        total = np.zeros_like(n)
        for k, process in enumerate(self.model.processes):
            if isinstance(process, Source):
                come = factors[k] * self._rates[k]
                total += come
                events[k] = come.sum()
                events[-2] += float(come @ self.sizes)
            elif isinstance(process, LoneProcess):
                lost = self._rates[k] * n
                total += factors[k] * (process.gain(self.sizes, n, lost) - lost)
                events[k] = factors[k] * lost.sum()
                if process.opens:
                    events[-1] += factors[k] * float(lost @ self.sizes)
        return total

    def losses(self, factors: Sequence[float]) -> Float:
        """Return the rate at which a particle of each size vanishes by itself."""
        lone = [k for k, p in enumerate(self.model.processes) if isinstance(p, LoneProcess)]
        return np.asarray(
            sum(factors[k] * self._rates[k] for k in lone) + np.zeros(len(self.sizes))
        )
