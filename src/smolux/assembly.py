"""From a model and a method to one compiled loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from .core.compile import digest, piece, user_piece
from .core.loop import make_loop, tally_one
from .core.state import Windows
from .core.weights import make_outcome, make_rate, make_tally, make_weight
from .errors import InputError
from .methods.base import Method, Rates
from .model import Model
from .processes.base import PairProcess
from .timefunction import TimeFunction
from .weighting.base import Weighting

#: windows of time for bounds of a factor that varies: pieces of each octave, first octave
_PIECES = 4
_FIRST_OCTAVE = -20


def _as_float(rate: Callable[..., Any]) -> Any:
    inner = user_piece(rate)

    @piece
    def value(i, j, *p):
        return float(inner(i, j, *p))

    return value


def _outcomes(functions: Sequence[Callable[..., Any]]) -> Any:
    """Bind the outcomes into one function of the number of the process."""
    first = piece(functions[0])
    if len(functions) == 1:

        @piece
        def last(r, i, j, s, p, q):
            return first(i, j, s.sizes, s.counts), 3

        return last
    others = _outcomes(functions[1:])

    @piece
    def outcome(r, i, j, s, p, q):
        if r == 0:
            return first(i, j, s.sizes, s.counts), 3
        return others(r - 1, i, j, s, p, q)

    return outcome


def _factors(functions: Sequence[Callable[..., Any]]) -> Any:
    """Bind the factors into one; `q` holds a tuple of parameters for each."""
    first = user_piece(functions[0])
    if len(functions) == 1:

        @piece
        def last(r, t, q):
            return float(first(t, *q[0]))

        return last
    others = _factors(functions[1:])

    @piece
    def factor(r, t, q):
        if r == 0:
            return float(first(t, *q[0]))
        return others(r - 1, t, q[1:])

    return factor


_loops: dict[tuple[Any, ...], Any] = {}


def loop_for(model: Model, method: Method, weighting: Weighting) -> Any:
    """Return the compiled loop, the same object for the same physics and method.

    The settings of a method are data of its work arrays, those of a weighting parameters.
    """
    rate, own = model.kernel.rate, len(model.kernel.parameters)
    outcomes = [type(process).outcome for process in model.processes]
    factors = [process.factor.rate for process in model.processes]
    weighted = [f for f in (weighting.weight, weighting.factor) if f is not None]
    key = (type(method), own, len(weighted), *map(digest, (rate, *outcomes, *factors, *weighted)))
    if key not in _loops:
        simulated, outcome, tally = _as_float(rate), _outcomes(outcomes), tally_one
        if weighting.weight is not None:
            weight = make_weight(weighting.weight, own)
            simulated = make_rate(simulated, weighting.weight, weighting.factor, own)
            outcome, tally = make_outcome(outcome, weight), make_tally(weight)
        pieces = method.bind(simulated, tally)
        _loops[key] = make_loop(pieces, outcome, _factors(factors), weighting.weight is not None)
    return _loops[key]


def rates_for(model: Model, weighting: Weighting) -> Rates:
    """Return what a method needs to know of the simulated rate."""
    kernel = model.kernel
    weighted = weighting.weight is not None
    return Rates(
        (*kernel.parameters, *weighting.parameters),
        weighting.arrays(kernel),
        weighting.bounds(kernel),
        kernel.cheap and weighting.cheap,
        kernel.rigorous and weighting.rigorous,
        weighting.majorant(kernel),
        kernel if weighted else None,
        weighting.weights if weighted else None,
    )


def factor_parameters(processes: Sequence[PairProcess]) -> tuple[tuple[float, ...], ...]:
    """Return the parameters of the rate factors, as the loop takes them."""
    return tuple(process.factor.parameters for process in processes)


def _edges(end: float) -> list[float]:
    octaves = range(_FIRST_OCTAVE, int(np.ceil(np.log2(max(end, 2.0**_FIRST_OCTAVE)))) + 1)
    edges = [0.0] + [2.0**k * (1 + m / _PIECES) for k in octaves for m in range(_PIECES)]
    return [e for e in edges if e < end] + [next(e for e in edges if e >= end)]


@lru_cache(maxsize=32)
def _bounds(factor: TimeFunction, end: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    edges = _edges(end)
    pairs = [factor.bounds(a, b) for a, b in pairwise(edges)]
    return tuple(edges), tuple(upper for _, upper in pairs)


def windows_for(processes: Sequence[PairProcess], end: float) -> Windows:
    """Bound the rate factors over windows of time that depend on the factors alone.

    A factor that does not vary needs one window without end. Others have four windows an octave of
    time, whatever the output times are, so that a trajectory does not depend on these.

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
        edges = [*_edges(end), np.inf]
        columns = [[*_bounds(f, end)[1], 0.0] for f in factors]
        bounds = [list(row) for row in zip(*columns, strict=True)]
        _check_factors(processes, edges, np.array(bounds), end)
    array = np.array(bounds, float)
    return Windows(np.array(edges), array, array.sum(axis=1))


def _check_factors(
    processes: Sequence[PairProcess], edges: list[float], bounds: Any, end: float
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
