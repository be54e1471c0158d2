"""The physics of a case: kernel, processes, initial condition."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from .attributes import Attribute, Composition
from .errors import InputError, Problem, did_you_mean
from .initial import Initial, monodisperse
from .kernels.base import Kernel
from .kernels.constant import Constant
from .kernels.shared import Shared
from .processes import Aggregation, Removal, Source
from .processes.base import PairProcess, Process


@dataclass(frozen=True)
class Model:
    """What happens, not how it is computed: frozen, checked once, here and nowhere else.

    Parameters
    ----------
    kernel : Kernel
        The collision rate, see `smolux.kernels`; ``kernels.Constant(0)`` if nothing collides.
    processes : sequence of Process
        What happens to pairs, to single particles, and from outside, see `smolux.processes`;
        aggregation alone if left out. They are kept in this order. Of two of a kind at least one
        has a label: ``Removal(0.1), Removal("0.1/k", label="wall")``.
    initial : Initial
        Sizes at time zero, see `smolux.initial`; monomers of unit density if left out.
    attributes : sequence of Attribute
        What particles carry beside their size, see `smolux.attributes`; nothing if left out.

    Raises
    ------
    InputError
        With every problem found: wrong types, no process, two processes that are called the same,
        a kernel that is asymmetric, negative or not finite on a sample of sizes.
    """

    kernel: Kernel
    processes: Sequence[Process] = field(default_factory=lambda: (Aggregation(),))
    initial: Initial = field(default_factory=monodisperse)
    attributes: Sequence[Attribute] = ()

    def __post_init__(self) -> None:
        problems = []
        attributes = _several(self.attributes, (Attribute, str))
        object.__setattr__(self, "attributes", attributes)
        if not isinstance(self.kernel, Kernel):
            problems.append(
                f"kernel = {self.kernel!r}: must be a kernel such as smolux.kernels.Ballistic(); "
                "wrap a function K(i, j) with smolux.kernels.from_function(K)"
            )
        processes = _several(self.processes, (Process, str))
        if all(isinstance(p, Process) for p in processes):
            processes = tuple(sorted(processes, key=lambda process: process.kind))
        object.__setattr__(self, "processes", processes)
        if not processes:
            problems.append(
                "processes = []: at least one is needed, such as smolux.processes.Aggregation()"
            )
        problems += [
            f"process {p!r}: must be an instance such as smolux.processes.Shattering(0.01)"
            for p in processes
            if not isinstance(p, Process)
        ]
        names = [p.called for p in processes if isinstance(p, Process)]
        problems += _label_problems([p for p in processes if isinstance(p, Process)])
        if not isinstance(self.initial, Initial):
            problems.append(
                f"initial = {self.initial!r}: must be an initial condition such as "
                "smolux.initial.monodisperse() or smolux.initial.from_sizes({1: 0.5, 2: 0.5})"
            )
        problems += _attribute_problems(attributes, processes)
        if not problems:
            problems = _open_problems(processes, self.initial)
        if not problems:
            found = self.kernel.problems(self.initial.largest)
            problems = [Problem.at(text, "kernel", "formula") for text in found]
        alone = any(not isinstance(p, PairProcess) for p in processes)
        if not problems and self.kernel.vanishes and not alone:
            problems = [
                f"kernel {self.kernel.label}: is zero: nothing would ever happen, as "
                f"{' and '.join(names)} take two particles: give a rate above zero, or processes "
                "of single particles"
            ]
        if problems:
            raise InputError(problems)
        _ = self.reduced

    @cached_property
    def reduced(self) -> Model:
        """The same law, with the share of the only process of pairs as a part of the kernel."""
        pairs = [p for p in self.processes if isinstance(p, PairProcess)]
        if len(pairs) != 1 or pairs[0].shared is None:
            return self
        share, kernel = pairs[0].shared, self.kernel
        number = share.scale if isinstance(share, Constant) else 0.0
        product = number * kernel if number > 0.0 else Shared(kernel, share)
        whole = tuple(replace(p, share=1.0) if p is pairs[0] else p for p in self.processes)
        return Model(product, whole, self.initial, self.attributes)

    @property
    def varying(self) -> tuple[str, ...]:
        """What has a rate that depends on time: processes, and the kernel."""
        processes = tuple(
            f"process {p.called!r}" for p in self.processes if p.factor.constant is None
        )
        return (*processes, f"kernel {self.kernel.label}") if self.kernel.in_time else processes

    @property
    def only_aggregates(self) -> bool:
        """Whether nothing but aggregation takes place, at whatever rate."""
        return all(isinstance(process, Aggregation) for process in self.processes)

    @property
    def plain_aggregation(self) -> bool:
        """Whether aggregation alone takes place, at the rate of the kernel at all times."""
        factors = [process.factor.constant for process in self.processes]
        pairs = [process for process in self.processes if isinstance(process, PairProcess)]
        # several of them have their rates together
        whole = sum(np.nan if f is None else f for f in factors) == 1.0
        same = not self.kernel.in_time and all(p.shared is None for p in pairs)
        return self.only_aggregates and whole and same

    @property
    def open(self) -> bool:
        """Whether mass comes in or leaves."""
        return any(process.opens for process in self.processes)

    @property
    def cut(self) -> int | None:
        """The size above which particles leave at once, if there is one."""
        limits = [p.above for p in self.processes if isinstance(p, Removal) and p.above is not None]
        return min(limits, default=None)


def _label_problems(processes: Sequence[Process]) -> list[str]:
    """Return what is wrong with the labels by which processes are told apart in results."""
    problems = [
        f"{p.name}: label = {p.label!r}: must be a text such as 'wall'"
        for p in processes
        if p.label is not None and not (isinstance(p.label, str) and p.label.strip())
    ]
    if problems:
        return problems
    names = [p.called for p in processes]
    for name in sorted({n for n in names if names.count(n) > 1}):
        kind = next(type(p).__name__ for p in processes if p.called == name)
        problems.append(
            f"process {name!r} is given {names.count(name)} times: tell them apart by labels, by "
            f'which they go in results, as in {kind}(..., label="{name} 2")'
        )
    return problems


def _open_problems(processes: Sequence[Process], initial: Initial) -> list[str]:
    """Return what is wrong with the ways into the system and out of it."""
    problems = []
    sources = [p for p in processes if isinstance(p, Source)]
    if not initial.total > 0.0 and not sources:
        problems.append(
            "initial = empty(): nothing would ever happen: give a source, such as "
            "smolux.processes.Source(1.0), or an initial condition"
        )
    for removal in (p for p in processes if isinstance(p, Removal)):
        largest = max([initial.largest, *(int(s.table[0][-1]) for s in sources)])
        if removal.above is not None and largest > removal.above:
            problems.append(
                f"removal: above = {removal.above}: sizes reach {largest} at the start or from a "
                "source; they would leave at once: raise it, or begin with smaller sizes"
            )
    return problems


def _attribute_problems(attributes: Sequence[Any], processes: Sequence[Any]) -> list[str]:
    """Return what is wrong with what particles carry."""
    problems = [
        f"attribute {a!r}: must be an instance such as "
        'smolux.attributes.Composition({"soot": 0.4, "sulphate": 0.6})'
        for a in attributes
        if not isinstance(a, Attribute)
    ]
    if len(attributes) > 1 and not problems:
        problems.append("attributes: particles carry one composition: put all kinds into it")
    sources = [p.called for p in processes if isinstance(p, Source)]
    for composition in (a for a in attributes if isinstance(a, Composition)):
        problems += [
            Problem.at(
                f"composition: sources: {name!r} is no source{did_you_mean(name, sources)}",
                "attributes", "sources", name,
            )
            for name in composition.sources
            if name not in sources
        ]  # fmt: skip
    return problems


def _several(given: Any, one: tuple[type, ...]) -> tuple[Any, ...]:
    """Return what was given, one or several, right or wrong, as a tuple."""
    single = isinstance(given, one) or not isinstance(given, Iterable)
    return (given,) if single else tuple(given)
