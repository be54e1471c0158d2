"""The time-stepping method: free flight for a step, then a constrained minimisation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from smolux.errors import InputError, Problem
from smolux.runtime.room import needed
from smolux.spatial.results.eventlog import Logger, reasons
from smolux.spatial.results.trace import Trace, empty_series, observe
from smolux.spatial.system import System

from .base import LISTS, Run, SpatialMethod

Float = NDArray[np.float64]

#: alpha, beta, damping, augmentation, by form and constraint; see the theory
_COEFFICIENTS = {
    ("augmented", "non-smooth"): (0.06, 0.4, 0.8, 2.0),
    ("augmented", "smooth"): (0.06, 0.4, 0.8, 2.0),
    ("damped", "non-smooth"): (0.2, 0.2, 1.0, 0.0),
    ("damped", "smooth"): (0.5, 0.8, 4.0, 0.0),
    ("plain", "non-smooth"): (0.15, 0.3, 2.0, 0.0),
    ("plain", "smooth"): (0.15, 0.3, 2.0, 0.0),
}
_FORMS, _CONSTRAINTS = ("augmented", "damped", "plain"), ("non-smooth", "smooth")
_NEW_LINKS = ("balanced", "slack")
_NAMES = ("alpha", "beta", "damping", "augmentation")
#: the relative way of two discs in a step must stay below a radius
_LONGEST_STEP = 0.5
#: neighbours are known for steps of this length at least
_LEAST_REACH = 0.2
#: room for pairs and for half-edges, by disc
_PAIRS, _EDGES = 4, {2: 6, 3: 12}
_HOPELESS = (
    "the minimisation fails however short the step is; use the default form and constraint, or "
    "other coefficients"
)


class SteppingRun(Run):
    """A run of the time-stepping method."""

    def __init__(self, system: System, times: Float, settings: TimeStepping) -> None:
        from smolux.spatial.events import direct, minimising, stepping, steps

        n, d = system.position.shape
        self.system, self.settings = system, settings
        self._steps, self._stepping, self._events = steps, stepping, direct.Events
        self._loop = stepping.advance
        self.logger = Logger(max(1 << 14, 2 * (d + 2) * n), 0)
        self.series, self._next = empty_series(times, n, d), 0
        alpha, beta, damping, augmentation = settings.coefficients()
        self.recipe = minimising.Recipe(
            rigid=settings.rigid,
            smooth=settings.constraint == "smooth",
            adaptive=settings.adaptive,
            alpha=alpha,
            beta=beta,
            damping=damping,
            augmentation=augmentation,
            overlap=settings.overlap,
            gap=settings.gap,
            iterations=settings.iterations,
            first=1.0 if settings.new_links == "balanced" else 0.0,
        )
        self.state, self.local = self._start(), self._scratch(minimising.Local, 8 * n + 1024)
        self.stride = settings.step * float(system.radius.min())
        self._work = np.empty(d)

    def _start(self) -> Any:
        """Return discs that are clusters of their own; nothing is listed yet."""
        system, steps = self.system, self._steps
        n, d = system.position.shape
        clock, count = np.zeros(steps.CLOCKS), np.zeros(steps.COUNTS, np.int64)
        count[steps.CLUSTERS] = n
        clock[steps.WAY] = np.inf
        clock[steps.SCALE] = float(np.sqrt((system.velocity**2).sum(1).max()))
        widest = clock[steps.WIDEST] = 2 * float(system.radius.max())
        # without a penalty new links first pull discs together
        far = 0.2 if self.settings.coefficients()[-1] > 0 else 1.2
        # in short steps, too, what is pushed moves as far
        clock[steps.REACH] = 1 + far + 2 * max(self.settings.step, _LEAST_REACH)
        # lists last for a step and for what a minimisation moves
        thinnest = widest * (clock[steps.REACH] - 1 + 2 * self.settings.step)
        thickest = max(max(system.box.lengths) / 4, thinnest)
        for side, periodic in zip(system.box.lengths, system.box.periodic, strict=True):
            if periodic:
                thickest = min(thickest, 0.98 * (side / 2 - clock[steps.REACH] * widest))
        if thickest < thinnest:
            least = 2 * (thinnest + clock[steps.REACH] * widest) / 0.98
            raise InputError(
                f"box: for steps of {self.settings.step:g} radii a periodic axis must be "
                f"{least:g} long at least; use an event-driven method"
            )
        clock[steps.THINNEST], clock[steps.THICKEST] = thinnest, thickest
        spacing = (system.box.volume / n) ** (1 / d)
        clock[steps.SKIN] = min(max(thinnest, 0.6 * spacing), thickest)
        room = system.radius if system.wall_contact == "surface" else np.zeros(n)
        each, ints, edges = np.arange(n, dtype=np.int32), (n, np.int32), 2 * _EDGES[d] * n
        return steps.Steps(
            axes=tuple(range(d)), clock=clock, count=count,
            length=np.array(system.box.lengths), period=system.box.periods,
            x=system.position.copy(), radius=system.radius, room=room, inertia=system.mass,
            label=each.copy(), member=each.copy(), binned=np.empty((n, d)),
            following=np.empty(*ints), edge=np.full(n, -1, np.int32), slot=np.full(n, -1, np.int32),
            off=np.zeros((n, d)), v=system.velocity.copy(), low=np.empty((n, d)),
            high=np.empty((n, d)), mass=system.mass.copy(), size=np.ones(*ints),
            alive=each.copy(), rank=each.copy(),
            saved_off=np.empty((n, d)), saved_v=np.empty((n, d)),
            comp=np.full(n, -1, np.int32), drift=np.empty((n, d + 1)), touched=np.empty(*ints),
            cells=np.ones(d, np.int64), head=np.empty(max(n, 64), np.int32),
            owner=np.empty(max(n, 64), np.int32),
            pair=np.empty((_PAIRS * n + 64, 2), np.int32), due=np.empty(_PAIRS * n + 64),
            contact=np.empty((4 * n, 2), np.int32),
            edge_to=np.empty(edges, np.int32), edge_next=np.empty(edges, np.int32),
            edge_force=np.empty(edges),
        )  # fmt: skip

    def _scratch(self, kind: Any, nears: int) -> Any:
        n, d = self.system.position.shape
        if self.settings.rigid:
            n = nears = 1
        arrays = [np.empty((n, d)) for _ in range(5)]
        return kind(
            np.empty(n, np.int32), np.empty(n, np.bool_), np.empty(n, np.int64), *arrays,
            np.empty((nears, 4), np.int32), np.empty(nears),
        )  # fmt: skip

    @property
    def time(self) -> float:  # type: ignore[override]
        """See `Run`."""
        return float(self.state.clock[self._steps.TIME])

    @property
    def clusters(self) -> int:  # type: ignore[override]
        """See `Run`."""
        return int(self.state.count[self._steps.CLUSTERS])

    @property
    def events(self) -> int:  # type: ignore[override]
        """Steps so far."""
        return int(self.state.count[self._steps.STEPS])

    def advance(self, until: float, clusters: int, budget: int) -> str | None:
        stepping, times = self._stepping, self.series.time
        look = float(times[self._next]) if self._next < len(times) else np.inf
        few = max(1, min(budget, 4_000_000 // len(self.system)))
        code, done = self._loop(
            self.state, self.local, self.recipe, self._events(*self.logger.room), self.stride,
            until, look, clusters, self.settings.patience, few, self._work,
        )  # fmt: skip
        self.logger.keep(done)
        if code == stepping.OBSERVE:
            self._observe()
        elif code == stepping.NO_PAIRS:
            room = 2 * len(self.state.due)
            with needed(16 * room, LISTS):
                pair, due = np.empty((room, 2), np.int32), np.empty(room)
                self.state = self.state._replace(pair=pair, due=due)
        elif code == stepping.NO_NEARS:
            room = 2 * len(self.local.multiplier)
            with needed(24 * room, LISTS):
                self.local = self._scratch(type(self.local), room)
        elif code == stepping.DONE:
            while self._next < len(times) and times[self._next] <= self.time:
                self._observe()
            return ""
        return {**reasons(stepping), stepping.HOPELESS: _HOPELESS}.get(code)

    def _observe(self) -> None:
        """Write down the clusters at the next output time."""
        s = self.state
        c = s.alive[: self.clusters]
        observe(self.series, self._next, s.size[c], s.mass[c], s.v[c])
        self._next += 1

    def trace(self) -> Trace:
        s, steps = self.state, self._steps
        least = np.full(len(s.x), len(s.x), np.int32)
        np.minimum.at(least, s.label, np.arange(len(s.x), dtype=np.int32))
        counters = {
            "steps": "STEPS",
            "failures": "FAILURES",
            "minimisations": "MINIMISATIONS",
            "iterations": "ITERATIONS",
            "listings": "LISTINGS",
        }
        attributes = {key: int(s.count[getattr(steps, c)]) for key, c in counters.items()}
        warnings = []
        if failed := attributes["failures"]:
            warnings.append(f"{failed} steps failed and were taken again with half the length")
        return Trace(
            self.time, s.x + s.off[s.label], s.v[s.label], least[s.label], self.logger.log(),
            self.series, warnings=warnings, attributes=attributes,
        )  # fmt: skip


@dataclass(frozen=True)
class TimeStepping(SpatialMethod):
    """Free flight for a step, then discs that overlap are parted by a constrained minimisation.

    The sum of squared lengths of the links, half of it, is minimised under the constraint that no
    discs overlap, by the method of Arrow and Hurwicz from the multipliers of the links so far.
    Merges have the time of the end of a step, and clusters bend where they are hit. As steps
    become short the outcome tends to that of the event-driven methods, which cost less.

    Parameters
    ----------
    step : float
        Way of the fastest cluster in a step in radii of the smallest disc, 0.5 at most.
    rigid : bool
        Part clusters as whole ones instead, along the contacts; they do not bend.
    form : {"augmented", "damped", "plain"}
        With a penalty besides the multipliers, with inertia and damping, or the paper's first.
    constraint : {"non-smooth", "smooth"}
        On distances, or on their squares. Plain and smooth together do not converge.
    alpha, beta, damping, augmentation : float, optional
        Coefficients of positions, of multipliers, of the damping and of the penalty, instead of
        those of the form and the constraint; in units of the sum of the radii of a pair.
    new_links : {"balanced", "slack"}
        A new link has the multiplier that holds its discs at contact; or none, as in the
        literature: then it draws them together first, which parts near neighbours that do not
        touch by some hundredths of a diameter, however short the step.
    adaptive : bool
        Raise beta and the penalty while overlaps do not halve in 20 iterations.
    overlap, gap : float
        Largest overlap of any pair and largest gap of a link, over the sum of radii, at the end.
    iterations : int
        After which a minimisation has failed: the step is taken again with half the length.
    patience : float
        The run ends when there was no merge while the fastest cluster would have crossed the box
        so many times.

    Raises
    ------
    InputError
        With every parameter that is out of range.

    References
    ----------
    P. Degond, G. Dimarco, M. Ferreira, S. Hecht, section 3.
    """

    step: float = 0.2
    rigid: bool = False
    form: str = "augmented"
    constraint: str = "non-smooth"
    alpha: float | None = None
    beta: float | None = None
    damping: float | None = None
    augmentation: float | None = None
    new_links: str = "balanced"
    adaptive: bool = False
    overlap: float = 1e-3
    gap: float = 1e-2
    iterations: int = 2000
    patience: float = 1e4
    name: ClassVar[str] = "time-stepping"
    title: ClassVar[str] = "time steps with a constrained minimisation"
    reference: ClassVar[str] = "Degond, Dimarco, Ferreira, Hecht, section 3"
    exact: ClassVar[bool] = False

    def __post_init__(self) -> None:
        problems = [
            f"{name} = {getattr(self, name)!r}: must be one of {', '.join(map(repr, known))}"
            for name, known in (
                ("form", _FORMS),
                ("constraint", _CONSTRAINTS),
                ("new_links", _NEW_LINKS),
            )
            if getattr(self, name) not in known
        ]
        if not 0 < self.step <= _LONGEST_STEP:
            cure = (
                f"must lie above 0 and be {_LONGEST_STEP} at most: two discs could pass each other "
                "in a longer one"
            )
            problems.append(Problem("step", cure, self.step))
        for name in (*_NAMES, "overlap", "gap", "iterations", "patience"):
            value = getattr(self, name)
            least = 0 if name in ("augmentation", "damping") else np.nextafter(0, 1)
            if value is not None and not (np.isfinite(value) and value >= least):
                problems.append(f"{name} = {value!r}: must be a positive number")
        if problems:
            raise InputError(problems)

    def coefficients(self) -> tuple[float, ...]:
        """Return alpha, beta, damping and augmentation as they are used."""
        known = _COEFFICIENTS[self.form, self.constraint]
        given = (getattr(self, name) for name in _NAMES)
        return tuple(
            float(usual if mine is None else mine) for mine, usual in zip(given, known, strict=True)
        )

    def start(self, system: System, times: Float) -> Run:
        return SteppingRun(system, times, self)
