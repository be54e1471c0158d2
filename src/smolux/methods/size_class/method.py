"""The size-class method: pairs of classes from a frozen table, particles within them at random."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from smolux.core.bounds import ROUNDING
from smolux.core.loop import Pieces
from smolux.core.slots import slot_edges
from smolux.core.state import MAJORANT, PARTICLES, SINCE, TIME, State
from smolux.errors import InputError
from smolux.methods.base import Int, Method, Rates, Words, enlarged, size_of, spread

from . import pieces
from .split import Part, collect, split
from .state import AHEAD, BITS, CHUNK, FREE, META, NEXT, SINGLE, SPAN, STALE, WIDEST, Work

#: octaves of sizes by which arrays and bounds are extended
_OCTAVES = 4
_NARROW = (1 << 31) - 1


@dataclass(frozen=True)
class SizeClass(Method):
    """Draw a pair of classes of sizes, then a particle of each; accept by the rate over its bound.

    Sizes fall into classes: the small ones by themselves, then `classes` an octave. Bounds of the
    kernel over a pair of classes are close, so nearly every candidate is accepted, whatever the
    kernel: it need be neither of low rank nor monotonic. The law of the candidates is frozen for a
    block of events, as if every class had a few more places than particles, so that they come from
    an alias table; those that find a place empty, or a particle twice, are dropped. This is
    uniformisation: the jump process is exact. The cost of an event depends neither on the kernel
    nor, but for the caches, on the number of particles.

    Parameters
    ----------
    classes : {0, 1, 2, 4, 8, 16}
        Classes an octave; 0: by the number of particles.

    References
    ----------
    A. Jensen, Skand. Aktuarietidskr. 36, 87 (1953), doi:10.1080/03461238.1953.10419459
    (uniformisation); A. Patterson, M. Kraft et al., J. Comput. Phys. 211, 638 (2006),
    doi:10.1016/j.jcp.2005.06.008 (majorants and binary search).
    """

    classes: int = 0

    name: ClassVar[str] = "size-class"
    title: ClassVar[str] = "size-class"
    reference: ClassVar[str] = "uniformisation, A. Jensen, Skand. Aktuarietidskr. 36, 87 (1953)"

    work_type: ClassVar[type] = Work

    @staticmethod
    def bind(rate: Any, tally: Any) -> Pieces:
        return pieces.bind(rate, tally)

    def __post_init__(self) -> None:
        if self.classes not in (0, 1, 2, 4, 8, 16):
            raise InputError(f"classes = {self.classes!r}: must be 1, 2, 4, 8, 16, or 0 (chosen)")

    def _bits(self, particles: int) -> int:
        if self.classes:
            return self.classes.bit_length() - 1
        return 1 if particles < 30_000 else 2 if particles < 300_000 else 3

    def new_work(
        self, rates: Rates, populations: list[tuple[Int, Int]], state: State, mass: int
    ) -> Work:
        replicas = len(populations)
        total = np.array([counts.sum() for _, counts in populations])
        largest = max(int(sizes[-1]) for sizes, _ in populations)
        work = empty_work(replicas, *self.extent(int(total.max()), largest, mass), rates)
        state.count[:, PARTICLES] = total
        edges = slot_edges(int(work.meta[0, BITS]))
        same = all(population is populations[0] for population in populations)
        for r, (sizes, counts) in enumerate(populations[:1] if same else populations):
            _fill(work, r, sizes, counts, edges)
        if same:
            for array in (work.meta, work.number, work.tail, work.where, work.pool):
                array[1:] = array[0]
        work.before[:] = work.number
        return work

    def extent(self, most: int, largest: int, mass: int) -> tuple[int, int, int, int, bool]:
        """Return classes, their bits and those of chunks, particles and whether entries are wide.

        For so many particles at the start, of these sizes at the most.
        """
        bits, block = self._bits(most), _OCTAVES << self._bits(most)
        top = min(max(mass, largest, 16).bit_length(), 61)
        classes = -(-(_class_of(1 << top, bits) + 1) // block) * block
        return classes, bits, _chunk(most), most, largest > _NARROW

    def _lacks(self, work: Work, state: State) -> tuple[int, bool]:
        """Return how many classes the sizes to be stored need, and whether wider entries."""
        size, classes, bits = int(state.sizes.max()), work.number.shape[1], int(work.meta[0, BITS])
        more = classes + (_OCTAVES << bits) if _class_of(size, bits) >= classes else classes
        return more, size > work.meta[0, WIDEST]

    def grow(self, work: Work, state: State) -> Work:
        """See `Method.grow`; what has no room is found out from the sizes that are to be stored."""
        classes, wide = self._lacks(work, state)
        if classes > work.number.shape[1]:
            return _more_classes(work, classes)
        if wide:
            pool = work.pool.astype(np.int64)
            work.meta[:, WIDEST] = np.iinfo(np.int64).max
            return work._replace(pool=pool)
        return _more_chunks(work)

    def growth(self, work: Work, state: State) -> int:
        classes, wide = self._lacks(work, state)
        if classes > work.number.shape[1]:
            fixed = work.pool.nbytes + work.free.nbytes
            return int((size_of(work) - fixed) * (classes / work.number.shape[1]) ** 2)
        if wide:
            return 2 * work.pool.nbytes
        return 2 * (work.pool.nbytes + work.free.nbytes + work.where.nbytes)

    def supply_bound(self, work: Work, rates: Rates, state: State, replica: int) -> None:
        """See `Method.supply_bound`; bounds come in fixed blocks of octaves.

        A bound must not depend on which replica asked first.
        """
        number = work.number[replica]
        largest = int(np.flatnonzero(number | work.flow[replica])[-1])
        bits = int(work.meta[0, BITS])
        edges, block = slot_edges(bits), _OCTAVES << bits
        for start in range(0, largest + 1, block):
            if np.isnan(work.low[0, start + 1, start + 1]):  # no other replica has asked for it
                g, h = np.triu_indices(min(start + block, len(edges) - 1))
                new = (h >= start) & (g >= 1)
                g, h = g[new], h[new]
                high, low = _bounds(rates, edges, g, h, 2 << bits)
                work.high[:, g, h] = work.high[:, h, g] = high
                work.low[:, g, h] = work.low[:, h, g] = low
        summed = np.isfinite(state.clock[replica, MAJORANT])
        if not summed or np.isnan(work.high[:, 1 : largest + 1, 1 : largest + 1]).any():
            smallest = int(edges[np.flatnonzero(number)[0]])
            raise InputError(
                f"the rates of the sizes {smallest} to {edges[largest + 1] - 1}, which were "
                f"reached at t = {state.clock[replica, TIME]:.6g}, have no finite "
                f"{'bound' if summed else 'sum'}; limit what grows, as in exp(min(x, 500)), "
                "or end earlier"
            )

    def held(self, work: Work, state: State, replica: int) -> tuple[Int, Int]:
        number, single = work.number[replica], int(work.meta[0, SINGLE])
        lists = [
            members(work, replica, g, work.pool) for g in range(single, len(number)) if number[g]
        ]
        return number[:single], np.concatenate([*lists, np.zeros(0, np.int64)])

    def split(self, work: Work, state: State, number: int, copies: int, words: Words) -> list[Part]:
        return split(work, number, copies, words)

    def collect(self, rates: Rates, parts: list[Part], state: State, mass: int) -> Work:
        """See `Method.collect`; classes are as in the stores from which the parts come."""
        number = np.zeros(max(len(part.number) for part in parts), np.int64)
        for part in parts:
            number[: len(part.number)] += part.number
        total, bits = int(number.sum()), parts[0].bits
        wide = max(part.widest for part in parts) > _NARROW
        work = empty_work(1, len(number), bits, _chunk(total), total, wide, rates)
        state.count[0, PARTICLES] = total
        collect(work, parts)
        work.before[:] = work.number
        return work

    def carried(self, work: Work, state: State) -> Any:
        """See `Method.carried`: bounds of pairs of classes, and how often a particle comes in."""
        bits, span = (int(work.meta[0, k]) for k in (BITS, SPAN))
        return bits, span, int(state.count[0, SINCE]), work.flow[0], work.high, work.low

    def carry_over(self, work: Work, state: State, carried: list[Any]) -> None:
        carried = [found for found in carried if found[0] == work.meta[0, BITS]]
        for _, _, _, _, high, low in carried:
            n = min(high.shape[1], work.high.shape[1])
            own = work.high[:, :n, :n], work.low[:, :n, :n]
            new = ~(own[0] >= high[:, :n, :n])  # unknown so far, or raised by another
            own[0][new], own[1][new] = high[:, :n, :n][new], low[:, :n, :n][new]
        if carried:
            _, span, since, flow, _, _ = carried[0]
            n = min(len(flow), work.flow.shape[1])
            work.meta[0, SPAN], state.count[0, SINCE] = span, since
            work.flow[0, :n] = flow[:n]

    def carrying(self) -> Method:
        from .carrying import Carrying

        return Carrying(self.classes)

    def bytes_per_replica(self, particles: int) -> int:
        # as for monomers: four bytes a particle, and what grows with the classes
        bits, chunk = self._bits(particles), _chunk(particles)
        classes = _class_of(2 * particles, bits) + (_OCTAVES << bits)
        lists = 4 * classes * ((particles >> chunk) + 2)
        return 4 * particles + lists + 26 * classes**2 + (4 * classes << chunk)


def _chunk(particles: int) -> int:
    """Bits of the entries of a chunk: there should be some thousand chunks, of 16 to 4096."""
    return int(np.clip(particles.bit_length() - 12, 4, 12))


def _class_of(size: int, bits: int) -> int:
    return int(np.searchsorted(slot_edges(bits), size, side="right")) - 1


def empty_work(
    replicas: int, classes: int, bits: int, chunk: int, particles: int, wide: bool, rates: Rates
) -> Work:
    """Make arrays for this many classes, without particles."""
    # a class may hold all particles; every list may end in a chunk that is not full
    stride = (particles >> chunk) + 2
    chunks = stride + classes
    meta = np.zeros((replicas, META), np.int64)
    meta[:, (BITS, CHUNK, FREE, SINGLE)] = bits, chunk, chunks, 2 << bits
    meta[:, NEXT], meta[:, STALE] = AHEAD, 1
    meta[:, WIDEST] = np.iinfo(np.int64).max if wide else _NARROW
    pairs = classes * (classes + 1) // 2
    bounded = 1 if rates.rigorous else replicas
    free = np.tile(np.arange(chunks, dtype=np.int32)[::-1], (replicas, 1))

    def zeros(columns: int, kind: Any) -> Any:
        return np.zeros((replicas, columns), kind)

    return Work(
        meta=meta,
        number=zeros(classes, np.int64),
        room=zeros(classes, np.int64),
        flow=zeros(classes, np.int64),
        before=zeros(classes, np.int64),
        tail=zeros(classes, np.int64),
        where=np.zeros((replicas, classes, stride), np.int32),
        free=free,
        pool=zeros(chunks << chunk, np.int64 if wide else np.int32),
        table=zeros(3 * pairs, np.uint64),
        weight=zeros(pairs, float),
        share=zeros(pairs, float),
        alias=zeros(pairs, np.int32),
        classes=zeros(pairs, np.uint32),
        queue=zeros(pairs, np.int32),
        one=zeros(AHEAD, np.int64),
        two=zeros(AHEAD, np.int64),
        place_one=zeros(AHEAD, np.int64),
        place_two=zeros(AHEAD, np.int64),
        column=zeros(AHEAD, np.int64),
        rest=zeros(AHEAD, np.uint64),
        wait=zeros(AHEAD, float),
        high=np.full((bounded, classes, classes), np.nan),
        low=np.full((bounded, classes, classes), np.nan),
    )


def _fill(work: Work, r: int, sizes: Int, counts: Int, edges: Int) -> None:
    """Store an initial population."""
    bits, chunk = int(work.meta[r, BITS]), int(work.meta[r, CHUNK])
    single = sizes < 2 << bits
    work.number[r, sizes[single]] = counts[single]
    sizes, counts = sizes[~single], counts[~single]
    of = np.searchsorted(edges, sizes, side="right") - 1
    for g in np.unique(of):
        n = int(counts[of == g].sum())
        used = -(-n >> chunk)
        left = int(work.meta[r, FREE]) - used
        taken = work.free[r, left : left + used][::-1]
        work.meta[r, FREE] = left
        work.where[r, g, :used] = taken
        work.number[r, g] = n
        held = np.empty(n, work.pool.dtype)
        spread(sizes[of == g], counts[of == g], held)
        for k, c in enumerate(taken):
            part = held[k << chunk : (k + 1) << chunk]
            work.pool[r, int(c) << chunk : (int(c) << chunk) + len(part)] = part
        work.tail[r, g] = (int(taken[-1]) << chunk) + len(part) - 1


def members(work: Any, r: int, g: int, of: Any) -> Int:
    """Return what an array has at the places of a list: the sizes, of the pool."""
    chunk = int(work.meta[r, CHUNK])
    n = int(work.number[r, g])
    places = work.where[r, g, : -(-n >> chunk)].astype(np.int64) << chunk
    held: Int = of[r, (places[:, None] + np.arange(1 << chunk)).ravel()[:n]].astype(np.int64)
    return held


def _more_classes(work: Work, classes: int) -> Work:
    pairs = classes * (classes + 1) // 2
    bounded, old, _ = work.high.shape
    high, low = (np.full((bounded, classes, classes), np.nan) for _ in range(2))
    high[:, :old, :old], low[:, :old, :old] = work.high, work.low
    where = np.zeros((len(work.meta), classes, work.where.shape[2]), np.int32)
    where[:, :old] = work.where
    by_class = {
        f: enlarged(getattr(work, f), classes) for f in ("number", "room", "flow", "before", "tail")
    }
    by_pair = {
        f: enlarged(getattr(work, f), pairs)
        for f in ("weight", "share", "alias", "classes", "queue")
    }
    by_pair["table"] = enlarged(work.table, 3 * pairs)
    return work._replace(high=high, low=low, where=where, **by_class, **by_pair)


def _more_chunks(work: Work) -> Work:
    """Double the pool, and the most that a list may hold."""
    return _with_chunks(work, 2 * work.free.shape[1], 2 * work.where.shape[2])


def _with_chunks(work: Work, chunks: int, stride: int) -> Work:
    """Return the store with so many chunks, of which a list may hold `stride`."""
    chunk, old = int(work.meta[0, CHUNK]), work.free.shape[1]
    more = chunks - old
    free = enlarged(work.free, chunks)
    for r in range(len(free)):  # the new chunks are used last: their memory may never be touched
        left = int(work.meta[r, FREE])
        free[r, more : more + left] = work.free[r, :left]
        free[r, :more] = np.arange(chunks - 1, old - 1, -1)
    wider = stride - work.where.shape[2]
    grown = work._replace(
        free=free,
        # as places beyond the end were taken, so that those drawn ahead are right or found anew
        where=np.pad(work.where, ((0, 0), (0, 0), (0, wider)), mode="edge"),
        pool=enlarged(work.pool, chunks << chunk),
    )
    work.meta[:, FREE] += more
    return grown


def _bounds(rates: Rates, edges: Int, g: Int, h: Int, single: int) -> tuple[Any, Any]:
    """Upper bounds for pairs of classes, and what a rate is at least as a share of them."""
    a, b = edges[g].astype(float), (edges[g + 1] - 1).astype(float)
    c, d = edges[h].astype(float), (edges[h + 1] - 1).astype(float)
    high, least = np.empty(len(g)), np.empty(len(g))
    whole = h < single  # one size each: the rate itself, as it may be rounded elsewhere
    least[whole] = rates.arrays(a[whole], c[whole])
    high[whole] = least[whole] * ROUNDING
    wide = ~whole
    least[wide], high[wide] = rates.bounds(a[wide], b[wide], c[wide], d[wide])
    if not rates.rigorous:
        least[wide] = 0.0
        # zeros alone prove nothing: candidates go on coming, at the rate of all sizes so far
        top = np.max(high[np.isfinite(high)], initial=0.0)
        high[wide & (high <= 0.0)] = top
    # where there is no valid rate, candidates must come and find that out
    invalid = whole & ~((high >= 0.0) & (high < np.inf))
    high[invalid], least[invalid] = 1.0, 0.0
    high = np.maximum(high, 0.0)
    with np.errstate(all="ignore"):
        low = np.where(high > 0.0, np.maximum(least, 0.0) / high, 0.0)
    low = np.where(np.isfinite(low), np.minimum(low, 1.0), 0.0)
    high[~np.isfinite(high)] = np.nan
    return high, low
