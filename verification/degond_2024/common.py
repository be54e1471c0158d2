"""Systems and methods of the paper, its targets, and one run of them."""

from __future__ import annotations

import time
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray

import smolux.spatial as sp
from smolux.plotting.style import MARKERS, PALETTE
from smolux.spatial.methods.base import SpatialMethod
from smolux.spatial.results.trace import Trace
from verification.outcome import normal_sigmas

TARGETS = Path(__file__).parent / "targets"
#: volume fractions; those of the paper are not legible in the text that we have
FRACTIONS = (0.05, 0.1, 0.2, 0.3, 0.5)
#: numbers of discs: squares, for the lattice
SIZES = (100, 400, 900, 2500, 10_000)
EVENTS = "events"
#: way of the fastest cluster in a step, in radii, from the longest on
STEPS = (0.5, 0.2)
METHODS = (EVENTS, *(f"steps {f:g}" for f in STEPS))
LABEL = {EVENTS: "event-driven"} | {f"steps {f:g}": rf"steps of ${f:g}\,R$" for f in STEPS}
#: in tables
NAME = {EVENTS: "event-driven"} | {f"steps {f:g}": f"steps {f:g} R" for f in STEPS}
#: colour and marker of each volume fraction
LOOK = {f: {"color": c, "marker": m} for f, c, m in zip(FRACTIONS, PALETTE, MARKERS, strict=False)}
COLOUR = dict(zip(METHODS, ("#000000", PALETTE[1], PALETTE[0]), strict=True))


def method_of(name: str) -> SpatialMethod:
    """Return the method of a name in `METHODS`."""
    if name == EVENTS:
        return sp.Windowed()
    # as in the paper: new links begin without a multiplier
    return sp.TimeStepping(step=float(name.split()[1]), new_links="slack")


@dataclass(frozen=True)
class Finished:
    """A run that came to its goal.

    Attributes
    ----------
    system : smolux.spatial.System
    trace : Trace
    seconds : float
        Of the processor, set-up included and compilation left out.
    """

    system: sp.System
    trace: Trace
    seconds: float

    @property
    def snapshot(self) -> sp.Snapshot:
        """The discs at the end."""
        s, t = self.system, self.trace
        return sp.Snapshot(t.position, s.radius, s.box, t.cluster, s.mass)

    @property
    def merges(self) -> NDArray[np.float64]:
        """Times of the merges."""
        return self.trace.log.time[self.trace.log.merges]


def run(method: SpatialMethod, system: sp.System, clusters: int = 1) -> Finished:
    """Run to so few clusters, without making a dataset of it.

    Raises
    ------
    RuntimeError
        If the run stopped before.
    """
    begun = time.process_time()
    moving = method.start(system, np.empty(0))
    while (code := moving.advance(np.inf, clusters, 1 << 16)) is None:
        pass
    seconds = time.process_time() - begun
    if code:
        raise RuntimeError(f"{method!r}, {len(system)} discs: {code}")
    return Finished(system, moving.trace(), seconds)


def compiled(methods: Sequence[SpatialMethod]) -> None:
    """Have the loops ready, so that seconds hold no compilation."""
    for method in methods:
        run(method, sp.lattice(16, 0.1, seed=1))


def target(name: str) -> dict[str, Any]:
    """Read a table of targets: the file, with its rows as dictionaries."""
    data = tomllib.loads((TARGETS / f"{name}.toml").read_text())
    data["rows"] = [dict(zip(data["columns"], row, strict=True)) for row in data["rows"]]
    return data


def mean_and_error(values: ArrayLike) -> tuple[float, float]:
    """Mean over runs and its standard error."""
    x = np.asarray(values, float)
    return float(x.mean()), float(x.std(ddof=1) / np.sqrt(len(x)))


def spread(values: ArrayLike, digits: int = 3) -> str:
    """Mean and standard deviation over runs, as text."""
    x = np.asarray(values, float)
    return f"{x.mean():.{digits}f} ± {x.std(ddof=1):.{digits}f}"


def against_known(values: ArrayLike, known: float, runs: int, rounding: float) -> float:
    """Deviation of a mean from one of so many other runs with the same scatter, in sigmas.

    What is within the rounding of the known number is no deviation.
    """
    x = np.asarray(values, float)
    error = x.std(ddof=1) * np.sqrt(1 / len(x) + 1 / runs)
    away = max(abs(float(x.mean()) - known) - rounding, 0.0)
    return float(normal_sigmas(away / error, len(x)))


def difference(a: ArrayLike, b: ArrayLike) -> float:
    """Difference of two means in sigmas, by Welch's law converted to the normal one."""
    x, y = np.asarray(a, float), np.asarray(b, float)
    u, v = x.var(ddof=1) / len(x), y.var(ddof=1) / len(y)
    free = (u + v) ** 2 / (u**2 / (len(x) - 1) + v**2 / (len(y) - 1))
    return float(normal_sigmas((x.mean() - y.mean()) / np.sqrt(u + v), free + 1))


def rayleigh(angles: ArrayLike, fold: int) -> tuple[float, float]:
    """Mean resultant of angles taken so many times, and what it is by chance (95 %)."""
    x = np.asarray(angles, float)
    return float(abs(np.exp(1j * fold * x).mean())), float(np.sqrt(-np.log(0.05) / len(x)))


def draw_over_sizes(
    ax: Axes, values: Callable[[float, int], Any], fractions: Sequence[float], sizes: Sequence[int]
) -> None:
    """Draw means over the number of discs with standard deviations, a line for each fraction."""
    for k, fraction in enumerate(fractions):
        # beside each other, so that bars can be told apart
        x = np.array(sizes) * 1.07 ** (k - (len(fractions) - 1) / 2)
        runs = [np.asarray(values(fraction, n), float) for n in sizes]
        ax.errorbar(
            x, [r.mean() for r in runs], [r.std(ddof=1) for r in runs], **LOOK[fraction],
            label=rf"$\phi = {fraction:g}$", lw=0.8, elinewidth=0.6, ms=3,
        )  # fmt: skip
    ax.set_xlabel("discs $N$")
