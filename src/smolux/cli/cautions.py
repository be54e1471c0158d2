"""What to beware of in a case, and what room it takes: as far as is known before it is run."""

from __future__ import annotations

import numpy as np

from smolux import methods
from smolux.case import Case
from smolux.case.settings import Run
from smolux.initial import Sizes
from smolux.processes import Aggregation, Removal, Source
from smolux.processes.base import factors_of
from smolux.runtime.resources import available_memory
from smolux.runtime.room import amount

#: particles for each one at the start, that breakage may make, from which on that is told
_MANY = 10.0
#: what a replica takes at most by any method: bytes for each particle, and bytes
_EACH, _REPLICA = 20, 1_000_000


def physics_warnings(case: Case) -> list[str]:
    """Tell what to beware of, whatever the method: rounding, gelation, sizes that are rare."""
    return [*case.model.initial.remarks, *_gelation(case), *_shares(case)]


def all_warnings(case: Case, run: Run) -> list[str]:
    """Tell what to beware of in a simulation, as far as that is known before there is one."""
    found = [*physics_warnings(case), *_breakage(case, run)]
    if run.replicas == 1:
        found.append("one replica gives no error bars; use 8 or more")
    return found


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


def _breakage(case: Case, run: Run) -> list[str]:
    """Warn of breakage that may make far more particles than there are at the start."""
    keeping = Aggregation, Removal, Source
    names = [p.called for p in case.model.processes if not isinstance(p, keeping)]
    times = mean_size(case)
    if not names or times < _MANY or run.weighting != "number":
        return []
    most = times * run.particles
    memory, there = stores(run, most), available_memory()
    of = "" if there is None else f" of the {amount(there)} that there are"
    return [
        f"{', '.join(names)} can break the mass up into {most:.2g} particles of size 1 in each "
        f"replica, {times:.2g} times as many as at the start, for which stores take up to "
        f"{amount(memory)}{of}: a run that outgrows the memory stops, and goes on from its "
        "checkpoint with more of it"
    ]


def output(case: Case, run: Run) -> float:
    """Bytes of what is observed, at most."""
    mass = run.particles * mean_size(case)
    octaves = max(0.0, float(np.log2(max(mass, 2) / run.sizes)))
    columns = 8 + len(run.orders) + run.sizes + octaves * run.bins_per_octave
    observed = 8.0 * run.replicas * len(run.times) * columns
    if run.distribution:
        observed += 16.0 * run.replicas * len(run.times) * min(run.particles, 2e5)
    return observed


def stores_at_most(run: Run) -> float:
    """Bytes of the particles at the start, whatever the method."""
    return float(run.replicas * (_REPLICA + _EACH * run.particles))


def stores(run: Run, particles: float) -> float:
    """Bytes of so many particles a replica by the method of a run; if that is open, a likely one.

    Methods load Numba.
    """
    found = (m for m in methods.METHODS if m.name == run.method)
    return float(run.replicas * next(found, methods.SizeClass)().bytes_per_replica(int(particles)))


def mean_size(case: Case) -> float:
    """Mean size at the start, from a sample; of what comes in, if it begins empty."""
    sizes, counts = case.model.initial.sample(10_000, 0.5)
    if not counts.sum():
        tables = [p.table for p in case.model.processes if isinstance(p, Source)]
        sizes, counts = (np.concatenate(parts) for parts in zip(*tables, strict=True))
    return float(np.average(sizes, weights=counts))
