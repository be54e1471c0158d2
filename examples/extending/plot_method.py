"""
A method of your own
====================

How the next event is found, and how particles are held for that, is a method. This is the oldest
one, which sums the rates of all pairs at each event: slow, and hard to get wrong. For single
particles, sources, weightings and doubling it needs nothing more.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, NamedTuple

import numpy as np

import smolux as sx
from smolux.core import rng
from smolux.core.bounds import note_bad, note_largest
from smolux.core.slots import slot_of
from smolux.core.state import (
    FIRST,
    LARGEST,
    PARTICLES,
    SECOND,
    STORED,
    TRIALS,
    UNARY_BITS,
    VOLUME,
)
from smolux.core.store import Store, pieces_of
from smolux.jit.compile import piece
from smolux.methods.base import Method, enlarged


# %%
# **The store**: one array of sizes for each replica, with the replicas first. A place is an index.
class Work(NamedTuple):
    """The first ``count[STORED]`` entries are the particles."""

    sizes: np.ndarray


@piece
def view(work, r):
    """Work arrays of one replica."""
    return Work(work.sizes[r])


@piece
def size_at(s, w, place):
    """Size of a particle."""
    return w.sizes[place]


@piece
def pick(s, w, r, c):
    """Draw one of the particles in slot `c`."""
    while True:
        place = rng.below(s.rng, s.count[STORED])
        if slot_of(w.sizes[place], UNARY_BITS) == c:
            return place, w.sizes[place]


@piece
def room(s, w, gone, entries, p):
    """Whether there is room for what appears."""
    needed = s.count[STORED]
    for e in range(entries):
        needed += s.counts[e]
    return needed <= w.sizes.shape[0]


@piece
def take(s, w, place):
    """Take a particle out: the last one moves into the gap."""
    w.sizes[place] = w.sizes[s.count[STORED] - 1]
    s.count[STORED] -= 1


@piece
def put(s, w, size, count, i, j, p):
    """Put particles in."""
    for _ in range(count):
        w.sizes[s.count[STORED]] = size
        s.count[STORED] += 1
    note_largest(s, size)


@piece
def double(s, w):
    """Put every particle in once more, if there is room."""
    n = s.count[STORED]
    if 2 * n > w.sizes.shape[0]:
        return False
    for k in range(n):
        w.sizes[n + k] = w.sizes[k]
    s.count[STORED] = 2 * n
    return True


@lru_cache
def make_visit(tally):
    """Bind the counting of all particles."""

    @piece
    def visit(s, w, t, grid, p):
        largest = np.int64(0)
        for k in range(s.count[STORED]):
            tally(t, grid, w.sizes[k], 1, p)
            largest = max(largest, w.sizes[k])
        return largest

    return visit


# %%
# **The next pair**: by the sum of the rates of all, and a uniform number below it.
@piece
def prepare(s, w, p):
    """Nothing to do."""
    return 0


def make_draw(rate):
    """Bind the drawing to a rate."""

    @piece
    def draw(s, w, p, factor, limit):
        s.count[FIRST], n = -1, s.count[PARTICLES]
        s.count[TRIALS] += 1
        total = 0.0
        for a in range(n):
            for b in range(a):
                value = rate(float(w.sizes[a]), float(w.sizes[b]), *p)
                if not 0.0 <= value < math.inf:
                    note_bad(s, w.sizes[a], w.sizes[b], value)
                    return math.nan
                total += value
        if total <= 0.0:
            return math.inf
        left = rng.uniform(s.rng) * total
        for a in range(n):
            for b in range(a):
                value = rate(float(w.sizes[a]), float(w.sizes[b]), *p)
                if value > 0.0 and left >= 0.0:
                    s.count[FIRST], s.count[SECOND] = a, b
                left -= value
        return rng.exponential(s.rng) * s.clock[VOLUME] / (total * factor)

    return draw


# %%
# **The rest** is Python: how the arrays are made, grow, and are read.
@dataclass(frozen=True)
class Direct(Method):
    """All pairs by their rates (D. T. Gillespie, J. Atmos. Sci. 32, 1977 (1975))."""

    name: ClassVar[str] = "direct"
    title: ClassVar[str] = "direct"
    work_type: ClassVar[type] = Work

    @staticmethod
    def bind(rate: Any, tally: Any) -> Any:
        """Return the compiled pieces."""
        store = Store(view, size_at, pick, room, take, put, double, make_visit(tally))
        return pieces_of(store, make_draw(rate), prepare)

    def new_work(self, rates, populations, state, mass):
        """Store the initial populations."""
        most = max(int(counts.sum()) for _, counts in populations)
        work = Work(np.zeros((len(populations), most + 8), np.int64))
        for r, (sizes, counts) in enumerate(populations):
            held = np.repeat(sizes, counts)
            work.sizes[r, : len(held)] = held
            state.count[r, (PARTICLES, STORED, LARGEST)] = len(held), len(held), sizes[-1]
        return work

    def grow(self, work, state):
        """Return larger arrays."""
        return Work(enlarged(work.sizes, 2 * work.sizes.shape[1]))

    def held(self, work, state, replica):
        """Return what is counted, nothing here, and single sizes."""
        return np.zeros(1, np.int64), work.sizes[replica, : state.count[replica, STORED]]

    def bytes_per_replica(self, particles):
        """Estimate the memory of one replica."""
        return 8 * particles


# %%
# It is given as an object, and agrees with all others.
if __name__ == "__main__":
    model = sx.Model(sx.kernels.Ballistic(), [sx.processes.Aggregation()])
    times = np.linspace(0.05, 1.0, 8)
    own = sx.simulate(model, times, method=Direct(), particles=100, replicas=200, seed=1)
    solved = sx.solve(model, times)
    sx.plot.save(sx.plot.moments(own, reference=solved), "method.png")
    print(sx.analysis.compare(own, solved).verdict)
