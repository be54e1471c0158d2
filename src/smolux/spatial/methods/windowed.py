"""The windowed method: exact, and at a cost that hardly grows with the number of discs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from smolux.runtime.room import needed
from smolux.spatial.analysis.overlaps import cells_for
from smolux.spatial.results.eventlog import Logger, reasons
from smolux.spatial.results.trace import Trace
from smolux.spatial.system import System

from .base import LISTS, Run, SpatialMethod

Float = NDArray[np.float64]

_ROOM = 1 << 16
#: bytes of a cache line, and how many of a row are given away to fill its last one
_LINE, _SPARE = 64, 8
#: pairs by disc that the skin at the start is to list; its least, in diameters: then room is made
_LISTED, _THIN = 1.25, 1e-3
#: room for pairs and for events at the start, by disc
_PAIRS, _EVENTS = 1.75, 1.75
#: discs of one cluster share a block from this mean size on
_BLOCKS_FROM = 4.0


def _rows(count: int, **columns: tuple[str, int]) -> NDArray[Any]:
    """Return a table of rows, all columns of one beside each other; rows begin with cache lines."""
    kinds = [(name, kind, (width,)) for name, (kind, width) in columns.items()]
    row = np.dtype(kinds, align=True)
    spare = -row.itemsize % _LINE
    if spare <= _SPARE:  # longer rows, but none lies in one cache line more than it needs
        row = np.dtype([*kinds, ("spare", "u1", (spare,))], align=True)
    memory = np.zeros(count * row.itemsize + _LINE, np.uint8)
    start = -memory.ctypes.data % _LINE
    return memory[start : start + count * row.itemsize].view(row)


def _first_skin(system: System) -> float:
    """Return a skin within which discs at random have so many others as there is room for."""
    r, d = system.radius, system.dimension
    one, two = 2 * r.mean(), 2 * (r**2).mean() + 2 * r.mean() ** 2  # moments of r_i + r_j
    unit = np.pi * (1 if d == 2 else 4 / 3)
    room = 2 * _LISTED * system.box.volume / (len(system) * unit)
    shell = [1, 2 * one, -room] if d == 2 else [1, 3 * one, 3 * two, -room]
    roots = np.roots(shell)  # one of them is positive, as the signs change once
    return float(max(root.real for root in roots if abs(root.imag) <= 1e-9 * abs(root)))


def _levels(f: Any, room: float, spread: int, flight: Any) -> list[tuple[float, int]]:
    """Give blocks their levels; return the largest diameter and the number of discs of each.

    The cells of a level are about half as wide as those of the next one: what is much smaller than
    the `room` that cells need anyway is of the lowest level.
    """
    if not spread:
        return [(2 * float(f.radius[0]), len(f.rel))]
    first = f.block[:-1, flight.FIRST]
    width = 2 * np.maximum.reduceat(f.radius, first) + room
    level = np.floor(np.log2(width.max() / width) * (1 - 1e-12)).astype(np.int64)
    _, level = np.unique(-level, return_inverse=True)
    f.block[:-1, flight.LEVEL] = level
    discs = np.bincount(level, np.diff(f.block[:, flight.FIRST]))
    return [(float(width[level == k].max()) - room, int(n)) for k, n in enumerate(discs)]


@dataclass
class _State:
    """What survives when discs are put into blocks anew: clusters as arrays by cluster."""

    x: Float
    names: NDArray[np.int32]
    label: NDArray[np.int32]
    velocity: Float
    mass: Float
    #: one of the 2 d columns of the lower and upper bounds
    bound: Callable[[int], Float]


def _left_behind(before: Trace, system: System, room: Float) -> _State:
    """Return the clusters that a run left behind."""
    names, which = np.unique(before.cluster, return_inverse=True)
    order = np.argsort(which, kind="stable")
    starts = np.searchsorted(which[order], np.arange(len(names)))
    x, d = before.position, system.dimension

    def bound(k: int) -> Float:
        if k < d:
            return np.minimum.reduceat((x[:, k] - room)[order], starts)
        return np.maximum.reduceat((x[:, k - d] + room)[order], starts)

    everyone = np.arange(len(x), dtype=np.int32)
    mass = np.bincount(which, system.mass).astype(np.float64)
    # a cluster has the name of one of its discs
    return _State(x, everyone, which.astype(np.int32), before.velocity[names], mass, bound)


class WindowedRun(Run):
    """A run of the windowed method."""

    def __init__(self, system: System, settings: Windowed, before: Trace | None = None) -> None:
        from smolux.spatial.events import direct, flight, geometry, packing, windows

        self.system, self.settings = system, settings
        self._flight, self._packing, self._events = flight, packing, direct.Events
        n, d = system.position.shape
        self._loop = windows.fly
        self.logger = Logger(min(_ROOM, 16 * n + 4096), d)
        self.work, self.near = np.zeros((4, d)), np.zeros((3, 3), np.int64)
        box, widest = system.box, 2 * float(system.radius.max())
        thickest, images = max(box.lengths) / 4, 1
        for side in np.array(box.lengths)[box.periodic]:
            # no pair may come within reach of another image than those that are looked at
            narrow = side / 2 - widest < geometry.NARROW * widest
            thickest = min(thickest, 0.49 * (side - widest if narrow else side / 2 - widest))
            images = 1 << d if narrow else images
        self._room = [int(_PAIRS * n) + 64, int(_EVENTS * n) + 64]
        self.count = np.zeros(flight.COUNTS, np.int64)
        self.count[flight.CLUSTERS] = n
        self.count[flight.IMAGES] = images
        self.count[flight.SPREAD] = 0 if system.monodisperse else 1
        self.clock = np.zeros(flight.CLOCKS)
        self.clock[flight.SCALE] = float(np.sqrt((system.velocity**2).sum(1).max()))
        self.clock[flight.LONGEST] = max(box.lengths)
        self.clock[flight.USUAL] = 2 * float(system.radius.mean())
        self.clock[flight.THICKEST] = thickest
        self.clock[flight.SKIN] = min(settings.skin or _first_skin(system), thickest)
        room = system.radius if system.wall_contact == "surface" else np.zeros(n)
        everyone = np.arange(n, dtype=np.int32)
        state = _State(
            system.position, everyone, everyone, system.velocity, system.mass,
            lambda k: system.position[:, k % d] + (room if k >= d else -room),
        )  # fmt: skip
        if before is not None:
            state = _left_behind(before, system, room)
            self.logger.take(before.log)
            merges = before.log.time[before.log.merges]
            self.count[flight.CLUSTERS] = len(state.mass)
            self.clock[flight.TIME] = before.time
            self.clock[flight.LATEST] = merges[-1] if len(merges) else 0.0
        self.flight = self._packed(state)

    def _packed(self, state: _State) -> Any:
        """Return a flight with discs in the order of space, in blocks; nothing is listed yet."""
        system, clock, count, flight = self.system, self.clock, self.count, self._flight
        n, d = state.x.shape
        skin = float(clock[flight.SKIN])
        length, period = np.array(system.box.lengths), system.box.periods
        together = n >= _BLOCKS_FROM * count[flight.CLUSTERS]
        span = skin / 2 if together else -1.0
        cells = cells_for(system.box, skin / 2 if together else 0.0, n)
        counts = np.empty(int(np.prod(cells)) + 1, np.int32)
        perm, opens = np.empty(n, np.int32), np.empty(n, np.bool_)
        blocks = self._packing.order(
            state.x, state.label, length, period, cells, span, counts, perm, opens
        )
        del counts
        clusters = int(count[flight.CLUSTERS])
        f = self._empty(n, blocks, clusters)
        new = np.full(len(state.mass), -1, np.int32)
        self._packing.pack(f, state.x, state.label, state.names, perm, opens, new)
        if count[flight.SPREAD]:
            f.radius[:] = system.radius[f.disc[:, flight.NAME]]
        old = np.flatnonzero(new >= 0)
        to = new[old]
        for k in range(d):  # one by one, as copies of all take memory
            f.body[to, d + k] = state.velocity[old, k]
        f.body[to, 2 * d + flight.SINCE] = clock[flight.TIME]
        f.body[to, 2 * d + flight.MASS] = state.mass[old]
        f.body[to, 2 * d + flight.WAY] = np.inf
        for k in range(2 * d):
            f.bound[to, k] = state.bound(k)[old]
        return self._gridded(f)

    def _empty(self, n: int, blocks: int, clusters: int) -> Any:
        flight, d = self._flight, self.system.dimension
        pairs, events = self._room
        # what is read together lies together
        disc = _rows(n, rel=("f8", d), disc=("i4", 2))
        block = _rows(
            blocks + 1, place=("f8", d), half=("f4", d), block=("i4", flight.BLOCK_COLUMNS)
        )
        cluster = _rows(
            clusters,
            body=("f8", 2 * d + flight.BODY),
            bound=("f8", 2 * d),
            group=("i4", flight.GROUP_COLUMNS),
        )
        event = _rows(events, when=("f8", 1), event=("i4", 2))
        return flight.Flight(
            axes=tuple(range(d)),
            clock=self.clock,
            count=self.count,
            length=np.array(self.system.box.lengths),
            period=self.system.box.periods,
            cells=np.ones((1, d + 2), np.int64),
            scale=np.ones((1, d + 2)),
            rel=disc["rel"],
            radius=np.full(n if self.count[flight.SPREAD] else 1, self.system.radius[0]),
            disc=disc["disc"],
            block=block["block"],
            place=block["place"][:blocks],
            half=block["half"][:blocks],
            head=np.empty(0, np.int32),
            body=cluster["body"],
            bound=cluster["bound"],
            group=cluster["group"],
            half_edge=_rows(2 * pairs, edge=("i4", flight.EDGE_COLUMNS))["edge"],
            when=event["when"][:, 0],
            event=event["event"],
            lot=np.zeros((flight.LOT, flight.LOT_COLUMNS), np.int64),
        )

    def _gridded(self, f: Any) -> Any:
        """Lay grids for the skin, one for each level of radii.

        A block and all of its level and below that it may be listed with are neighbours.
        """
        flight, box = self._flight, self.system.box
        skin, d = float(self.clock[flight.SKIN]), self.system.dimension
        extent = float(f.half.max()) * (1 + 1e-6)
        levels = _levels(f, skin + extent, self.count[flight.SPREAD], flight)
        cells = np.ones((len(levels), d + 2), np.int64)
        scale = np.empty((len(levels), d + 2))
        places = 0
        for level, (widest, discs) in enumerate(levels):
            # the other one may have moved half a skin since it was binned
            side = 2 * extent + widest + 1.5 * skin
            cells[level, :d] = cells_for(box, side * (1 + 1e-6), discs)
            cells[level, d + flight.OFFSET] = places
            cells[level, d + flight.FORWARD] = (cells[level, :d] > 2).all()
            scale[level, :d] = cells[level, :d] / np.array(box.lengths)
            scale[level, d + flight.WIDEST] = widest
            scale[level, d + flight.EXTENT] = extent
            places += int(np.prod(cells[level, :d]))
        self.clock[flight.BUDGET_OF_WAY] = skin / 2 * (1 - 1e-6)
        self.clock[flight.WINDOW] = -1.0
        self.count[flight.FULL] = 0
        self.count[flight.PACKED] = self.count[flight.WINDOWS]
        return f._replace(cells=cells, scale=scale, head=np.full(places, -1, np.int32))

    def _repack(self) -> None:
        f, flight, d = self.flight, self._flight, self.system.dimension
        t = float(self.clock[flight.TIME])
        x = np.empty_like(f.rel)
        self._packing.positions(f, t, x)
        velocity = f.body[:, d : 2 * d]
        bound, label = f.bound, f.block[f.disc[:, flight.BLOCK], flight.CLUSTER]
        moved = f.body[:, :d] + velocity * (t - f.body[:, 2 * d + flight.SINCE])[:, None]
        state = _State(
            x,
            f.disc[:, flight.NAME],
            label,
            velocity,
            f.body[:, 2 * d + flight.MASS],
            lambda k: bound[:, k] + moved[:, k % d],
        )
        del f, self.flight
        self.flight = self._packed(state)

    def _recover(self, code: int) -> None:
        """Make the skin thinner, or room, when something was full."""
        f, flight = self.flight, self._flight
        if code == flight.NO_PAIRS and self.clock[flight.SKIN] > _THIN * self.clock[flight.USUAL]:
            self.clock[flight.SKIN] /= 2
            self._repack()
            return
        pairs, events = self._room
        more = 0
        if code == flight.NO_PAIRS:
            pairs, more = 2 * pairs, f.half_edge.nbytes
        elif code == flight.NO_EVENTS:
            events, more = 2 * events, f.when.nbytes + f.event.nbytes
        with needed(more, LISTS):
            self._room = [pairs, events]
            del f
            self._repack()

    @property
    def time(self) -> float:  # type: ignore[override]
        """See `Run`."""
        return float(self.clock[self._flight.TIME])

    @property
    def clusters(self) -> int:  # type: ignore[override]
        """See `Run`."""
        return int(self.count[self._flight.CLUSTERS])

    @property
    def events(self) -> int:  # type: ignore[override]
        """See `Run`."""
        return self.logger.events

    def advance(self, until: float, clusters: int, budget: int) -> str | None:
        flight = self._flight
        code, done = self._loop(
            self.flight, self._events(*self.logger.room), until, clusters,
            self.settings.patience, budget, self.work, self.near,
        )  # fmt: skip
        self.logger.keep(done)
        if code in (flight.NO_PAIRS, flight.NO_EVENTS, flight.RESKIN):
            self._recover(code)
        return "" if code == flight.DONE else reasons(flight).get(code)

    def trace(self) -> Trace:
        f, flight, d = self.flight, self._flight, self.system.dimension
        name = f.disc[:, flight.NAME]
        own = f.block[f.disc[:, flight.BLOCK], flight.CLUSTER]
        now, x, v = (np.empty_like(f.rel) for _ in range(3))
        self._packing.positions(f, self.time, now)
        x[name], v[name] = now, f.body[own, d : 2 * d]
        least = np.full(len(f.body), len(x), np.int32)
        np.minimum.at(least, own, name)
        label = np.empty(len(x), np.int32)
        label[name] = least[own]
        counters = {
            "windows": "WINDOWS",
            "listings_of_blocks": "LISTED",
            "distances": "CHECKED",
            "predictions": "PREDICTED",
            "relabelled_blocks": "RELABELLED",
            "full_listings": "REBUILT",
        }
        attributes = {key: int(self.count[getattr(flight, c)]) for key, c in counters.items()}
        return Trace(self.time, x, v, label, self.logger.log(), attributes=attributes)


@dataclass(frozen=True)
class Windowed(SpatialMethod):
    """Pairs that may meet are listed for a window of time; the default.

    Pairs of discs nearer than a skin are listed, and their contacts predicted. No other pair can
    meet before a cluster has moved half a skin, so the method is exact: it makes the same merges at
    the same times as a search over all pairs. Clusters that move fast are listed often, slow ones
    seldom; the skin grows with the clusters, so that listing and predicting cost the same.

    Parameters
    ----------
    patience : float
        The run ends when there was no merge while the fastest cluster would have crossed the box
        so many times.
    skin : float, optional
        Skin at the start; if left out, such that a disc has 2.5 others within it.
    """

    patience: float = 1e4
    skin: float | None = field(default=None)
    name: ClassVar[str] = "windowed"
    title: ClassVar[str] = "pairs that may meet within a window of time"
    reference: ClassVar[str] = "this package; see the theory of ballistic aggregation"

    def start(self, system: System, times: Float, before: Trace | None = None) -> Run:
        """See `SpatialMethod.start`; goes on from what an earlier run left behind."""
        return WindowedRun(system, self, before)
