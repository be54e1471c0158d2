"""The inverse method (fast DSMC): both particles by cumulative sums, none rejected."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from smolux.core.loop import Pieces
from smolux.core.state import LARGEST, PARTICLES, STORED, State
from smolux.errors import InputError
from smolux.methods.base import Int, Method, Rates, enlarged, spread

from .pieces import bind
from .store import Work
from .sums import BLOCK


@dataclass(frozen=True)
class Inverse(Method):
    """Choose the first particle by its rate with all others, the second by its rate with the first.

    Particles of sizes up to `buckets` are counted by size with one rate a size; larger ones are
    held singly. An event costs a few traversals of the sizes present, and none is rejected.

    Parameters
    ----------
    buckets : int
        The size B up to which particles are grouped.

    References
    ----------
    F. E. Kruis, A. Maisels, H. Fissan, AIChE J. 46, 1735 (2000), doi:10.1002/aic.690460905;
    Kalinov et al., Algorithms 2 and 4 and section 4.
    """

    buckets: int = 1024

    name: ClassVar[str] = "inverse"
    title: ClassVar[str] = "inverse (fast DSMC)"
    reference: ClassVar[str] = "F. E. Kruis, A. Maisels, H. Fissan, AIChE J. 46, 1735 (2000)"

    work_type: ClassVar[type] = Work

    @staticmethod
    def bind(rate: Any, tally: Any) -> Pieces:
        return bind(rate, tally)

    def __post_init__(self) -> None:
        if not (isinstance(self.buckets, (int, np.integer)) and self.buckets >= 1):
            raise InputError(f"buckets = {self.buckets!r}: must be a whole number of at least 1")

    def new_work(
        self, rates: Rates, populations: list[tuple[Int, Int]], state: State, mass: int
    ) -> Work:
        replicas = len(populations)
        # no size can exceed the mass, so small systems need few buckets
        buckets = min(self.buckets, max(BLOCK, 2 * mass))
        number = np.zeros((replicas, buckets))
        # how many of the sizes, which ascend, have a bucket
        held = [int(np.searchsorted(sizes, buckets, side="right")) for sizes, _ in populations]
        stored = [int(c[h:].sum()) for h, (_, c) in zip(held, populations, strict=True)]
        large = np.zeros((replicas, max(*stored, 8) * 2), np.int64)
        for r, (sizes, counts) in enumerate(populations):
            number[r, sizes[: held[r]] - 1] = counts[: held[r]]
            if stored[r]:
                spread(sizes[held[r] :], counts[held[r] :], large[r, : stored[r]])
        count = state.count
        count[:, STORED] = stored
        count[:, PARTICLES] = [counts.sum() for _, counts in populations]
        count[:, LARGEST] = [sizes[-1] for sizes, _ in populations]
        given = rates.table(buckets)
        valid = (given >= 0.0) & (given < np.inf)
        table = np.vstack((np.where(valid, given, 0.0), np.zeros((3, buckets))))
        return Work(
            number,
            np.zeros((replicas, 1, buckets)),
            np.zeros((replicas, -(-buckets // BLOCK))),
            large,
            np.zeros(large.shape),
            table if valid.all() else np.vstack((table, given)),
            np.zeros((replicas, 1)),
        )

    def grow(self, work: Work, state: State) -> Work:
        capacity = 2 * work.large.shape[1]
        return work._replace(
            large=enlarged(work.large, capacity), large_rate=enlarged(work.large_rate, capacity)
        )

    def held(self, work: Work, state: State, replica: int) -> tuple[Int, Int]:
        number = work.number[replica].astype(np.int64)
        return np.append(0, number), work.large[replica, : state.count[replica, STORED]]

    def bytes_per_replica(self, particles: int) -> int:
        return 8 * 6 * self.buckets
