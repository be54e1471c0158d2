"""From densities at the output times to records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from smolux.processes.base import PairProcess, Process
from smolux.results.records import Records

from .terms import Totals

Float = NDArray[np.float64]


@dataclass
class Snapshot:
    """What is kept of the solution at an output time.

    Attributes
    ----------
    window : int
        The last size.
    mass : float
        Mass in the window.
    mass_error : float
        By what share of the whole mass, with what came in, that in the window differs from what it
        would be if none went beyond the last size.
    beyond : float
        What share of it went there by the account.
    negative : float
        The most negative density over the number density; zero if there is none.
    """

    n: Float
    n_bin: Float
    moment: Float
    number_density: float
    totals: Totals
    window: int
    mass: float
    mass_error: float
    beyond: float
    negative: float


class Observer:
    """Takes snapshots.

    Parameters
    ----------
    orders : ndarray
        Of the moments.
    sizes, bins_per_octave : int
        Densities size by size up to `sizes`, in bins above.
    mass : float
        Mass per unit volume of the whole system at the start.
    processes : sequence of Process
    """

    def __init__(
        self,
        orders: Float,
        sizes: int,
        bins_per_octave: int,
        mass: float,
        processes: Sequence[Process] = (),
    ) -> None:
        self.processes = processes
        self.orders, self.sizes, self.mass = orders, sizes, mass
        first = sizes + 1
        steps = np.arange(int((62 - np.log2(first)) * bins_per_octave) + 1)
        #: the same bins as those of `smolux.simulate`
        self.edges = np.unique([int(first * 2.0 ** (k / bins_per_octave)) for k in steps])

    def __call__(self, n: Float, sizes: Float, totals: Totals) -> Snapshot:
        """Take a snapshot; densities below zero, which are rounding noise, are set to zero."""
        total = float(n.sum())
        negative = float(min(n.min(), 0.0)) / total if total > 0 else 0.0
        n = np.maximum(n, 0.0)
        whole = self.mass + totals.mass_in
        expected = whole - totals.mass_out
        exact = np.zeros(self.sizes)
        few = int(np.searchsorted(sizes, self.sizes, side="right"))
        exact[sizes[:few].astype(np.int64) - 1] = n[:few]
        used = int(np.searchsorted(self.edges, sizes[-1], side="right"))
        place = np.searchsorted(self.edges, sizes[few:], side="right") - 1
        mass = float(n @ sizes)
        return Snapshot(
            n=exact,
            n_bin=np.bincount(place, n[few:], minlength=used)[:used].astype(float),
            moment=np.array([float(n @ sizes**p) for p in self.orders]),
            number_density=total,
            totals=totals,
            window=int(sizes[-1]),
            mass=mass,
            mass_error=(mass - expected) / whole if whole > 0.0 else 0.0,
            beyond=totals.over_mass / whole if whole > 0.0 else 0.0,
            negative=negative,
        )

    @property
    def _open(self) -> bool:
        return any(process.opens for process in self.processes)

    def records(self, times: Sequence[float], shots: Sequence[Snapshot]) -> Records:
        """Return records of one replica; times without a snapshot are NaN."""
        processes = self.processes
        pairs = [k for k, p in enumerate(processes) if isinstance(p, PairProcess)]
        count = len(times)
        bins = max((len(s.n_bin) for s in shots), default=0)

        def filled(*shape: int) -> Float:
            return np.full((1, count, *shape), np.nan)

        values = {
            "number_density": filled(),
            "collisions": filled(),
            "volume": filled(),
            "moment": filled(len(self.orders)),
            "n": filled(self.sizes),
            "n_bin": filled(bins),
            "events": filled(len(processes)),
        }
        if self._open:
            values |= {name: filled() for name in ("mass", "mass_in", "mass_out")}
        for t, shot in enumerate(shots):
            known = {
                "number_density": shot.number_density,
                "collisions": shot.totals.events[pairs].sum(),
                "volume": 1.0,
                "events": shot.totals.events,
                "moment": shot.moment,
                "n": shot.n,
                "n_bin": np.pad(shot.n_bin, (0, bins - len(shot.n_bin))),
                "mass": shot.mass,
                "mass_in": shot.totals.mass_in,
                "mass_out": shot.totals.mass_out,
            }
            for name, column in values.items():
                column[0, t] = known[name]
        records = Records(
            times=np.array(times),
            orders=self.orders,
            processes=tuple(process.called for process in processes),
            bin_edges=np.append(self.edges.astype(float), 2.0**62)[: bins + 1],
            values=values,
        )
        records.attributes["mass_error"] = [s.mass_error for s in shots]
        records.attributes["window"] = [s.window for s in shots]
        return records
