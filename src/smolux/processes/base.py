"""What every process has: how often it takes place, and what then vanishes and appears."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from smolux.checks import is_number
from smolux.errors import about
from smolux.functions.size import SizeFunction
from smolux.functions.time import TimeFunction
from smolux.kernels.base import Kernel
from smolux.kernels.shared import share_law

from .daughters import Daughters

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Process:
    """Something that changes the population; see `PairProcess`, `UnaryProcess` and `Source`.

    Parameters
    ----------
    label : str, optional
        What it is called in results, if not by its name: so that two of a kind are told apart.

    Attributes
    ----------
    name : str
        The name in case files.
    """

    label: str | None = field(default=None, kw_only=True, repr=False)
    name: ClassVar[str]
    #: order among the processes of a model: pairs, single particles, sources
    kind: ClassVar[int]
    #: whether it takes mass in or out
    opens: ClassVar[bool] = False

    @property
    def called(self) -> str:
        """The name in results and messages: the label, if there is one."""
        return self.name if self.label is None else self.label

    @property
    def entries(self) -> int:
        """The most (size, count) entries that one event writes."""
        return 1

    @property
    def factor(self) -> TimeFunction:
        """A function of time that multiplies the rate."""
        return TimeFunction.of(1.0)


@dataclass(frozen=True)
class PairProcess(Process):
    """What an encounter of two particles leads to, at ``factor(t)`` times the rate of the kernel.

    Both particles vanish; `outcome` names what appears in their place. It does so in the `share`
    of the encounters, which may depend on both sizes; in the others nothing happens.
    """

    share: Any = field(default=1.0, kw_only=True)
    kind: ClassVar[int] = 0

    #: ``outcome(i, j, sizes, counts) -> int``: plain Python that Numba can compile. Writes what
    #: appears into the two int64 arrays and returns the number of entries written.
    outcome: ClassVar[Callable[..., Any]]
    #: whether `outcome` takes ``uniform`` first, and then, after the arrays, what that takes: a
    #: function that returns a random number
    random: ClassVar[bool] = False

    @cached_property
    def shared(self) -> Kernel | None:
        """The share as a law of both sizes, if it is not one for all."""
        if is_number(self.share) and self.share == 1.0:
            return None
        with about("share"):
            return share_law(self.share, f"the share of {self.called}")

    @property
    def parameters(self) -> tuple[Any, ...]:
        """What `outcome` takes last."""
        return ()

    @property
    def daughters(self) -> Daughters:
        """What appears on average: `Merged` or `Debris`, of which the rate equations are made."""
        raise NotImplementedError


@dataclass(frozen=True)
class UnaryProcess(Process):
    """What happens to a particle by itself, at a rate that depends on its size.

    The particle vanishes; `outcome` names what appears.
    """

    kind: ClassVar[int] = 1
    #: the smallest size to which it happens
    least: ClassVar[int] = 1

    #: ``outcome(k, part, sizes, counts) -> int``: as that of a `PairProcess`; `part` is one of both
    #: fragments of a process that `splits`
    outcome: ClassVar[Callable[..., Any]]
    #: whether `law` is that of a pair of fragments, ``F(i, k - i)``
    splits: ClassVar[bool] = False

    @property
    def law(self) -> Callable[..., Any]:
        """``law(k, *parameters)``, the rate, or ``law(i, j, *parameters)`` if it `splits`."""
        raise NotImplementedError

    @property
    def parameters(self) -> tuple[Any, ...]:
        """What `law` takes last."""
        raise NotImplementedError

    @property
    def pairs(self) -> Kernel:
        """The law of a process that `splits`, which is of the same kind as a kernel."""
        raise NotImplementedError

    def split_bounds(
        self, low: Float, high: Float, bounds: Callable[..., tuple[Float, Float]]
    ) -> tuple[Float, Float, Float, Any]:
        """Bounds of the law of a process that `splits`, over ranges of sizes of one octave.

        The bins of splits are those of `smolux.core.splits.stretch`; `bounds` are the bounds of
        `pairs`, however they are found.

        Returns
        -------
        bounds : ndarray of shape (ranges, bins)
            Upper bounds.
        widths : ndarray of shape (ranges, bins)
            Splits of the largest size.
        means : ndarray of shape (ranges, bins)
            Rough mean of the law for the smallest size, to tell whether the bounds are far off.
        proved : ndarray of bool of shape (ranges,)
            Whether the bounds are.
        """
        raise NotImplementedError

    @property
    def daughters(self) -> Daughters:
        """What appears on average: `Nothing`, `Detached` or `Split`."""
        raise NotImplementedError

    def rates(self, sizes: Float) -> Float:
        """Rate of a particle of each of the given sizes, unless it `splits`."""
        raise NotImplementedError


class Varying:
    """What processes with a field ``varying`` have in common: it multiplies the rate."""

    name: ClassVar[str]
    varying: Any

    @property
    def factor(self) -> TimeFunction:
        """See `Process.factor`."""
        with about("varying"):
            return TimeFunction.of(self.varying, f"{self.name}: varying")


class RatedBySize(Varying):
    """What processes of single particles with a ``rate`` by size have in common, beside that."""

    rate: Any

    @cached_property
    def of_size(self) -> SizeFunction:
        """The rate as a function of the size."""
        with about("rate"):
            return SizeFunction.of(self.rate, f"the {self.name} rate")

    @property
    def law(self) -> Callable[..., Any]:
        """See `UnaryProcess.law`."""
        return self.of_size.rate

    @property
    def parameters(self) -> tuple[Any, ...]:
        """See `UnaryProcess.parameters`."""
        return self.of_size.arguments


def factors_of(process: Process, kernel: Kernel | None) -> list[TimeFunction]:
    """Return what multiplies the rate of a process in time: for each term of a kernel that varies.

    The first is that of the process alone where nothing else does.
    """
    terms = kernel.in_time if kernel is not None and isinstance(process, PairProcess) else ()
    return [process.factor * factor for factor, _ in terms] or [process.factor]


def text_of(process: Process, kernel: Kernel) -> str:
    """Return what multiplies the rate of a process in time, for messages."""
    return " and ".join(factor.text for factor in factors_of(process, kernel))
