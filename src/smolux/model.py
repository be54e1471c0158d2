"""The physics of a case: kernel, processes, initial condition."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from .errors import InputError
from .initial import Initial, monodisperse
from .kernels.base import Kernel
from .processes import Aggregation
from .processes.base import PairProcess


@dataclass(frozen=True)
class Model:
    """What happens, not how it is computed: frozen, checked once, here and nowhere else.

    Parameters
    ----------
    kernel : Kernel
        The collision rate, see `smolux.kernels`.
    processes : sequence of PairProcess
        What encounters lead to, see `smolux.processes`; aggregation alone if left out.
    initial : Initial
        Sizes at time zero, see `smolux.initial`; monomers of unit density if left out.

    Raises
    ------
    InputError
        With every problem found: wrong types, no process, a process named twice, a kernel that is
        asymmetric, negative or not finite on a sample of sizes.
    """

    kernel: Kernel
    processes: Sequence[PairProcess] = field(default_factory=lambda: (Aggregation(),))
    initial: Initial = field(default_factory=monodisperse)

    def __post_init__(self) -> None:
        problems = []
        if not isinstance(self.kernel, Kernel):
            problems.append(
                f"kernel = {self.kernel!r}: must be a kernel such as smolux.kernels.Ballistic(); "
                "wrap a function K(i, j) with smolux.kernels.from_function(K)"
            )
        processes = _processes(self.processes)
        object.__setattr__(self, "processes", processes)
        if not processes:
            problems.append(
                "processes = []: at least one is needed, such as smolux.processes.Aggregation()"
            )
        problems += [
            f"process {p!r}: must be an instance such as smolux.processes.Shattering(0.01)"
            for p in processes
            if not isinstance(p, PairProcess)
        ]
        names = [p.name for p in processes if isinstance(p, PairProcess)]
        problems += [
            f"process {n!r} is given {names.count(n)} times: give it once"
            for n in set(names)
            if names.count(n) > 1
        ]
        if not isinstance(self.initial, Initial):
            problems.append(
                f"initial = {self.initial!r}: must be an initial condition such as "
                "smolux.initial.monodisperse() or smolux.initial.from_sizes({1: 0.5, 2: 0.5})"
            )
        if not problems:
            problems = self.kernel.problems(self.initial.largest)
        if problems:
            raise InputError(problems)


def _processes(given: Any) -> tuple[Any, ...]:
    """Return what was given as processes, one or several, right or wrong, as a tuple."""
    single = isinstance(given, (PairProcess, str)) or not isinstance(given, Iterable)
    return (given,) if single else tuple(given)
