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
from smolux.errors import Interrupted, quiet
from smolux.functions.content import frozen
from smolux.initial import Sizes
from smolux.methods import METHODS, SizeClass
from smolux.methods.base import Method
from smolux.processes import Aggregation, Removal, Source
from smolux.runtime.resources import available_memory, cores
from smolux.runtime.room import amount
from smolux.settings import Settings
from smolux.settings.population import doubles_at
from smolux.stochastic.choose_weighting import chosen_weighting
from smolux.stochastic.windows import factors_of

Float = NDArray[np.float64]

#: particles of the first pilot, and the seconds for which a larger one is worth trying
_FIRST, _SHORT, _LIMIT = 1000, 0.2, 4.0
_SEED = 20_240_229
#: particles below which the means of a simulation say little
_FEW = 100.0
#: particles for each one at the start, that breakage may make, from which on that is told
_MANY = 10.0


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
    memory, output = _bytes(case, run, small)
    return Estimate(
        collisions,
        collisions * small.seconds_per_collision / workers,
        memory,
        output,
        [
            *physics_warnings(case), *_population_warnings(run, small), *_pilot_warnings(small),
            *_breakage(case, run),
        ],
    )  # fmt: skip


def _bytes(case: Case, run: Run, small: Pilot) -> tuple[float, float]:
    mass = run.particles * mean_size(case)
    octaves = max(0.0, float(np.log2(max(mass, 2) / run.sizes)))
    columns = 8 + len(run.orders) + run.sizes + octaves * run.bins_per_octave
    output = 8.0 * run.replicas * len(run.times) * columns
    if run.distribution:
        output += 16.0 * run.replicas * len(run.times) * min(run.particles, 2e5)
    most = int(run.particles * small.growth(run))
    return run.replicas * _method(run).bytes_per_replica(most) + output, output


def _method(run: Run) -> Method:
    """Return the method of a case; if it is to be chosen, one that is likely."""
    return next((m for m in METHODS if m.name == run.method), SizeClass)()


def mean_size(case: Case) -> float:
    """Mean size at the start, from a sample; of what comes in, if it begins empty."""
    sizes, counts = case.model.initial.sample(10_000, 0.5)
    if not counts.sum():
        tables = [p.table for p in case.model.processes if isinstance(p, Source)]
        sizes, counts = (np.concatenate(parts) for parts in zip(*tables, strict=True))
    return float(np.average(sizes, weights=counts))


# --- warnings --------------------------------------------------------------------------------


def physics_warnings(case: Case) -> list[str]:
    """Tell what to beware of, whatever the method: rounding, gelation, sizes that are rare."""
    return [*case.model.initial.remarks, *_gelation(case), *_shares(case)]


def negative_rates(case: Case) -> list[str]:
    """Find mistakes that a run would meet only on its way: rates that fall below zero."""
    found = []
    times = np.linspace(0.0, case.times[-1], 2001)
    model = case.model
    for process, factor in ((p, f) for p in model.processes for f in factors_of(p, model.kernel)):
        if factor.constant is not None:
            continue
        values = np.asarray(factor(times))
        wrong = ~(np.isfinite(values) & (values >= 0))
        if wrong.any():
            t = times[np.argmax(wrong)]
            found.append(
                f"the rate of {process.called}, {factor.text}, is {float(factor(float(t))):.3g} at "
                f"t = {t:.6g}; it must be a finite number, zero or more, up to the last time: "
                f'for example "max(0, {factor.text})"'
            )
    return found


def _gelation(case: Case) -> list[str]:
    model = case.model.reduced
    kernel, initial = model.kernel, model.initial
    if not model.only_aggregates:
        return []  # what breaks clusters up can prevent a gel: no statement is known
    end = case.times[-1]
    if kernel.gels is None:
        if kernel.degree is None or kernel.degree <= 1:
            return []
        return [
            f"the kernel has degree {kernel.degree:.3g}, above 1: it may gel (one cluster takes a "
            "finite share of the mass in finite time)"
        ]
    unit = kernel.gel_time() if model.plain_aggregation else None
    if not kernel.gels:
        return []
    after = (
        "from then on one cluster holds a finite share of the mass: a simulation follows it (see "
        "'largest'), the rate equations lose it"
    )
    if case.solve is not None and case.solve.gel == "inert":
        after += '; to compare both, set solve.gel = "reacts"'
    if unit is None:
        return [f"the kernel gels, at a time that is not known; {after}"]
    if initial.largest > 1:
        scale = initial.total * mean_size(case)
        return [
            f"the kernel gels, monomers of the same mass at t = {unit / scale:.4g}, this initial "
            f"condition sooner; {after}"
        ] if unit / scale <= end else []  # fmt: skip
    time = unit / initial.total
    return [f"gelation at t = {time:.4g}, before the end at {end:.4g}: {after}"] if (
        time <= end
    ) else []  # fmt: skip


def _shares(case: Case) -> list[str]:
    initial, run = case.model.initial, case.run
    if run is None or not isinstance(initial, Sizes):
        return []
    expected = {
        size: density / initial.total * run.particles
        for size, density in zip(initial.sizes, initial.densities_, strict=True)
    }
    rare = [size for size, count in expected.items() if 0 < count < 10]
    if not rare:
        return []
    return [
        f"of size {', '.join(map(str, rare))} there are fewer than 10 particles at the start: use "
        "more particles"
    ]


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
    if run.replicas == 1:
        found.append("one replica gives no error bars; use 8 or more")
    return found


def _breakage(case: Case, run: Run) -> list[str]:
    """Warn of breakage that may make far more particles than there are at the start."""
    keeping = Aggregation, Removal, Source
    names = [p.called for p in case.model.processes if not isinstance(p, keeping)]
    times = mean_size(case)
    if not names or times < _MANY or run.weighting != "number":
        return []
    most = times * run.particles
    memory, there = run.replicas * _method(run).bytes_per_replica(int(most)), available_memory()
    of = "" if there is None else f" of the {amount(there)} that there are"
    return [
        f"{', '.join(names)} can break the mass up into {most:.2g} particles of size 1 in each "
        f"replica, {times:.2g} times as many as at the start, for which stores take up to "
        f"{amount(memory)}{of}: a run that outgrows the memory stops, and goes on from its "
        "checkpoint with more of it"
    ]


def _pilot_warnings(small: Pilot) -> list[str]:
    if small.reached >= 1:
        return []
    return [
        f"a pilot with {small.particles} particles got to t = {small.times[-1]:.4g} of "
        f"{small.end:.4g} in {_LIMIT:g} s: the numbers above are extrapolated, and may be far off"
    ]
