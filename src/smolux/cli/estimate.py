"""What a case will cost, and what to beware of, from a small pilot run."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

import smolux
from smolux.case import Case
from smolux.case.settings import Run
from smolux.cli.cautions import output, stores
from smolux.errors import Interrupted, quiet
from smolux.functions.content import frozen
from smolux.runtime.resources import cores
from smolux.settings import Settings
from smolux.settings.population import doubles_at
from smolux.stochastic.choose_weighting import chosen_weighting

Float = NDArray[np.float64]

#: particles of the first pilot, and the seconds for which a larger one is worth trying
_FIRST, _SHORT, _LIMIT = 1000, 0.2, 4.0
_SEED = 20_240_229
#: particles below which the means of a simulation say little
_FEW = 100.0


def _doubles(run: Run) -> bool:
    return doubles_at(run.population, run.particles) > 0


@dataclass(frozen=True)
class Pilot:
    """A small run of a case, with doubling so that it reaches the end.

    Attributes
    ----------
    particles : int
        At its start.
    times, number_density, collisions, volume, largest : ndarray
        Those of its output times that it reached.
    seconds_per_collision : float
        On one core.
    end : float
        The last output time of the case.
    merging : bool
        Whether all that happens is that two particles become one.
    """

    particles: int
    times: Float
    number_density: Float
    collisions: Float
    volume: Float
    largest: Float
    seconds_per_collision: float
    end: float
    merging: bool

    @property
    def reached(self) -> float:
        """Share of the simulated time that the pilot covers."""
        return float(self.times[-1] / self.end)

    def expected_collisions(self, run: Run) -> float:
        """Collisions of one replica of the case, extrapolated if the pilot is short."""
        so_far, most = self.collisions, np.inf
        if not _doubles(run):
            share = self.volume[0] / self.volume
            # within a step the volume may double, and again
            between = np.sqrt(share * np.concatenate((share[:1], share[:-1])))
            so_far = np.cumsum(np.diff(self.collisions, prepend=0.0) * between)
            if self.merging:  # down to one particle, and no further
                most = run.particles - 1.0
        return min(self._at_the_end(so_far) * run.particles / self.particles, most)

    def _at_the_end(self, so_far: Float) -> float:
        """Go on by the power of time with which a number has grown in the last decade."""
        last, reached = float(so_far[-1]), self.times[-1]
        before = np.searchsorted(self.times, reached / 10.0)
        if self.reached >= 1 or not so_far[before] > 0.0:
            return last / max(self.reached, 1e-9)
        ratios = last / so_far[before], reached / self.times[before]
        power = float(np.log(ratios[0]) / np.log(ratios[1])) if ratios[1] > 1 else 1.0
        return last * (self.end / reached) ** power

    def fewest(self, run: Run) -> float:
        """Particles of one replica of the case where they are fewest, were the volume fixed."""
        if self.number_density[0] == 0.0:  # it begins empty, and that is no loss
            return float("inf")
        return float(np.min(self.number_density) / self.number_density[0]) * run.particles

    def growth(self, run: Run) -> float:
        """Most particles of one replica over those at its start."""
        volume = self.volume if _doubles(run) else self.volume[0]
        return float(max(1.0, np.max(self.number_density * volume) / self.particles))


@dataclass(frozen=True)
class Estimate:
    """What a case will cost.

    Attributes
    ----------
    collisions : float
        In all replicas.
    seconds : float
        Wall time of the simulation, without compilation.
    memory, output : float
        Bytes.
    warnings : list of str
        Of what a run of it has shown.
    """

    collisions: float
    seconds: float
    memory: float
    output: float
    warnings: list[str] = field(default_factory=list)


def weighted(case: Case) -> Any:
    """Return the weighting of a case; chosen, if it is to be."""
    run = case.run
    assert run is not None
    if run.weighting != "auto":
        return run.weighting
    settings = Settings.checked(run.arguments() | {"replicas": 1, "target_error": None})
    if settings.seed is None:
        settings = replace(settings, seed=_SEED)
    return chosen_weighting(frozen(case.model), settings)[0]


def _once(case: Case, particles: int, weighting: Any) -> tuple[Any, bool]:
    """Run one pilot; what it reached, and whether that is the end."""
    run = case.run
    assert run is not None
    end = run.times[-1]
    # the first far below what linear steps see: particles that merge do so early
    times = np.union1d(np.linspace(0, end, 49), end * np.geomspace(1e-12, 1, 145))
    started: list[float] = []

    def halt(progress: Any) -> None:
        # first called when all is compiled, which a time limit would count
        started.append(perf_counter())
        if started[-1] - started[0] > _LIMIT:
            raise KeyboardInterrupt

    try:
        with quiet():  # of a pilot
            ds = smolux.simulate(
                case.model, times, method=run.method, weighting=weighting, particles=particles,
                replicas=1, seed=_SEED, orders=(0,), sizes=1, progress=halt,
            )  # fmt: skip
    except Interrupted as stop:
        return stop.dataset, False
    return ds, True


def pilot(case: Case) -> Pilot:
    """Run a case with few particles, more of them as long as that takes next to no time."""
    assert case.run is not None
    particles, weighting = min(_FIRST, case.run.particles), weighted(case)
    again = False
    while True:
        ds, done = _once(case, particles, weighting)
        seconds = float(ds.attrs["compute_seconds"])
        if done and seconds <= _SHORT and particles < case.run.particles:
            particles, again = min(8 * particles, case.run.particles), False
        elif again or seconds <= _SHORT:
            break
        else:  # bounds that the first one had to find are known to the second
            again = True
    first = ds.isel(replica=0)
    seen = np.isfinite(first["number_density"].values)
    events = max(float(ds.attrs["events"]), 1.0)
    values = {
        name: first[name].values[seen]
        for name in ("number_density", "collisions", "volume", "largest")
    }
    return Pilot(
        particles, first["time"].values[seen], **values,
        seconds_per_collision=seconds / events, end=case.run.times[-1],
        merging=case.model.only_aggregates,
    )  # fmt: skip


def estimate(case: Case) -> Estimate:
    """Estimate what the simulation of a case will cost, and what to beware of.

    Parameters
    ----------
    case : Case
        With a table ``[run]``.

    Returns
    -------
    Estimate
    """
    run = case.run
    assert run is not None
    small = pilot(case)
    collisions = small.expected_collisions(run) * run.replicas
    workers = min(run.replicas, cores())
    observed = output(case, run)
    return Estimate(
        collisions,
        collisions * small.seconds_per_collision / workers,
        stores(run, run.particles * small.growth(run)) + observed,
        observed,
        [*_population_warnings(run, small), *_pilot_warnings(small)],
    )


def _population_warnings(run: Run, small: Pilot) -> list[str]:
    found = []
    fewest = small.fewest(run)
    if not _doubles(run) and fewest < _FEW:
        what = (
            "everything becomes one cluster (extinction)"
            if fewest < 2
            else "replicas may end as one cluster (extinction)"
        )
        found.append(
            f"without doubling only about {max(fewest, 1):.3g} of {run.particles} particles are "
            f'left where they are fewest: {what}; use more particles, or population = "doubling"'
        )
    growth = small.growth(run)
    if growth > 4:
        found.append(
            f"a replica grows to about {growth * run.particles:.2g} particles, {growth:.2g} times "
            "those at its start: shattering after doublings"
        )
    return found


def _pilot_warnings(small: Pilot) -> list[str]:
    if small.reached >= 1:
        return []
    return [
        f"a pilot with {small.particles} particles got to t = {small.times[-1]:.4g} of "
        f"{small.end:.4g} in {_LIMIT:g} s: the numbers above are extrapolated, and may be far off"
    ]
