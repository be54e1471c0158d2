"""Size-class with rows: every particle is in a list, with what it carries beside it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from smolux.core.burst import LAST, NOT_PLAIN, PLAIN, Burst
from smolux.core.loop import Pieces
from smolux.core.slots import slot_edges
from smolux.core.state import PARTICLES, State
from smolux.core.store import Store, pieces_of
from smolux.jit.compile import at, piece
from smolux.methods.base import Int, Rates, Rows, Words, enlarged

from . import pieces
from .lists import place_of_particle
from .method import SizeClass, empty_work, members
from .state import BITS, CHUNK, FREE, NEXT, SINGLE, SLOT_BITS, STALE
from .state import Work as Plain
from .state import view as plain_view
from .store import chunks_for, make_changes, make_visit
from .table import prepare


class Work(NamedTuple):
    """As `smolux.methods.size_class.state.Work`, without classes that are only counted.

    Attributes
    ----------
    rows : int64 array of shape (R, entries D)
        What each particle carries, the D numbers of a place of the pool after those of the place
        before; and the others of `smolux.core.rows`.
    """

    meta: np.ndarray
    number: np.ndarray
    room: np.ndarray
    flow: np.ndarray
    before: np.ndarray
    tail: np.ndarray
    where: np.ndarray
    free: np.ndarray
    pool: np.ndarray
    table: np.ndarray
    weight: np.ndarray
    share: np.ndarray
    alias: np.ndarray
    classes: np.ndarray
    queue: np.ndarray
    one: np.ndarray
    two: np.ndarray
    place_one: np.ndarray
    place_two: np.ndarray
    column: np.ndarray
    rest: np.ndarray
    wait: np.ndarray
    high: np.ndarray
    low: np.ndarray
    rows: np.ndarray
    row: np.ndarray
    mixed: np.ndarray
    account: np.ndarray
    born: np.ndarray


@piece
def _view(w, r):
    v = plain_view(w, r)
    return Work(
        v.meta, v.number, v.room, v.flow, v.before, v.tail, v.where, v.free, v.pool,
        v.table, v.weight, v.share, v.alias, v.classes, v.queue, v.one, v.two,
        v.place_one, v.place_two, v.column, v.rest, v.wait, v.high, v.low, w.rows[r],
        w.row[r], w.mixed[r], w.account[r], w.born,
    )  # fmt: skip


_remove, _insert, _double = make_changes(True)


@piece
def _load(w, place):
    width = w.mixed.shape[0]
    first = place_of_particle(w, place) * width
    for d in range(width):
        w.mixed[d] += w.rows[at(first + d)]


@piece
def _take(s, w, place):
    _remove(w, place >> SLOT_BITS, place_of_particle(w, place))


@piece
def _put(s, w, size, count, i, j, p):
    _insert(w, size, count)


_remove_pair = pieces.make_remove(_remove)


@piece
def _replace(w, held, a, b, gone, size, count):
    # two that become one: nothing is drawn
    if gone != 3 or count != 1 or chunks_for(w, size, count, count) > w.meta[FREE]:
        return NOT_PLAIN, held
    k, width = at(w.meta[NEXT] - 1), w.mixed.shape[0]  # the candidate that was accepted
    one, two = w.place_one[k], w.place_two[k]
    for d in range(width):
        w.row[d] = w.rows[at(one * width + d)] + w.rows[at(two * width + d)]
    _remove_pair(w, gone, a, one, b, two)
    _insert(w, size, count)
    return (PLAIN if w.meta[STALE] == 0 else LAST), held


@dataclass(frozen=True)
class Carrying(SizeClass):
    """Size-class of particles with rows, see `smolux.core.rows`."""

    work_type: ClassVar[type] = Work

    @staticmethod
    def bind(rate: Any, tally: Any) -> Pieces:
        store = Store(
            _view, pieces.size, pieces.pick, pieces.room, _take, _put, _double, make_visit(tally),
            load=_load,
        )  # fmt: skip
        find = pieces.make_find(rate, True)
        burst = Burst(pieces.row, pieces.hold, find, _replace, pieces.release)
        return pieces_of(store, pieces.make_draw(find), prepare, burst)

    def carrying_work(
        self, rates: Rates, particles: list[Rows], born: Int, state: State, mass: int
    ) -> Work:
        most = max(len(sizes) for sizes, _ in particles)
        largest = max(int(sizes.max(initial=1)) for sizes, _ in particles)
        plain = empty_work(len(particles), *self.extent(most, largest, mass), rates)
        plain.meta[:, SINGLE] = 0
        width = born.shape[1]
        rows = np.zeros((*plain.pool.shape, width), np.int64)
        for r, (sizes, carried) in enumerate(particles):
            _fill(plain, rows, r, sizes, carried)
            state.count[r, PARTICLES] = len(sizes)
        plain.before[:] = plain.number
        scratch = np.zeros((len(particles), width), np.int64)
        account = np.zeros((len(particles), 2, width + 1), np.int64)
        others: Any = (rows.reshape(len(rows), -1), scratch, scratch.copy(), account, born)
        return Work(*plain, *others)

    def grow(self, work: Any, state: State) -> Any:
        grown: Any = super().grow(work, state)
        wanted = grown.pool.shape[1] * work.mixed.shape[1]
        return grown._replace(rows=enlarged(work.rows, max(wanted, work.rows.shape[1])))

    def growth(self, work: Any, state: State) -> int:
        return int(super().growth(work, state) + 2 * work.rows.nbytes)

    def rows(self, work: Any, state: State, replica: int) -> Rows:
        filled, width = np.flatnonzero(work.number[replica]), work.mixed.shape[1]
        carried = work.rows.reshape(len(work.rows), -1, width)
        sizes = [members(work, replica, int(g), work.pool) for g in filled]
        rows = [members(work, replica, int(g), carried) for g in filled]
        none = np.zeros((0, width), np.int64)
        return np.concatenate([*sizes, np.zeros(0, np.int64)]), np.concatenate([*rows, none])

    def split(self, work: Any, state: State, number: int, copies: int, words: Words) -> list[Any]:
        raise NotImplementedError

    def bytes_per_replica(self, particles: int) -> int:
        return super().bytes_per_replica(particles) + 16 * particles


def _fill(work: Plain, rows: Int, r: int, sizes: Int, carried: Int) -> None:
    """Store particles, class by class, with their rows."""
    bits, chunk = int(work.meta[r, BITS]), int(work.meta[r, CHUNK])
    of = np.searchsorted(slot_edges(bits), sizes, side="right") - 1
    for g in np.unique(of):
        chosen = np.flatnonzero(of == g)
        used = -(-len(chosen) >> chunk)
        left = int(work.meta[r, FREE]) - used
        taken = work.free[r, left : left + used][::-1]
        work.meta[r, FREE] = left
        work.where[r, g, :used] = taken
        work.number[r, g] = len(chosen)
        for k, c in enumerate(taken):
            part = chosen[k << chunk : (k + 1) << chunk]
            place = slice(int(c) << chunk, (int(c) << chunk) + len(part))
            work.pool[r, place], rows[r, place] = sizes[part], carried[part]
        work.tail[r, g] = (int(taken[-1]) << chunk) + len(part) - 1
