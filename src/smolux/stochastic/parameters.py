"""Parameters of processes, as the loop takes them, and their tables that Python fills."""

from __future__ import annotations

from collections.abc import Sequence

from smolux.core.slots import slot_edges
from smolux.core.splits import fill, new_splits, slots_beside
from smolux.core.state import UNARY_BITS, Parameters
from smolux.functions.content import frozen
from smolux.kernels.base import Kernel
from smolux.kernels.constant import Constant
from smolux.processes import Aggregation, Source
from smolux.processes.base import PairProcess, Process, UnaryProcess
from smolux.weighting import Number

from .bounds_cache import bounds_of, timed


def share_laws(pairs: Sequence[PairProcess]) -> list[Kernel]:
    """Return the shares of encounters in which processes take place; none if those are all."""
    laws = [p.shared for p in pairs]
    return [] if all(law is None for law in laws) else [law or Constant() for law in laws]


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
        tuple(law.parameters for law in share_laws(pairs)),
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
