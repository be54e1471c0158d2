"""What particles carry: at the start, and as it is observed at output times."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from smolux.attributes import Composition
from smolux.attributes.composition import rounded
from smolux.core.rows import POOL, deal, observe
from smolux.core.seeds import stream
from smolux.core.state import State
from smolux.methods.base import Rows
from smolux.processes import Source

from .plan import Plan

Int = NDArray[np.int64]
Float = NDArray[np.float64]

#: which random numbers the compositions at the start have
_STREAM = 6


def composition_of(plan: Plan) -> Composition:
    """Return the composition that the particles of a plan carry."""
    (attribute,) = plan.model.attributes
    assert isinstance(attribute, Composition)
    return attribute


def carrying_work(plan: Plan, populations: list[tuple[Int, Int]], first: int, state: State) -> Any:
    """Store particles with what they carry at the start."""
    composition = composition_of(plan)
    particles = [
        _dealt(composition, sizes, counts, stream(plan.seed, first + r, _STREAM))
        for r, (sizes, counts) in enumerate(populations)
    ]
    born = np.zeros((len(plan.model.processes), len(composition.kinds) - 1), np.int64)
    for r, process in enumerate(plan.model.processes):
        if isinstance(process, Source):
            born[r] = rounded(composition.of(source=process.called), POOL)[:-1]
    return plan.store.carrying_work(plan.rates, particles, born, state, plan.mass)


def _dealt(composition: Composition, sizes: Int, counts: Int, words: NDArray[np.uint64]) -> Rows:
    """Deal the monomers of each kind to the particles, as exactly as many as there are."""
    each = np.repeat(sizes, counts)
    rows = np.zeros((len(each), len(composition.kinds) - 1), np.int64)
    own = np.isin(each, list(composition.by_size))
    for size, pool in composition.monomers(sizes, counts).items():
        chosen = each == size if size else ~own
        dealt = np.zeros((int(chosen.sum()), rows.shape[1]), np.int64)
        deal(words, each[chosen], dealt, pool[:-1].copy(), int(pool.sum()))
        rows[chosen] = dealt
    return each, rows


def tally_shape(plan: Plan) -> tuple[int, ...]:
    """Shape of what is observed of the rows at an output time, see `observe_rows`."""
    if not plan.model.attributes:
        return 0, 0, 2
    return plan.sizes + len(plan.grid.edges) + 2, len(composition_of(plan).kinds), 2


def whole(sizes: Int, rows: Int) -> Int:
    """Return the numbers of monomers of all kinds."""
    return np.column_stack([rows, sizes - rows.sum(axis=1)])


def observe_rows(plan: Plan, sizes: Int, rows: Int, account: Int, out: Float) -> None:
    """Write what is observed of the rows of a replica.

    For each kind the sums over the particles of each size up to L of its number of monomers x and
    of x**2; of the fraction x / size and its square for each bin above; of x and x**2 / size over
    all; and what came in and what left.
    """
    out[:] = 0.0
    observe(sizes, rows, plan.grid, plan.sizes, out)
    known, total = account[:, :-1], account[:, -1:]
    out[-1] = np.column_stack([known, total - known.sum(axis=1, keepdims=True)]).T


def joint_population(sizes: Int, rows: Int) -> tuple[Int, Int, Int]:
    """Return the different particles: sizes ascending, counts, and the monomers of each kind."""
    numbers = np.column_stack([sizes, whole(sizes, rows)])
    found, counts = np.unique(numbers, axis=0, return_counts=True)
    return found[:, 0], counts.astype(np.int64), found[:, 1:]
