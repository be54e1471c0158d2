"""Acceptance-rejection with rows: every particle is stored, with what it carries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from smolux.core import rng
from smolux.core.bounds import note_largest
from smolux.core.burst import NOT_PLAIN, PLAIN, Burst
from smolux.core.loop import Pieces
from smolux.core.pick import largest_rate, takes
from smolux.core.slots import slot_of
from smolux.core.state import LARGEST, MONOMERS, SMALLEST, STORED, TRIALS, UNARY_BITS, State
from smolux.core.store import Store, pieces_of
from smolux.jit.compile import at, cold_piece, piece
from smolux.methods.base import Int, Rates, Rows, enlarged

from . import pieces
from .method import AcceptanceRejection
from .store import APART, SLACK, renew_all, size_of, watch


class Work(NamedTuple):
    """As `smolux.methods.acceptance_rejection.store.Work`, without monomers that are only counted.

    Attributes
    ----------
    rows : int64 array of shape (R, capacity D)
        What each particle carries, the D numbers of one after those of the one
        before; and the others of `smolux.core.rows`.
    """

    sizes: np.ndarray
    ahead: np.ndarray
    level: np.ndarray
    apart: np.ndarray
    edges: np.ndarray
    majorant: np.ndarray
    table: np.ndarray
    rows: np.ndarray
    row: np.ndarray
    mixed: np.ndarray
    account: np.ndarray
    born: np.ndarray


@piece
def _view(w, r):
    return Work(
        w.sizes[r], w.ahead[r], w.level[r], w.apart[r], w.edges, w.majorant, w.table,
        w.rows[r], w.row[r], w.mixed[r], w.account[r], w.born,
    )  # fmt: skip


@piece
def _size(s, w, place):
    return size_of(w, np.int64(0), place)


@piece
def _pick(s, w, r, c):
    # all are held together
    largest = largest_rate(s, r, np.int64(1), slot_of(s.count[LARGEST], UNARY_BITS))
    while True:
        k = rng.below(s.rng, s.count[STORED])
        size = np.int64(w.sizes[k])
        if takes(s, r, size, largest):
            return k, size
        s.count[TRIALS] += 1


@piece
def _room(s, w, gone, entries, p):
    needed = np.int64(SLACK)
    for e in range(entries):
        needed += s.counts[e]
    if s.count[STORED] + needed > w.sizes.shape[0]:
        return False
    if w.apart[APART] == 1:
        watch(s, w, gone, entries)
    for e in range(entries):
        s.count[SMALLEST] = min(s.count[SMALLEST], s.sizes[e])
        note_largest(s, s.sizes[e])
    return True


@piece
def _load(w, place):
    width = w.mixed.shape[0]
    for d in range(width):
        w.mixed[d] += w.rows[at(place * width + d)]


@piece
def _take(s, w, place):
    last, width = s.count[STORED] - 1, w.mixed.shape[0]
    w.sizes[at(place)] = w.sizes[at(last)]
    for d in range(width):
        w.rows[at(place * width + d)] = w.rows[at(last * width + d)]
    s.count[STORED] = last


@piece
def _put(s, w, size, count, i, j, p):
    place, width = s.count[STORED], w.mixed.shape[0]
    w.sizes[at(place)] = size
    for d in range(width):
        w.rows[at(place * width + d)] = w.row[d]
    s.count[STORED] = place + 1


@cold_piece
def _double(s, w):
    stored = s.count[STORED]
    if 2 * stored + SLACK > w.sizes.shape[0]:
        return False
    if w.apart[APART] == 1:  # of the one apart there are two now
        renew_all(w)
    for k in range(stored):
        w.sizes[stored + k] = w.sizes[k]
    width = w.mixed.shape[0]
    for k in range(stored * width):
        w.rows[stored * width + k] = w.rows[k]
    for k in range(2):
        for d in range(w.account.shape[1]):
            w.account[k, d] *= 2
    s.count[STORED] *= 2
    return True


@piece
def _replace(w, held, a, b, gone, size, count):
    # two that become one: nothing is drawn
    if gone != 3 or count != 1 or size < held.bottom or size >= held.top:
        return NOT_PLAIN, held
    last, width = held.stored - 1, w.mixed.shape[0]
    low, high = min(a, b), max(a, b)
    w.sizes[at(low)] = size
    w.sizes[at(high)] = w.sizes[at(last)]
    for d in range(width):
        w.rows[at(low * width + d)] += w.rows[at(high * width + d)]
        w.rows[at(high * width + d)] = w.rows[at(last * width + d)]
    smallest, largest = min(held.smallest, size), max(held.largest, size)
    return PLAIN, pieces.Held(
        held.monomers, last, smallest, largest, held.bottom, held.top, held.unit
    )


@dataclass(frozen=True)
class Carrying(AcceptanceRejection):
    """Acceptance-rejection of particles with rows, see `smolux.core.rows`."""

    work_type: ClassVar[type] = Work

    @staticmethod
    def bind(rate: Any, tally: Any) -> Pieces:
        store = Store(
            _view, _size, _pick, _room, _take, _put, _double, pieces.make_visit(tally), load=_load
        )
        find = pieces.make_find(rate, True)
        burst = Burst(pieces.row, pieces.hold, find, _replace, pieces.release)
        return pieces_of(store, pieces.make_draw(find), pieces.prepare, burst)

    def carrying_work(
        self, rates: Rates, particles: list[Rows], born: Int, state: State, mass: int
    ) -> Work:
        populations = [np.unique(sizes, return_counts=True) for sizes, _ in particles]
        plain = self.new_work(rates, populations, state, mass)
        stored = np.array([len(sizes) for sizes, _ in particles])
        replicas, width = len(particles), born.shape[1]
        sizes = np.zeros((replicas, int(stored.max()) + 8), np.int64)
        rows = np.zeros((*sizes.shape, width), np.int64)
        for r, (given, carried) in enumerate(particles):
            sizes[r, : len(given)], rows[r, : len(given)] = given, carried
        state.count[:, MONOMERS], state.count[:, STORED] = 0, stored
        return Work(
            **plain._replace(sizes=sizes)._asdict(),
            rows=rows.reshape(replicas, -1),
            row=np.zeros((replicas, width), np.int64),
            mixed=np.zeros((replicas, width), np.int64),
            account=np.zeros((replicas, 2, width + 1), np.int64),
            born=born,
        )

    def grow(self, work: Any, state: State) -> Any:
        more = 2 * work.sizes.shape[1]
        rows = enlarged(work.rows, more * work.mixed.shape[1])
        return work._replace(sizes=enlarged(work.sizes, more), rows=rows)

    def rows(self, work: Any, state: State, replica: int) -> Rows:
        stored = int(state.count[replica, STORED])
        rows = work.rows[replica].reshape(-1, work.mixed.shape[1])
        return work.sizes[replica, :stored], rows[:stored]

    def bytes_per_replica(self, particles: int) -> int:
        return 8 * particles
