"""What the result holds, each variable declared once, with all that is to be known of it.

The tally of a run, how sub-volumes make it up, the Dataset with its units and its page in the
reference follow. A variable that is a column of the state is a row here and nothing else; one that
is computed has a function beside it, by its name, in `smolux.stochastic.observe`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .core.columns import Rule, merged
from .core.state import (
    COLUMNS,
    EVENTS,
    EXTINCT,
    MASS_IN,
    MASS_OUT,
    PARTICLES,
    PER_PROCESS,
    RULES,
    SCALARS,
    TALLIED,
    VOLUME,
    Grid,
    State,
    Tally,
)
from .units import NONE, NUMBER_DENSITY, TIME, Dimension
from .units import VOLUME as A_VOLUME

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Observable:
    """A variable of the result.

    Attributes
    ----------
    name : str
    dims : tuple of str
        The first is always ``replica``.
    long_name : str
    about : str
        What the reference says of it.
    unit : Dimension
        What it measures.
    count, clock : int, optional
        The column of `State.count` or `State.clock` that it is: at each output time if it has this
        dimension, else at the end.
    process : str, optional
        The array of `PER_PROCESS` that it is.
    rule : Rule, optional
        How those of sub-volumes make that of the whole, if not as declared for the state.
    everywhere : bool
        Whether every result has it, be it as NaN; else only those that know it.
    """

    name: str
    dims: tuple[str, ...]
    long_name: str
    about: str
    unit: Dimension = NONE
    count: int | None = None
    clock: int | None = None
    process: str | None = None
    rule: Rule | None = None
    everywhere: bool = True

    @property
    def recorded(self) -> bool:
        """Whether it is in the tally, at each output time."""
        known = (self.count, self.clock, self.process) != (None, None, None)
        return known and "time" in self.dims

    @property
    def merging(self) -> Rule:
        """How those of sub-volumes make that of the whole at an output time."""
        rule: object = self.rule
        if rule is None and self.process is not None:
            rule = RULES[self.process]
        elif rule is None and self.count is not None:
            rule = COLUMNS["count"].rules[self.count]
        elif rule is None and self.clock is not None:
            rule = COLUMNS["clock"].rules[self.clock]
        if not isinstance(rule, Rule) or rule in (Rule.APART, Rule.WHOLE):
            raise ValueError(f"{self.name}: say how sub-volumes make it up, by a rule")
        return rule

    def ended(self, state: State) -> NDArray[Any]:
        """Return it of replicas that are where this state is."""
        if self.process is not None:
            return np.asarray(getattr(state, self.process))
        if self.count is not None:
            return np.asarray(state.count[:, self.count])
        return np.asarray(state.clock[:, self.clock])


_END = ("replica",)
_TIMES = ("replica", "time")

OBSERVABLES: tuple[Observable, ...] = (
    Observable(
        "number_density", _TIMES, "number of clusters per unit volume",
        "clusters per unit volume", NUMBER_DENSITY,
    ),
    Observable(
        "moment", (*_TIMES, "order"), "moment of the size distribution, sum_k k^p n_k",
        r"$M_p = \sum_k k^p n_k$, exact, whatever the bins", NUMBER_DENSITY,
    ),
    Observable("largest", _TIMES, "size of the largest cluster", "size of the largest cluster"),
    Observable(
        "particles", _TIMES, "number of simulated particles",
        "simulated particles; NaN for a solver", count=PARTICLES,
    ),
    Observable(
        "collisions", _TIMES, "number of collisions so far",
        "collisions so far: in the whole volume of a simulation, per unit volume for a solver",
        count=EVENTS,
    ),
    Observable(
        "volume", _TIMES, "simulated volume",
        "simulated volume; it doubles where the population is kept up by doubling; 1 for a solver",
        A_VOLUME, clock=VOLUME, rule=Rule.SUM,
    ),
    Observable(
        "n", (*_TIMES, "size"), "number density of clusters of one size",
        "density of clusters of one size: count / volume", NUMBER_DENSITY,
    ),
    Observable(
        "n_bin", (*_TIMES, "bin"), "number density of clusters in a bin of sizes",
        "density of all clusters in a bin", NUMBER_DENSITY,
    ),
    Observable(
        "events", (*_TIMES, "process"), "number of collisions so far, by outcome",
        "events of each process so far; those of pairs are the collisions", process="events",
    ),
    Observable(
        "attempts", ("replica", "process"), "number of candidates for these, accepted or not",
        "candidates up to the end, accepted or not; `events / attempts` is the acceptance. Those "
        "of pairs are shared among their processes in the ratio of the events; not from a solver",
        everywhere=False,
    ),
    Observable(
        "extinction_time", _END, "time at which all particles had become one cluster",
        "since when a replica has been one cluster, or none where particles leave; NaN if there "
        "are more, be it again", TIME, clock=EXTINCT,
    ),
    Observable(
        "mass", _TIMES, "mass in the simulated volume, in monomers",
        "of models with sources or removal: the mass in `volume`; see "
        "[the processes](../theory/processes.md)", everywhere=False,
    ),
    Observable(
        "mass_in", _TIMES, "mass that sources have brought into this volume",
        "of the same models: what came in, as if the volume had always been that of now",
        clock=MASS_IN, everywhere=False,
    ),
    Observable(
        "mass_out", _TIMES, "mass that has left this volume",
        "of the same models: what left, as if the volume had always been that of now",
        clock=MASS_OUT, everywhere=False,
    ),
    Observable(
        "composition", (*_TIMES, "size", "component"),
        "mean number of monomers of a kind in the particles of a size",
        "of particles that carry a composition: the mean number of monomers of each kind in those "
        "of a size, NaN where there are none; see [composition](../how-to/composition.md)",
        everywhere=False,
    ),
    Observable(
        "composition_variance", (*_TIMES, "size", "component"),
        "variance of this number over the particles of a size",
        "its variance over the particles of a size; divided by the square of the size that of the "
        "fraction", everywhere=False,
    ),
    Observable(
        "fraction_bin", (*_TIMES, "bin", "component"),
        "mean fraction of a kind in the particles of a bin",
        "the mean fraction of each kind in the particles of a bin", everywhere=False,
    ),
    Observable(
        "fraction_bin_variance", (*_TIMES, "bin", "component"),
        "variance of this fraction over the particles of a bin",
        "its variance over these particles", everywhere=False,
    ),
    Observable(
        "monomers", (*_TIMES, "component"), "number of monomers of a kind in the volume",
        "monomers of each kind in the simulated volume, whole numbers", everywhere=False,
    ),
    Observable(
        "mixing", _TIMES, "scatter of the composition by mass, over that of pure particles",
        "degree of segregation: $\\sum_p m_p \\sum_c (f_{pc} - \\bar f_c)^2$ over its value for "
        "pure particles; 1 if each particle is of one kind, 0 if all are alike", everywhere=False,
    ),
    Observable(
        "monomers_in", (*_TIMES, "component"), "monomers of a kind that sources brought in",
        "of open systems: as `mass_in`, for each kind", everywhere=False,
    ),
    Observable(
        "monomers_out", (*_TIMES, "component"), "monomers of a kind that have left",
        "of open systems: as `mass_out`, for each kind", everywhere=False,
    ),
)  # fmt: skip

#: coordinates and what goes with them: the long name, and what it measures
COORDINATES: dict[str, tuple[str, Dimension]] = {
    "replica": ("replica", NONE),
    "time": ("time", TIME),
    "order": ("order of the moment", NONE),
    "size": ("cluster size in monomers", NONE),
    "process": ("outcome of a collision", NONE),
    "bin": ("geometric centre of the sizes in a bin", NONE),
    "bin_lower": ("smallest size in a bin", NONE),
    "bin_upper": (
        "edge above a bin: the bin holds the whole sizes bin_lower <= k < bin_upper", NONE,
    ),
    "bin_width": ("number of whole sizes in a bin", NONE),
    "instance_replica": ("replica of a population", NONE),
    "instance_time": ("time of a population", TIME),
    "row_size": ("number of different sizes in a population", NONE),
    "sample_size": ("cluster size in monomers", NONE),
    "sample_count": ("number of simulated particles of that size", NONE),
    "sample_composition": ("monomers of each kind in a particle", NONE),
    "component": ("kind of monomers", NONE),
}  # fmt: skip


def si(dimension: Dimension) -> str:
    """Return the unit of a case in SI units, as netCDF writes it."""
    return dimension.unit.replace("^", "") or "1"


def units() -> dict[str, str]:
    """Return the SI units of all variables and coordinates."""
    known = {name: unit for name, (_, unit) in COORDINATES.items()}
    return {name: si(u) for name, u in (known | {o.name: o.unit for o in OBSERVABLES}).items()}


def _scalars() -> list[Observable]:
    """Return what is recorded as a scalar, in the order of the columns of the tally."""
    counted = [o for o in OBSERVABLES if o.recorded and o.count is not None]
    return counted + [o for o in OBSERVABLES if o.recorded and o.clock is not None]


def _by_process() -> list[Observable]:
    return [o for o in OBSERVABLES if o.recorded and o.process is not None]


def observed(
    times: Float, edges: NDArray[np.int64], orders: Float, first: NDArray[np.int64]
) -> Grid:
    """Add to what a plan wants to see the columns of the state that are observed."""
    scalars = _scalars()
    counted = [o.count for o in scalars if o.count is not None]
    clocked = [o.clock for o in scalars if o.clock is not None]
    processes = [PER_PROCESS.index(o.process) for o in _by_process() if o.process is not None]
    columns = (np.array(numbers, np.int64) for numbers in (counted, clocked, processes))
    return Grid(times, edges, orders, first, *columns)


def recorded(tally: Tally, name: str) -> NDArray[Any]:
    """Return what a tally has of an observable: by replica and time, and process if it has that."""
    scalars, processes = ([o.name for o in kind] for kind in (_scalars(), _by_process()))
    if name in processes:
        return np.asarray(tally.processes[:, :, processes.index(name)])
    return np.asarray(tally.scalars[..., SCALARS + scalars.index(name)])


def add_up(whole: Tally, rows: slice, parts: Sequence[Tally], state: State) -> None:
    """Write what sub-volumes have recorded into rows of the tally of the whole.

    The `state` is that of the whole at their start.
    """
    due = rows.stop - rows.start
    for name in ("counts", "bins", "sums"):
        getattr(whole, name)[0, rows] = sum(getattr(part, name)[0, :due] for part in parts)
    for k, rule in enumerate(TALLIED.rules):
        found = [part.scalars[0, :due, k] for part in parts]
        whole.scalars[0, rows, k] = merged(rule, found[0], found)
    for o in OBSERVABLES:
        if o.recorded:
            found = [recorded(part, o.name)[0, :due] for part in parts]
            zero = np.zeros_like(found[0])
            here = recorded(whole, o.name)[0, rows]
            here[:] = merged(o.merging, zero if o.merging is Rule.ADDED else found[0], found)
            if o.merging is Rule.ADDED:
                here += o.ended(state)[0]


def layout() -> dict[str, list[str]]:
    """Return what the columns of state and tally are, in their order, as a checkpoint holds it."""
    known = {name: columns.names for name, columns in COLUMNS.items()}
    return {**known, "scalars": [o.name for o in _scalars()],
            "processes": [o.name for o in _by_process()]}  # fmt: skip


def reference() -> str:
    """Return the table of the variables for the reference, as Markdown."""
    rows = (f"| `{o.name}` | {', '.join(o.dims)} | {o.about} |" for o in OBSERVABLES)
    return "\n".join(["| variable | dimensions | meaning |", "|---|---|---|", *rows])
