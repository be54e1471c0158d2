"""From a model and a method to one compiled loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from smolux.core import superposition
from smolux.core.burst import make_burst
from smolux.core.fire import make_encounters, make_fire
from smolux.core.loop import make_advance, make_loop, make_next_event
from smolux.core.record import tally_one
from smolux.core.unary import Unary, bind_outcomes, bind_rates, make_ledger, make_unary
from smolux.core.weights import (
    make_outcome,
    make_rate,
    make_replacement,
    make_stands,
    make_tally,
    make_weight,
)
from smolux.functions.content import digest, is_frozen
from smolux.jit.compile import why_not
from smolux.methods.base import Method
from smolux.model import Model
from smolux.processes import Aggregation, Source
from smolux.processes.base import PairProcess, Process, UnaryProcess
from smolux.weighting.base import Weighting

from .dispatch import as_float, choice, factors, mixture_of, outcomes, share_of
from .parameters import share_laws


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
    functions += [law.rate for law in share_laws(pairs)]
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
    outcome, factor = outcomes(tuple(map(type, present))), factors(_rates(present))
    simulated, tally, weight = as_float(model.kernel.rate), tally_one, None
    if weighting.weight is not None:
        weight = make_weight(weighting.weight, own)
        simulated = make_rate(simulated, weighting.weight, weighting.rate_ratio, own)
        outcome, tally = make_outcome(outcome, weight), make_tally(weight)
    pieces = method.bind(simulated, tally)
    random = weight is not None or any(type(p).random for p in pairs)
    shares = tuple(law.rate for law in share_laws(pairs))
    share = choice(shares, share_of) if shares else None
    terms = tuple((f.rate, law.rate) for f, law in model.kernel.in_time)
    mixture = mixture_of(terms) if terms else None
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
    choose = superposition.make_choice(factors(_rates(unary)), factors(_rates(sources)), *shape)
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
