"""The state of one replica: arrays only, so that a checkpoint is a copy of them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

# Entries of State.count.
PARTICLES = 0  # simulated particles
EVENTS = 1  # collisions so far
TRIALS = 2  # candidates looked at so far
NEXT = 3  # next output time
PHASE = 4  # DRAW or FIRE: whether an event is pending
FIRST = 5  # slots of the pending pair; FIRST < 0: nothing happens then
SECOND = 6
PROCESS = 7  # process of the pending event, -1 until chosen
WINDOW = 8  # window of time in which the rate factors are bounded
DOUBLE_AT = 9  # double the volume when this few particles are left; 0: never
DOUBLINGS = 10
SMALLEST = 11  # bounds of the sizes present
LARGEST = 12
SINCE = 13  # collisions since these bounds were taken
MONOMERS = 14  # what a store keeps beside its arrays
STORED = 15
PAUSE = 16  # 1: return at every output time
REPAIRS = 17  # rates found above their bound
WORST_I = 18  # sizes of the latest such pair, or of a rate that is no rate
WORST_J = 19
KIND = 20  # of the pending event, see `smolux.core.beside`
LONE = 21  # the single particle of the pending event, its size, its process, one of two fragments
LONE_SIZE = 22
LONE_PROCESS = 23
LONE_PART = 24
CULPRIT = 25  # whose rate is no rate: 0 the kernel, r + 1 process r of single particles
WANTED = 26  # the size of which the splits are to be bounded
VAIN = 27  # candidates of single particles in vain since all were counted
LATE = 28  # 1: encounters are drawn after what else may come first, see `smolux.core.beside`
COUNTS = 29

# Entries of State.clock.
TIME = 0  # of the latest event
PENDING = 1  # time of the next event
VOLUME = 2
EXTINCT = 3  # when one particle was left; NaN before
MAJORANT = 4  # bound of the rate over the sizes present
FLOOR = 5  # least majorant, raised by repairs
VALUE = 6  # the value that broke a bound
EXCESS = 7  # sum of what follows
MASS_IN = 8  # what sources have brought in, and what has left, in the volume of now
MASS_OUT = 9
RAISED = 10  # by which share bounds of splits were found too low
CLOCKS = 11  # from here on, for each process: what repairs have added to the bounds of its factor

# Entries of State.missed.
IN_DOUBT = 0  # what the pending encounter adds to what follows, should it take place
SPLIT_IN_DOUBT = 1  # the same of a single particle that splits
BY_KERNEL = 2
BY_SPLITS = 3
BY_FACTOR = 4  # from here on, for each process: by the bounds of its factor

#: sizes stay below this, so that a sum of two cannot overflow
LIMIT = 1 << 62

DRAW, FIRE = 0, 1

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
LONE_BITS = 3
LONE_SLOTS = 61 << LONE_BITS


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
        Particles in each slot of sizes; entry 0 is 1 if they are counted. No slots if nothing
        happens to single particles.
    most : float64 array of shape (R, L, slots)
        Largest rate of a particle since its slot was last empty, for each process of these.
    sums : float64 array of shape (R, L, octaves)
        Sums of ``held * most`` over the slots of an octave.
    missed : float64 array of shape (R, BY_FACTOR + P)
        Estimate of the events that did not take place as a bound did not hold, see
        `smolux.core.bounds.repair`.
    """

    rng: np.ndarray
    clock: np.ndarray
    count: np.ndarray  # type: ignore[assignment]
    events: np.ndarray
    sizes: np.ndarray
    counts: np.ndarray
    attempts: np.ndarray
    held: np.ndarray
    most: np.ndarray
    sums: np.ndarray
    missed: np.ndarray


class Windows(NamedTuple):
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
        in which it does, if any of these is not one.
    lone, lone_factors : tuple
        Of single particles: of the rates, see `smolux.core.lone.Law`, and of the factors.
    source_factors : tuple
    """

    factors: tuple[Any, ...]
    outcomes: tuple[Any, ...]
    shares: tuple[Any, ...]
    lone: tuple[Any, ...]
    lone_factors: tuple[Any, ...]
    source_factors: tuple[Any, ...]


class Tally(NamedTuple):
    """Observations of R replicas at T times; without the two leading axes, one observation.

    Attributes
    ----------
    scalars : float64 array of shape (R, T, 7)
        Time recorded, particles, collisions, volume, largest size, mass that came in and left.
    events : int64 array of shape (R, T, P)
    counts : int64 array of shape (R, T, L + 1)
        Particles of the sizes ``1 .. L``; entry 0 is unused.
    bins : float64 array of shape (R, T, B)
        Particles they stand for.
    sums : float64 array of shape (R, T, O)
        Sums of ``size**order`` over what stands for the sizes above L.
    """

    scalars: np.ndarray
    events: np.ndarray
    counts: np.ndarray
    bins: np.ndarray
    sums: np.ndarray


class Grid(NamedTuple):
    """What is observed: output times, bin edges above L, orders of moments.

    `first` has for each octave the last edge at or below its start, or the very first.
    """

    times: np.ndarray
    edges: np.ndarray
    orders: np.ndarray
    first: np.ndarray


def new_state(rng: np.ndarray, processes: int, entries: int, lone: int) -> State:
    """Make an empty state for as many replicas as there are streams.

    `lone` of the processes are of single particles.
    """
    replicas = len(rng)
    slots = LONE_SLOTS if lone else 0
    return State(
        rng,
        np.zeros((replicas, CLOCKS + processes)),
        np.zeros((replicas, COUNTS), np.int64),
        np.zeros((replicas, processes), np.int64),
        np.zeros((replicas, entries), np.int64),
        np.zeros((replicas, entries), np.int64),
        np.zeros((replicas, processes), np.int64),
        np.zeros((replicas, slots), np.int64),
        np.zeros((replicas, lone, slots)),
        np.zeros((replicas, lone, slots >> LONE_BITS)),
        np.zeros((replicas, BY_FACTOR + processes)),
    )


def new_tally(replicas: int, grid: Grid, sizes: int, processes: int) -> Tally:
    """Make room for observations; `scalars` is NaN where nothing is recorded yet."""
    shape = (replicas, len(grid.times))
    return Tally(
        np.full((*shape, 7), np.nan),
        np.zeros((*shape, processes), np.int64),
        np.zeros((*shape, sizes + 1), np.int64),
        np.zeros((*shape, len(grid.edges))),
        np.zeros((*shape, len(grid.orders))),
    )
