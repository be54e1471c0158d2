"""The state of one replica: arrays only, so that a checkpoint is a copy of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple, get_type_hints

import numpy as np

from .columns import Columns, Rule, merged

#: columns of `State.count`, of `State.clock` and of `State.missed`: a call declares the next one
_count, _clock, _missed = Columns(), Columns(), Columns()

PARTICLES = _count("particles", Rule.SUM)  # simulated particles
EVENTS = _count("events", Rule.ADDED)  # collisions so far
TRIALS = _count("trials", Rule.ADDED)  # candidates looked at so far
NEXT = _count("next", Rule.WHOLE)  # next output time
PHASE = _count("phase", Rule.APART)  # DRAW or FIRE: whether an event is pending
FIRST = _count("first", Rule.APART)  # slots of the pending pair; FIRST < 0: nothing happens then
SECOND = _count("second", Rule.APART)
PROCESS = _count("process", Rule.APART)  # process of the pending event, -1 until chosen
WINDOW = _count("window", Rule.APART)  # window of time in which the rate factors are bounded
#: double the volume when this few particles are left; 0: never
DOUBLE_AT = _count("double_at", Rule.APART)
DOUBLINGS = _count("doublings", Rule.WHOLE)
SMALLEST = _count("smallest", Rule.APART)  # bounds of the sizes present
LARGEST = _count("largest", Rule.APART)
SINCE = _count("since", Rule.APART)  # collisions since these bounds were taken
MONOMERS = _count("monomers", Rule.APART)  # what a store keeps beside its arrays
STORED = _count("stored", Rule.APART)
PAUSE = _count("pause", Rule.APART)  # 1: return at every output time
REPAIRS = _count("repairs", Rule.ADDED)  # rates found above their bound
WORST_I = _count(
    "worst_i", Rule.WHOLE
)  # sizes of the latest such pair, or of a rate that is no rate
WORST_J = _count("worst_j", Rule.WHOLE)
KIND = _count("kind", Rule.APART)  # of the pending event, see `smolux.core.superposition`
#: the single particle of the pending event, its size, its process, one of two fragments
UNARY = _count("unary", Rule.APART)
UNARY_SIZE = _count("unary_size", Rule.APART)
UNARY_PROCESS = _count("unary_process", Rule.APART)
UNARY_PART = _count("unary_part", Rule.APART)
#: whose rate is no rate: 0 the kernel, r + 1 process r of single particles
CULPRIT = _count("culprit", Rule.APART)
WANTED = _count("wanted", Rule.APART)  # the size of which the splits are to be bounded
VAIN = _count("vain", Rule.APART)  # candidates of single particles in vain since all were counted
#: 1: encounters are drawn after what else may come first, see `smolux.core.superposition`
LATE = _count("late", Rule.APART)
COUNTS = len(_count)

TIME = _clock("time", Rule.WHOLE)  # of the latest event
PENDING = _clock("pending", Rule.APART)  # time of the next event
VOLUME = _clock("volume", Rule.WHOLE, extensive=True)
EXTINCT = _clock("extinct", Rule.WHOLE)  # since when one particle is left, or none; else NaN
MAJORANT = _clock("majorant", Rule.APART)  # bound of the rate over the sizes present
FLOOR = _clock("floor", Rule.MAXIMUM)  # least majorant, raised by repairs
VALUE = _clock("value", Rule.APART)  # the value that broke a bound
EXCESS = _clock("excess", Rule.WHOLE)  # sum of `factors`
#: what sources have brought in, and what has left, in the volume of now
MASS_IN = _clock("mass_in", Rule.ADDED, extensive=True)
MASS_OUT = _clock("mass_out", Rule.ADDED, extensive=True)
RAISED = _clock("raised", Rule.MAXIMUM)  # by which share bounds of splits were found too low
#: what repairs have added to the bounds of the factor of each process
CLOCKS = _clock("factors", Rule.MAXIMUM, each=True)

IN_DOUBT = _missed(
    "in_doubt", Rule.APART
)  # what the pending encounter adds to the next, if it comes
SPLIT_IN_DOUBT = _missed("split_in_doubt", Rule.APART)  # the same of a single particle that splits
BY_KERNEL = _missed("by_kernel", Rule.ADDED)
BY_SPLITS = _missed("by_splits", Rule.ADDED)
BY_FACTOR = _missed(
    "by_factor", Rule.ADDED, each=True
)  # by the bounds of the factor of each process

#: what grows with the volume
EXTENSIVE = tuple(_clock.extensive)
COLUMNS = {"count": _count, "clock": _clock, "missed": _missed}

#: scalars of a `Tally`: the time, and the largest size; behind them what `Grid` names
TALLIED = Columns()
AT = TALLIED("time", Rule.FIRST)
HIGHEST = TALLIED("largest", Rule.MAXIMUM)
SCALARS = len(TALLIED)
#: arrays of the state with an entry for each process that can be observed
PER_PROCESS = ("events", "attempts")

#: sizes stay below this, so that a sum of two cannot overflow
LIMIT = 1 << 62

DRAW, FIRE = 0, 1
#: which of the pair of an event vanish
ONE, OTHER, BOTH = 1, 2, 3

# Why the loop returned.
DONE = 0  # every output time is recorded
BUDGET = 1  # the budget is spent
GROW = 2  # the store is full
BOUND = 3  # a bound of the kernel is asked for
BAD_RATE = 4  # a negative or undefined rate
BAD_FACTOR = 5  # a negative or undefined factor of a process
PAUSED = 6  # an output time was recorded
TOO_LARGE = 7  # a size would reach the limit
SPLITS = 8  # bounds of the splits of a size are asked for
BAD_SHARE = 9  # a share of encounters is not between 0 and 1

#: slots an octave by which single particles are told apart, as a power of two, and how many in all
UNARY_BITS = 3
#: slot that holds no size, but 1 if all particles are counted
COUNTED = 0
UNARY_SLOTS = 61 << UNARY_BITS


class State(NamedTuple):
    """State of R replicas; without the leading axis, of one.

    Attributes
    ----------
    rng : uint64 array of shape (R, 4)
    clock : float64 array of shape (R, CLOCKS + P)
    count : int64 array of shape (R, COUNTS)
    events : int64 array of shape (R, P)
        Collisions that ended in each process.
    sizes, counts : int64 arrays of shape (R, E)
        What the latest event made, see `smolux.processes.base.PairProcess.outcome`.
    attempts : int64 array of shape (R, P)
        Candidates of single particles, and particles that sources offered.
    held : int64 array of shape (R, slots)
        Particles in each slot of sizes, see also `COUNTED`. No slots if nothing
        happens to single particles.
    most : float64 array of shape (R, L, slots)
        Largest rate of a particle since its slot was last empty, for each process of these.
    sums : float64 array of shape (R, L, octaves)
        Sums of ``held * most`` over the slots of an octave.
    missed : float64 array of shape (R, BY_FACTOR + P)
        Estimate of the events that did not take place as a bound did not hold, see
        `smolux.core.bounds.repair`.
    """

    rng: Annotated[np.ndarray, Rule.APART]
    clock: Annotated[np.ndarray, _clock]
    count: Annotated[np.ndarray, _count]  # type: ignore[assignment]
    events: Annotated[np.ndarray, Rule.ADDED]
    sizes: Annotated[np.ndarray, Rule.APART]
    counts: Annotated[np.ndarray, Rule.APART]
    attempts: Annotated[np.ndarray, Rule.ADDED]
    held: Annotated[np.ndarray, Rule.APART]
    most: Annotated[np.ndarray, Rule.APART]
    sums: Annotated[np.ndarray, Rule.APART]
    missed: Annotated[np.ndarray, _missed]


#: how each of these arrays of sub-volumes makes that of the whole
RULES: dict[str, Rule | Columns] = {
    name: hint.__metadata__[0] for name, hint in get_type_hints(State, include_extras=True).items()
}


def bring_together(whole: State, parts: Sequence[State]) -> None:
    """Bring the state of a replica up to date with those of its sub-volumes."""
    for name, how in RULES.items():
        mine, theirs = getattr(whole, name)[0], [getattr(part, name)[0] for part in parts]
        if isinstance(how, Columns):
            how.merge(mine, theirs)
        else:
            mine[:] = merged(how, mine, theirs)


def hand_on(whole: State, part: State) -> None:
    """Let a sub-volume begin with the maxima that the whole knows."""
    for name, columns in COLUMNS.items():
        mine, its = getattr(whole, name)[0], getattr(part, name)[0]
        at = columns.under(Rule.MAXIMUM, len(mine))
        its[at] = mine[at]


class TimeWindows(NamedTuple):
    """Bounds of the rate factors of P processes in W windows of time.

    Attributes
    ----------
    edges : float64 array of shape (W + 1,)
        The last edge is infinite, or beyond every output time.
    bounds : float64 array of shape (W, P)
    total : float64 array of shape (W,)
        Sum of the bounds over the processes of pairs.
    inflow : float64 array of shape (S,)
        Simulated particles that each source brings in for a unit of volume and time.
    size : int64 array of shape (S, K)
    share : float64 array of shape (S, K)
        Sizes that come in, and the share of those up to them.
    cut : int64 array of shape (2,)
        The largest size that stays, and the process that takes the others out.
    """

    edges: np.ndarray
    bounds: np.ndarray
    total: np.ndarray
    inflow: np.ndarray
    size: np.ndarray
    share: np.ndarray
    cut: np.ndarray


class Parameters(NamedTuple):
    """Parameters of the processes: a tuple for each, in the order of the processes.

    Attributes
    ----------
    factors, outcomes, shares : tuple
        Of pairs: of the factors in time, of what comes of an encounter, and of the share of them
        in which it does, if any of these is not one. Of a kernel that varies `factors` has one more
        entry: for each term of it those of its factor and of its rate.
    unary, unary_factors : tuple
        Of single particles: of the rates, see `smolux.core.unary.Law`, and of the factors.
    source_factors : tuple
    """

    factors: tuple[Any, ...]
    outcomes: tuple[Any, ...]
    shares: tuple[Any, ...]
    unary: tuple[Any, ...]
    unary_factors: tuple[Any, ...]
    source_factors: tuple[Any, ...]


class Tally(NamedTuple):
    """Observations of R replicas at T times; without the two leading axes, one observation.

    Attributes
    ----------
    scalars : float64 array of shape (R, T, SCALARS + ...)
        Time and largest size, then the columns of `State.count` and `State.clock` that are
        observed, see `Grid`.
    processes : int64 array of shape (R, T, M, P)
        The M arrays of the state with an entry for each process that are observed.
    counts : int64 array of shape (R, T, L + 1)
        Particles of the sizes ``1 .. L``; entry 0 is unused.
    bins : float64 array of shape (R, T, B)
        Particles they stand for.
    sums : float64 array of shape (R, T, O)
        Sums of ``size**order`` over what stands for the sizes above L.
    rows : float64 array of shape (R, T, K, C, 2)
        What Python observes of the rows of particles, see `smolux.stochastic.carrying`; empty if
        there are none.
    """

    scalars: np.ndarray
    processes: np.ndarray
    counts: np.ndarray
    bins: np.ndarray
    sums: np.ndarray
    rows: np.ndarray


class Grid(NamedTuple):
    """What is observed: output times, bin edges above L, orders of moments, columns of the state.

    `first` has for each octave the last edge at or below its start, or the very first; `counted`
    and `clocked` are columns of `State.count` and `State.clock`, `processes` are numbers in
    `PER_PROCESS`.
    """

    times: np.ndarray
    edges: np.ndarray
    orders: np.ndarray
    first: np.ndarray
    counted: np.ndarray
    clocked: np.ndarray
    processes: np.ndarray


def new_state(rng: np.ndarray, processes: int, entries: int, unary: int) -> State:
    """Make an empty state for as many replicas as there are streams.

    `unary` of the processes are of single particles.
    """
    replicas = len(rng)
    slots = UNARY_SLOTS if unary else 0
    return State(
        rng,
        np.zeros((replicas, CLOCKS + processes)),
        np.zeros((replicas, COUNTS), np.int64),
        np.zeros((replicas, processes), np.int64),
        np.zeros((replicas, entries), np.int64),
        np.zeros((replicas, entries), np.int64),
        np.zeros((replicas, processes), np.int64),
        np.zeros((replicas, slots), np.int64),
        np.zeros((replicas, unary, slots)),
        np.zeros((replicas, unary, slots >> UNARY_BITS)),
        np.zeros((replicas, BY_FACTOR + processes)),
    )


def new_tally(
    replicas: int, grid: Grid, sizes: int, processes: int, rows: tuple[int, ...] = (0, 0, 2)
) -> Tally:
    """Make room for observations; `scalars` is NaN where nothing is recorded yet."""
    shape = (replicas, len(grid.times))
    return Tally(
        np.full((*shape, SCALARS + len(grid.counted) + len(grid.clocked)), np.nan),
        np.zeros((*shape, len(grid.processes), processes), np.int64),
        np.zeros((*shape, sizes + 1), np.int64),
        np.zeros((*shape, len(grid.edges))),
        np.zeros((*shape, len(grid.orders))),
        np.zeros((*shape, *rows)),
    )
