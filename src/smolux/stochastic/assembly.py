"""From a model and a method to one compiled loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

from smolux.core import rng, superposition
from smolux.core.burst import make_burst
from smolux.core.fire import make_encounters, make_fire
from smolux.core.loop import make_advance, make_loop, make_next_event
from smolux.core.record import tally_one
from smolux.core.slots import slot_edges
from smolux.core.splits import fill, new_splits, slots_beside
from smolux.core.state import BOTH, UNARY_BITS, Parameters
from smolux.core.unary import Unary, bind_outcomes, bind_rates, make_ledger, make_unary
from smolux.core.weights import (
    make_outcome,
    make_rate,
    make_replacement,
    make_stands,
    make_tally,
    make_weight,
)
from smolux.functions.content import digest, frozen, is_frozen
from smolux.jit.compile import piece, user_piece, why_not
from smolux.kernels.base import Kernel
from smolux.kernels.constant import Constant
from smolux.methods.base import Method, Rates
from smolux.model import Model
from smolux.processes import Aggregation, Source
from smolux.processes.base import PairProcess, Process, UnaryProcess
from smolux.weighting import Number
from smolux.weighting.base import Weighting

from .remembered import bounds_of, timed
from .tables import evaluated, latest


@lru_cache(maxsize=64)
def _as_float(rate: Callable[..., Any]) -> Any:
    inner = user_piece(rate)

    @piece
    def value(i, j, *p):
        return float(inner(i, j, *p))

    return value


@lru_cache(maxsize=64)
def _one_of(rates: tuple[Callable[..., Any], ...], compiled: Callable[..., Any]) -> Any:
    """Bind functions into one of their number, of `x` and a tuple of the q of each.

    Each is ``compiled(rate)(x, *q)``.
    """
    first = compiled(rates[0])
    if len(rates) == 1:

        @piece
        def last(r, x, q):
            return float(first(x, *q[0]))

        return last
    others = _one_of(rates[1:], compiled)

    @piece
    def one_of(r, x, q):
        if r == 0:
            return float(first(x, *q[0]))
        return others(r - 1, x, q[1:])

    return one_of


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
        return found(r, i, j, s, q.outcomes), BOTH

    return outcome


def _factors(rates: tuple[Callable[..., Any], ...]) -> Any:
    """Bind the factors into one; `q` holds a tuple of parameters for each; 0 without any."""
    if rates:
        return _one_of(rates, user_piece)
    return _nothing


@piece
def _nothing(r, t, q):
    return 0.0


@lru_cache(maxsize=64)
def _share(rate: Callable[..., Any]) -> Any:
    inner = user_piece(rate)

    @piece
    def share(pair, *q):
        return inner(float(pair[0]), float(pair[1]), *q)

    return share


@lru_cache(maxsize=64)
def _mixture(terms: tuple[tuple[Callable[..., Any], Callable[..., Any]], ...]) -> Any:
    """Bind what a kernel that varies is at a time, as a multiple of what it is without factors.

    Of each term the factor and the rate are given, and `q` holds a tuple of parameters for each of
    both.
    """
    if len(terms) == 1:
        factor = user_piece(terms[0][0])

        @piece
        def common(i, j, t, q):
            return float(factor(t, *q[0][0]))

        return common
    added = _added(terms)

    @piece
    def mixture(i, j, t, q):
        varied, whole = added(float(i), float(j), t, q)
        return varied / whole if whole > 0.0 else 0.0

    return mixture


@lru_cache(maxsize=64)
def _added(terms: tuple[tuple[Callable[..., Any], Callable[..., Any]], ...]) -> Any:
    """Bind the sums of terms, with and without the factor of each."""
    factor, rate = user_piece(terms[0][0]), _as_float(terms[0][1])
    if len(terms) == 1:

        @piece
        def last(i, j, t, q):
            value = rate(i, j, *q[0][1])
            return factor(t, *q[0][0]) * value, value

        return last
    others = _added(terms[1:])

    @piece
    def added(i, j, t, q):
        value = rate(i, j, *q[0][1])
        varied, whole = others(i, j, t, q[1:])
        return factor(t, *q[0][0]) * value + varied, value + whole

    return added


def _share_laws(pairs: Sequence[PairProcess]) -> list[Kernel]:
    """Return the shares of encounters in which processes take place; none if those are all."""
    laws = [p.shared for p in pairs]
    return [] if all(law is None for law in laws) else [law or Constant() for law in laws]


def _rates(processes: Sequence[Process]) -> tuple[Callable[..., Any], ...]:
    return tuple(process.factor.rate for process in processes)


_loops: dict[tuple[Any, ...], Any] = {}


def _kinds(model: Model) -> tuple[list[PairProcess], list[UnaryProcess], list[Source]]:
    """Return the processes by their kind."""
    pairs = [p for p in model.processes if isinstance(p, PairProcess)]
    unary = [p for p in model.processes if isinstance(p, UnaryProcess)]
    return pairs, unary, [p for p in model.processes if isinstance(p, Source)]


def _key(model: Model, method: Method, weighting: Weighting) -> tuple[Any, ...]:
    pairs, unary, sources = _kinds(model)
    weighted = [f for f in (weighting.weight, weighting.rate_ratio) if f is not None]
    functions = [model.kernel.rate, *weighted]
    functions += [type(p).outcome for p in pairs] + [type(p).outcome for p in unary]
    functions += [p.law for p in unary]
    functions += [p.factor.rate for p in model.processes]
    functions += [law.rate for law in _share_laws(pairs)]
    functions += [law.rate for term in model.kernel.in_time for law in term]
    shape = len(model.kernel.parameters), len(weighted), len(pairs), len(unary), len(sources)
    kinds = type(method), len(model.kernel.in_time), *((type(p), p.splits) for p in unary)
    return (*kinds, *shape, *map(digest, functions))


def uncompilable(model: Model, weighting: Weighting) -> list[str]:
    """Say which functions of the user Numba cannot compile, and what to do."""
    _, unary, _ = _kinds(model)
    given: list[tuple[str, Callable[..., Any], int]] = [
        *((f"the kernel {k.label}", k.rate, 2 + len(k.parameters)) for _, k in model.kernel.parts),
        *(
            (f"the factor of the kernel in time, {f.text}", f.rate, 1 + len(f.arguments))
            for f, _ in model.kernel.in_time
        ),
        *((f"the rate of {p.called}", p.law, 2 if p.splits else 1) for p in unary),
        *((f"the rate of {p.called} in time", p.factor.rate, 1) for p in model.processes),
        *(
            (f"the share of {p.called}", p.shared.rate, 2 + len(p.shared.parameters))
            for p in model.processes
            if isinstance(p, PairProcess) and p.shared is not None
        ),
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
    pairs, unary, sources = _kinds(model)
    own = len(model.kernel.parameters)
    present = pairs or [Aggregation()]
    outcome, factor = _outcomes(tuple(map(type, present))), _factors(_rates(present))
    simulated, tally, weight = _as_float(model.kernel.rate), tally_one, None
    if weighting.weight is not None:
        weight = make_weight(weighting.weight, own)
        simulated = make_rate(simulated, weighting.weight, weighting.rate_ratio, own)
        outcome, tally = make_outcome(outcome, weight), make_tally(weight)
    pieces = method.bind(simulated, tally)
    random = weight is not None or any(type(p).random for p in pairs)
    shares = tuple(law.rate for law in _share_laws(pairs))
    share = _one_of(shares, _share) if shares else None
    terms = tuple((f.rate, law.rate) for f, law in model.kernel.in_time)
    mixture = _mixture(terms) if terms else None
    encounters = make_encounters(pieces.pair, outcome, factor, len(pairs), share, mixture)
    if not unary and not sources:
        fire = make_fire(encounters, pieces.update, random)
        burst = None
        if pieces.burst is not None and share is None and mixture is None:
            burst = make_burst(pieces.burst, outcome, len(pairs), random)
        next_event = make_next_event(pieces.draw, burst)
        return make_loop(make_advance(pieces, next_event, fire), pieces.view)
    about = [Unary(p.law, type(p).outcome, p.least, p.splits, p.opens) for p in unary]
    shape = len(pairs), len(unary), len(sources)
    rates = bind_rates(about)
    ledger = make_ledger(rates, lambda tally: method.bind(simulated, tally).visit, shape[1])
    draw_unary = make_unary(pieces.pick, rates, shape[0], shape[1])
    choose = superposition.make_choice(_factors(_rates(unary)), _factors(_rates(sources)), *shape)
    stands = make_stands(weight)
    kinds = superposition.make_kinds(
        encounters, bind_outcomes(about), choose, stands, make_replacement(weight), *shape[:2]
    )
    books = superposition.make_books(stands, ledger, rates.known, shape[1])
    fire = make_fire(kinds, pieces.update, True, books)
    next_event = superposition.make_next_event(
        pieces.draw, ledger.ready, draw_unary, pieces.select, *shape
    )
    return make_loop(make_advance(pieces, next_event, fire), pieces.view)


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


def factor_parameters(processes: Sequence[Process], kernel: Kernel | None = None) -> Parameters:
    """Return the parameters of the processes, as the loop takes them, with tables to be filled.

    And those of the terms of a kernel that varies.
    """
    terms = () if kernel is None else kernel.in_time
    mixture = tuple((factor.parameters, law.parameters) for factor, law in terms)
    pairs = [p for p in processes if isinstance(p, PairProcess)]
    unary = [p for p in processes if isinstance(p, UnaryProcess)]
    return Parameters(
        (*(p.factor.parameters for p in pairs or [Aggregation()]), *((mixture,) if terms else ())),
        tuple(p.parameters for p in pairs or [Aggregation()]),
        tuple(law.parameters for law in _share_laws(pairs)),
        tuple(
            (p.parameters, new_splits(frozen(p.pairs).rigorous)) if p.splits else (p.parameters,)
            for p in unary
        ),
        tuple(p.factor.parameters for p in unary),
        tuple(p.factor.parameters for p in processes if isinstance(p, Source)),
    )


@timed
def bound_splits(processes: Sequence[Process], parameters: Parameters, size: int) -> None:
    """Bound the splits of the octave of a size, for which the loop returned `SPLITS`."""
    slots, edges = slots_beside(size), slot_edges(UNARY_BITS).astype(float)
    low, high = edges[slots], edges[1:][slots] - 1.0
    unary = [p for p in processes if isinstance(p, UnaryProcess)]
    for process, own in zip(unary, parameters.unary, strict=True):
        if process.splits:
            bounds = bounds_of(frozen(process.pairs), Number())
            fill(own[1], slots, *process.split_bounds(low, high, bounds))
