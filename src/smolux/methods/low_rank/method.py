"""The low-rank method: both particles by segment trees, from a majorant that is a few products."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from smolux.core.loop import Pieces
from smolux.core.slots import slot_edges
from smolux.core.state import (
    LARGEST,
    PARTICLES,
    SMALLEST,
    STORED,
    TIME,
    VALUE,
    WORST_I,
    WORST_J,
    State,
)
from smolux.errors import InputError
from smolux.methods.base import Int, Method, Rates, enlarged, spread

from .majorants import Tables, fill_bounds, fitted, from_powers, units_of
from .pieces import bind
from .segment_tree import FANOUT, levels_of
from .store import METAS, POOL_NEEDED, SLOTS_NEEDED, STAGE, TAIL, WANTED, WIDEST, Work

#: stages of a majorant that is found: one for each octave of the largest size
_STAGES = 62
#: sizes up to this one need four bytes
_NARROW = np.iinfo(np.int32).max


@dataclass(frozen=True)
class LowRank(Method):
    """Draw both particles by segment trees from a majorant of low rank; accept by the true rate.

    The majorant is ``A(i, j) + A(j, i)`` with ``A = sum_k u_k(i) v_k(j)``. A term k is drawn by its
    weight, the first particle by ``u_k``, the second by ``v_k``, and the pair is accepted with
    probability ``K / (A + A^T)``. The factors are held at their bounds over slots of nearly equal
    sizes, which makes them a little larger and the trees small: a slot for each small size, then
    ``2**bits`` an octave. So an event costs about the same whatever the sizes are.

    Laws that know a majorant bring it. For others one is found from the bounds of the kernel over
    pairs of slots, again for each octave of the largest size.

    Parameters
    ----------
    bits : int
        Slots an octave, as a power of two.

    References
    ----------
    A. I. Osinsky, Low-rank Monte Carlo for Smoluchowski-class equations, arXiv:2312.02788 (2023).
    """

    bits: int = 6

    name: ClassVar[str] = "low-rank"
    title: ClassVar[str] = "low-rank"
    reference: ClassVar[str] = "A. I. Osinsky, arXiv:2312.02788 (2023)"

    work_type: ClassVar[type] = Work
    #: whether the majorant is one product, with both factors the same
    single: ClassVar[bool] = False
    #: bits for a majorant that is found, which needs bounds for all pairs of slots: sampled, proved
    _found_bits: ClassVar[tuple[int, int]] = (2, 3)

    def __post_init__(self) -> None:
        if not (isinstance(self.bits, (int, np.integer)) and 0 <= self.bits <= 8):
            raise InputError(f"bits = {self.bits!r}: must be a whole number from 0 to 8")

    @staticmethod
    def bind(rate: Any, tally: Any) -> Pieces:
        return bind(rate, tally)

    def _tables(self, rates: Rates) -> tuple[Tables, np.ndarray, int]:
        """Return tables, an array for bounds of the kernel and the bits in use."""
        known = rates.majorant
        if known is not None and self.single:
            (_, left, right), *more = known.terms
            known = known if left == right and not more else None
        if known is not None:
            return from_powers(known, slot_edges(self.bits)), np.empty((0, 0)), self.bits
        bits = min(self.bits, self._found_bits[rates.rigorous])
        slots = len(slot_edges(bits)) - 1
        return Tables.empty(_STAGES, slots), np.full((slots, slots), np.nan), bits

    def new_work(
        self, rates: Rates, populations: list[tuple[Int, Int]], state: State, mass: int
    ) -> Work:
        tables, bound, bits = self._tables(rates)
        edges = slot_edges(bits)
        replicas = len(populations)
        largest = max(int(sizes[-1]) for sizes, _ in populations)
        slots = _padded(int(np.searchsorted(edges, min(mass, 16 * largest), side="right")))
        number = np.zeros((replicas, slots))
        start = np.zeros((replicas, slots), np.int64)
        room = np.zeros((replicas, slots), np.int64)
        stored = [int(counts[sizes >= 2 << bits].sum()) for sizes, counts in populations]
        kind = np.int32 if largest <= _NARROW else np.int64
        pool = np.zeros((replicas, max(stored) + max(stored) // 2 + 16), kind)
        for r, (sizes, counts) in enumerate(populations):
            np.add.at(number[r], np.searchsorted(edges, sizes, side="right") - 1, counts)
            wide = sizes >= 2 << bits
            if stored[r]:
                spread(sizes[wide], counts[wide], pool[r, : stored[r]])
            room[r, 2 << bits :] = number[r, 2 << bits :]
            start[r, 1:] = np.cumsum(room[r])[:-1]
        count = state.count
        count[:, STORED] = stored
        count[:, PARTICLES] = [counts.sum() for _, counts in populations]
        count[:, SMALLEST] = [sizes[0] for sizes, _ in populations]
        count[:, LARGEST] = [sizes[-1] for sizes, _ in populations]
        meta = np.zeros((replicas, METAS), np.int64)
        meta[:, STAGE], meta[:, TAIL] = -1, stored
        meta[:, WIDEST] = np.iinfo(kind).max
        levels = levels_of(slots)
        factors = tables.factor.shape[2]
        return Work(
            number,
            np.zeros((replicas, factors, levels[-1] + 1), np.int64),
            levels,
            start,
            room,
            np.tile(np.arange(slots), (replicas, 1)),
            pool,
            meta,
            np.zeros((replicas, factors)),
            np.zeros((replicas, slots, factors)),
            np.zeros((replicas, slots)),
            np.zeros((replicas, tables.weights.shape[1])),
            np.zeros((replicas, factors), np.int64),
            np.zeros((replicas, factors)),
            *tables,
            bound,
            np.array([bits]),
        )

    def grow(self, work: Work, state: State) -> Work:
        meta = work.meta
        pool = max(int(meta[:, POOL_NEEDED].max()), work.pool.shape[1])
        slots = _padded(int(meta[:, SLOTS_NEEDED].max()))
        wide = bool(state.sizes.max() > meta[0, WIDEST])
        more = work
        if pool > work.pool.shape[1]:
            more = more._replace(pool=enlarged(work.pool, pool))
        if wide:
            more = more._replace(pool=more.pool.astype(np.int64))
        if slots > work.number.shape[1]:
            more = _more_slots(more, slots)
            # the quanta stay: what other replicas need must not change the course of one
            meta[:, STAGE] = np.where(meta[:, STAGE] >= 0, -meta[:, STAGE] - 2, meta[:, STAGE])
        # only now, when all arrays are there
        meta[:, (POOL_NEEDED, SLOTS_NEEDED)] = 0
        if wide:
            meta[:, WIDEST] = np.iinfo(np.int64).max
        return more

    def growth(self, work: Work, state: State) -> int:
        meta, found = work.meta, 0
        wide = bool(state.sizes.max() > meta[0, WIDEST])
        pool = max(int(meta[:, POOL_NEEDED].max()), work.pool.shape[1])
        if wide or pool > work.pool.shape[1]:
            found += len(meta) * pool * (8 if wide else work.pool.itemsize)
        slots = _padded(int(meta[:, SLOTS_NEEDED].max()))
        if slots > work.number.shape[1]:
            arrays = (getattr(work, name).nbytes for name in _BY_SLOT)
            found += int(sum(arrays) * max(slots / work.number.shape[1], 2.0))
        return found

    def supply_bound(self, work: Work, rates: Rates, state: State, replica: int) -> None:
        """See `Method.supply_bound`; a majorant for all sizes up to the end of an octave."""
        stage = int(work.meta[replica, WANTED])
        if work.rank[stage, 0]:  # another replica has asked for it
            return
        edges = slot_edges(int(work.bits[0]))
        slots = fill_bounds(work.bound, rates, edges, stage)
        upper = work.bound[1:slots, 1:slots]
        if np.isnan(upper).any():
            raise InputError(
                f"the kernel has no finite bound for the sizes 1 to {2 ** (stage + 1)}, which were "
                f"reached at t = {state.clock[replica, TIME]:.6g}; limit what grows, as in "
                "exp(min(x, 500)), or end earlier"
            )
        tables, units = Tables(*(getattr(work, f) for f in Tables._fields)), units_of(upper)
        fitted(upper * units, self.single).store(tables, stage, units)
        smallest, largest = (float(state.count[replica, k]) for k in (SMALLEST, LARGEST))
        if not upper.any():  # no candidate would ever find a rate below zero
            value = float(rates.arrays(smallest, largest))
            if not 0.0 <= value < np.inf:
                state.clock[replica, VALUE] = value
                state.count[replica, (WORST_I, WORST_J)] = smallest, largest

    def held(self, work: Work, state: State, replica: int) -> tuple[Int, Int]:
        number = work.number[replica].astype(np.int64)
        counted = 2 << int(work.bits[0])
        first = work.start[replica, counted:]
        stretches = zip(first, first + number[counted:], strict=True)
        parts = [work.pool[replica, a:b] for a, b in stretches if b > a]
        return number[:counted], np.concatenate([*parts, np.zeros(0, np.int64)])

    def bytes_per_replica(self, particles: int) -> int:
        return 6 * particles + 8 * 20 * (1 << self.bits) * 16


@dataclass(frozen=True)
class FictitiousJumps(LowRank):
    """The method of fictitious jumps: a majorant that is one product, ``K(i, j) <= h(i) h(j)``.

    The case of rank one of `LowRank`. The function h is that of the law if it is such a product,
    else found from the bounds of the kernel: over all sizes up to the end of an octave, the least
    that holds.

    References
    ----------
    A. Eibeck, W. Wagner, SIAM J. Sci. Comput. 22, 802 (2000), doi:10.1137/S1064827599353488.
    """

    name: ClassVar[str] = "fictitious-jumps"
    title: ClassVar[str] = "fictitious jumps"
    reference: ClassVar[str] = "A. Eibeck, W. Wagner, SIAM J. Sci. Comput. 22, 802 (2000)"
    single: ClassVar[bool] = True


#: arrays with an entry for each slot
_BY_SLOT = ("number", "tree", "grains", "share", "start", "room", "order")


def _more_slots(work: Work, slots: int) -> Work:
    """Make room for so many slots, and for more of them at a time."""
    old, meta = work.number.shape[1], work.meta
    slots = min(max(slots, 2 * old), _padded(work.factor.shape[1]))
    levels = levels_of(slots)
    order = enlarged(work.order, slots)
    order[:, old:] = np.arange(old, slots)
    start = enlarged(work.start, slots)
    start[:, old:] = meta[:, TAIL, None]
    return work._replace(
        number=enlarged(work.number, slots),
        tree=np.zeros((*work.tree.shape[:2], levels[-1] + 1), np.int64),
        grains=np.zeros((len(meta), slots, work.grains.shape[2])),
        share=np.zeros((len(meta), slots)),
        levels=levels,
        start=start,
        room=enlarged(work.room, slots),
        order=order,
    )


def _padded(slots: int) -> int:
    return -(-slots // FANOUT) * FANOUT
