"""From a model and a method to one compiled loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from .callables import golden
from .content import digest, frozen, is_frozen
from .core import beside, rng
from .core.burst import make_burst
from .core.compile import piece, user_piece, why_not
from .core.lone import Lone, bind_outcomes, bind_rates, make_ledger, make_lone
from .core.loop import make_fire, make_loop, make_next_event
from .core.record import tally_one
from .core.slots import slot_edges
from .core.splits import fill, new_splits, slots_beside
from .core.state import LIMIT, LONE_BITS, Parameters, Windows
from .core.weights import (
    make_outcome,
    make_rate,
    make_replacement,
    make_stands,
    make_tally,
    make_weight,
)
from .errors import InputError
from .methods.base import Method, Rates
from .model import Model
from .processes import Aggregation, Removal, Source
from .processes.base import LoneProcess, PairProcess, Process
from .remembered import bounds_of, timed
from .tables import evaluated, latest
from .timefunction import TimeFunction
from .weighting import Number
from .weighting.base import Weighting

#: windows of time for bounds of a factor that varies: pieces of each octave, first octave
_PIECES = 4
_FIRST_OCTAVE = -20
#: share of the bounds beside it that a bound found by trial has at least
_NEIGHBOUR = 1 / 16


@lru_cache(maxsize=64)
def _as_float(rate: Callable[..., Any]) -> Any:
    inner = user_piece(rate)

    @piece
    def value(i, j, *p):
        return float(inner(i, j, *p))

    return value


@lru_cache(maxsize=64)
def _outcome(kind: Any) -> Any:
    """Bind ``outcome(i, j, s, q)`` of one process, `q` being its own parameters."""
    if kind.random:
        drawn = piece(kind.outcome(rng.uniform))

        @piece
        def random(i, j, s, q):
            return drawn(i, j, s.sizes, s.counts, s.rng, *q)

        return random
    plain = piece(kind.outcome)

    @piece
    def certain(i, j, s, q):
        return plain(i, j, s.sizes, s.counts)

    return certain


@lru_cache(maxsize=64)
def _outcomes(kinds: tuple[Any, ...]) -> Any:
    """Bind the outcomes into one function of the number of the process."""

    def bound(kinds: tuple[Any, ...]) -> Any:
        first = _outcome(kinds[0])
        if len(kinds) == 1:

            @piece
            def last(r, i, j, s, q):
                return first(i, j, s, q[0])

            return last
        others = bound(kinds[1:])

        @piece
        def one_of(r, i, j, s, q):
            if r == 0:
                return first(i, j, s, q[0])
            return others(r - 1, i, j, s, q[1:])

        return one_of

    found = bound(kinds)

    @piece
    def outcome(r, i, j, s, p, q):
        return found(r, i, j, s, q.outcomes), 3

    return outcome


@lru_cache(maxsize=64)
def _factors(rates: tuple[Callable[..., Any], ...]) -> Any:
    """Bind the factors into one; `q` holds a tuple of parameters for each; 0 without any."""
    if not rates:

        @piece
        def none(r, t, q):
            return 0.0

        return none
    first = user_piece(rates[0])
    if len(rates) == 1:

        @piece
        def last(r, t, q):
            return float(first(t, *q[0]))

        return last
    others = _factors(rates[1:])

    @piece
    def factor(r, t, q):
        if r == 0:
            return float(first(t, *q[0]))
        return others(r - 1, t, q[1:])

    return factor


def _rates(processes: Sequence[Process]) -> tuple[Callable[..., Any], ...]:
    return tuple(process.factor.rate for process in processes)


_loops: dict[tuple[Any, ...], Any] = {}


def _kinds(model: Model) -> tuple[list[PairProcess], list[LoneProcess], list[Source]]:
    """Return the processes by their kind."""
    pairs = [p for p in model.processes if isinstance(p, PairProcess)]
    lone = [p for p in model.processes if isinstance(p, LoneProcess)]
    return pairs, lone, [p for p in model.processes if isinstance(p, Source)]


def _key(model: Model, method: Method, weighting: Weighting) -> tuple[Any, ...]:
    pairs, lone, sources = _kinds(model)
    weighted = [f for f in (weighting.weight, weighting.factor) if f is not None]
    functions = [model.kernel.rate, *weighted]
    functions += [type(p).outcome for p in pairs] + [type(p).outcome for p in lone]
    functions += [p.law for p in lone]
    functions += [p.factor.rate for p in model.processes]
    shape = len(model.kernel.parameters), len(weighted), len(pairs), len(lone), len(sources)
    return (type(method), *shape, *((type(p), p.splits) for p in lone), *map(digest, functions))


def uncompilable(model: Model, weighting: Weighting) -> list[str]:
    """Say which functions of the user Numba cannot compile, and what to do."""
    _, lone, _ = _kinds(model)
    given: list[tuple[str, Callable[..., Any], int]] = [
        (f"the kernel {model.kernel.label}", model.kernel.rate, 2 + len(model.kernel.parameters)),
        *((f"the rate of {p.name}", p.law, 2 if p.splits else 1) for p in lone),
        *((f"the rate of {p.name} in time", p.factor.rate, 1) for p in model.processes),
    ]
    if weighting.weight is not None:
        given.append(("the weight function", weighting.weight, 1))
    return [
        f"{what}: {reason}; write it with numbers, math, NumPy, branches and functions of these, "
        "with arrays or tuples in place of lists and dicts, and return a number"
        for what, function, arguments in given
        if is_frozen(function) and (reason := why_not(function, arguments)) is not None
    ]


def loop_for(model: Model, method: Method, weighting: Weighting) -> Any:
    """Return the compiled loop, the same object for the same physics and method.

    The settings of a method are data of its work arrays, those of a weighting parameters.
    """
    key = _key(model, method, weighting)
    if key not in _loops:
        _loops[key] = _assembled(model, method, weighting)
    return _loops[key]


def _assembled(model: Model, method: Method, weighting: Weighting) -> Any:
    pairs, lone, sources = _kinds(model)
    own = len(model.kernel.parameters)
    present = pairs or [Aggregation()]
    outcome, factor = _outcomes(tuple(map(type, present))), _factors(_rates(present))
    simulated, tally, weight = _as_float(model.kernel.rate), tally_one, None
    if weighting.weight is not None:
        weight = make_weight(weighting.weight, own)
        simulated = make_rate(simulated, weighting.weight, weighting.factor, own)
        outcome, tally = make_outcome(outcome, weight), make_tally(weight)
    pieces = method.bind(simulated, tally)
    random = weight is not None or any(type(p).random for p in pairs)
    if not lone and not sources:
        fire = make_fire(pieces.pair, pieces.update, outcome, factor, random, len(pairs))
        burst = None
        if pieces.burst is not None:
            burst = make_burst(pieces.burst, outcome, len(pairs), random)
        return make_loop(pieces, make_next_event(pieces.draw, burst), fire)
    about = [Lone(p.law, type(p).outcome, p.least, p.splits, p.opens) for p in lone]
    shape = len(pairs), len(lone), len(sources)
    rates = bind_rates(about)
    ledger = make_ledger(rates, lambda tally: method.bind(simulated, tally).visit, shape[1])
    draw_lone = make_lone(pieces.pick, rates, shape[0], shape[1])
    choose = beside.make_choice(_factors(_rates(lone)), _factors(_rates(sources)), *shape)
    fire = beside.make_fire(
        pieces, outcome, factor, bind_outcomes(about), choose, make_stands(weight),
        make_replacement(weight), ledger, rates.known, shape[0], shape[1],
    )  # fmt: skip
    next_event = beside.make_next_event(pieces.draw, ledger.ready, draw_lone, pieces.seize, *shape)
    return make_loop(pieces, next_event, fire)


def rates_for(model: Model, weighting: Weighting) -> Rates:
    """Return what a method needs to know of the simulated rate."""
    kernel, weighting = frozen(model.kernel), frozen(weighting)
    weighted = weighting.weight is not None
    arrays = timed(weighting.arrays(evaluated(kernel)))

    @timed
    def table(largest: int) -> Any:
        return latest(kernel, weighting, arrays, largest)

    return Rates(
        (*kernel.parameters, *weighting.parameters),
        arrays,
        table,
        timed(bounds_of(kernel, weighting)),
        kernel.cheap and weighting.cheap,
        kernel.rigorous and weighting.rigorous,
        weighting.majorant(kernel),
        kernel if weighted else None,
        weighting.weights if weighted else None,
    )


def factor_parameters(processes: Sequence[Process]) -> Parameters:
    """Return the parameters of the processes, as the loop takes them, with tables to be filled."""
    pairs = [p for p in processes if isinstance(p, PairProcess)]
    lone = [p for p in processes if isinstance(p, LoneProcess)]
    return Parameters(
        tuple(p.factor.parameters for p in pairs or [Aggregation()]),
        tuple(p.parameters for p in pairs or [Aggregation()]),
        tuple((p.parameters, new_splits()) if p.splits else (p.parameters,) for p in lone),
        tuple(p.factor.parameters for p in lone),
        tuple(p.factor.parameters for p in processes if isinstance(p, Source)),
    )


@timed
def bound_splits(processes: Sequence[Process], parameters: Parameters, size: int) -> None:
    """Bound the splits of the octave of a size, for which the loop returned `SPLITS`."""
    slots, edges = slots_beside(size), slot_edges(LONE_BITS).astype(float)
    low, high = edges[slots], edges[1:][slots] - 1.0
    lone = [p for p in processes if isinstance(p, LoneProcess)]
    for process, own in zip(lone, parameters.lone, strict=True):
        if process.splits:
            bounds = bounds_of(frozen(process.pairs), Number())
            fill(own[1], slots, *process.split_bounds(low, high, bounds))


def _edges(end: float, factors: Sequence[TimeFunction]) -> tuple[float, ...]:
    """Edges of the windows up to the end and of one more: pieces of octaves, and breakpoints."""
    octaves = range(_FIRST_OCTAVE, int(np.ceil(np.log2(max(end, 2.0**_FIRST_OCTAVE)))) + 2)
    edges = np.array([0.0] + [2.0**k * (1 + m / _PIECES) for k in octaves for m in range(_PIECES)])
    last = int(np.searchsorted(edges, end))
    named = np.concatenate([factor.edges for factor in factors])
    inside = named[(named > 0.0) & (named < edges[last + 1])]
    found = np.unique(np.concatenate([edges[: last + 2], inside]))
    return tuple(found[: np.searchsorted(found, edges[last]) + 2].tolist())


@lru_cache(maxsize=32)
def _bounds(factor: TimeFunction, edges: tuple[float, ...]) -> tuple[float, ...]:
    """Bound a factor in all windows but the last one."""
    start, end = np.array(edges[:-2]), np.array(edges[1:-1])
    upper = factor.bounds(start, end)[1]
    if factor.stated is None and not factor.followed:
        # A bound of zero would never be repaired, as nothing would be tried: zeros prove nothing,
        # unless the factor is known to jump between.
        after = np.append(upper[1:], _glimpse(factor, edges[-2], edges[-1]))
        before = np.append(0.0, upper[:-1])
        after[np.isin(end, factor.breakpoints)] = 0.0
        before[np.isin(start, factor.breakpoints)] = 0.0
        upper = np.maximum(upper, _NEIGHBOUR * np.maximum(before, after))
    return tuple(upper.tolist())


def _glimpse(factor: TimeFunction, start: float, end: float) -> float:
    """Bound beyond the last window, which must not differ from that of a longer run; 0 if none."""
    try:
        bound = float(factor.bounds(start, end)[1])
    except Exception:  # what a function does there is not held against it
        return 0.0
    return bound if np.isfinite(bound) else 0.0


@timed
def windows_for(
    processes: Sequence[Process], end: float, weighting: Weighting | None = None
) -> Windows:
    """Bound the rate factors over windows of time that depend on the factors alone.

    A factor that does not vary needs one window without end. Others have four windows an octave of
    time, and more where one of them may jump, whatever the output times are, so that a trajectory
    does not depend on these.

    Raises
    ------
    InputError
        If a factor has no finite bound, or is negative, before the end.
    """
    factors = [process.factor for process in processes]
    if all(f.constant is not None for f in factors):
        edges = [0.0, np.inf]
        bounds = [[float(f.constant) for f in factors if f.constant is not None]]
    else:
        windows = _edges(end, factors)
        edges = [*windows[:-1], np.inf]
        columns = [[*_bounds(f, windows), 0.0] for f in factors]
        bounds = [list(row) for row in zip(*columns, strict=True)]
        _check_factors(processes, edges, np.array(bounds), end)
    array = np.array(bounds, float)
    pairs = sum(isinstance(process, PairProcess) for process in processes)
    total = array[:, :pairs].sum(axis=1)
    return Windows(np.array(edges), array, total, *_beside(processes, weighting or Number()))


#: times at which the inflow is looked at for its mean
_INFLOW_SAMPLES = 4096


def inflow(processes: Sequence[Process], weighting: Weighting, end: float) -> float:
    """Return the simulated particles that come in for a unit of volume and time.

    The mean from time zero to `end`: a source may be silent at the start.

    Raises
    ------
    InputError
        If nothing is seen to come in until then.
    """
    times = end * golden(_INFLOW_SAMPLES)  # in step with no period
    total = 0.0
    for source in (p for p in processes if isinstance(p, Source)):
        sizes, rates = source.table
        factor = source.factor
        mean = factor.constant if factor.constant is not None else float(np.mean(factor(times)))
        total += float(mean * rates @ weighting.weights(sizes))
    if not 0.0 < total < np.inf:
        raise InputError(
            f"source: the mean inflow from t = 0 to the last output time, {end:g}, is {total:g}, "
            "and a run that begins empty takes its volume from it; it must be finite and above "
            "zero: correct varying, or run to a later time"
        )
    return total


def _beside(processes: Sequence[Process], weighting: Weighting) -> tuple[Any, ...]:
    """Tables of sources, and what is cut off, see `smolux.core.state.Windows`."""
    tables = [p.table for p in processes if isinstance(p, Source)]
    most = max((len(sizes) for sizes, _ in tables), default=0)
    size, share = np.ones((len(tables), most), np.int64), np.ones((len(tables), most))
    inflow = np.zeros(len(tables))
    for k, (sizes, rates) in enumerate(tables):
        simulated = rates * weighting.weights(sizes)
        inflow[k] = simulated.sum()
        size[k, : len(sizes)] = sizes
        share[k, : len(sizes)] = np.cumsum(simulated) / inflow[k]
        share[k, len(sizes) - 1 :] = 1.0
    cut = [(p.above or LIMIT, k) for k, p in enumerate(processes) if isinstance(p, Removal)]
    return inflow, size, share, np.array(min(cut, default=(LIMIT, 0)), np.int64)


def _check_factors(
    processes: Sequence[Process], edges: list[float], bounds: Any, end: float
) -> None:
    problems = []
    times = np.linspace(0.0, end, 1001)
    for k, process in enumerate(processes):
        values = np.asarray(process.factor(times), float)
        wrong = ~(values >= 0)
        if wrong.any():
            t = float(times[wrong.argmax()])
            problems.append(
                f"the rate of {process.name}, {process.factor.text}, is {values[wrong][0]:.6g} "
                f"at t = {t:.6g}, before the end at {end:g}; it must not be negative: end earlier, "
                "or cut it off with max(0, ...)"
            )
        elif not np.isfinite(bounds[:, k]).all():
            t = edges[int(np.argmin(np.isfinite(bounds[:, k])))]
            problems.append(
                f"the rate of {process.name}, {process.factor.text}, has no finite bound near "
                f"t = {t:.6g}; it must stay finite up to the end"
            )
    if problems:
        raise InputError(problems)
