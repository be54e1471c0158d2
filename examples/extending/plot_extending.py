"""
A kernel, a process and an initial condition of your own
========================================================

Where a function or a formula is not enough, a law is a class, as those of the package are, in any
file. Here: drops of liquid that meet by turbulence in the inertial range, shed dimers, and have any
size up to a largest one at the start. Methods, weightings and the rate equations need no more.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

import smolux as sx
from smolux.initial import Initial
from smolux.kernels import Kernel
from smolux.processes import UnaryProcess
from smolux.processes.daughters import Detached


# %%
# **A kernel** is a frozen dataclass; its fields are what `rate` takes after the two sizes. Its
# bounds are found from the rate.
def turbulent(i, j, scale):
    """Inertial subrange: the seven thirds power of the distance."""
    return scale * (np.cbrt(i) + np.cbrt(j)) ** (7 / 3)


@dataclass(frozen=True)
class Turbulent(Kernel):
    """Drops in turbulence, farther apart than the smallest eddies."""

    scale: float = 1.0
    name: ClassVar[str] = "turbulent"
    formula: ClassVar[str] = "scale * (cbrt(i) + cbrt(j))**(7/3)"
    rate = staticmethod(turbulent)


# %%
# **A process** says what appears: in one event (`outcome`, which is compiled), and on average
# (`daughters`), of which the rate equations are made.
def shed(k, part, sizes, counts):
    """Write ``(k) -> (k - 2) + (2)`` into the arrays; return the number of entries."""
    sizes[0], counts[0] = 2, 2 if k == 4 else 1
    if k == 4:
        return 1
    sizes[1], counts[1] = k - 2, 1
    return 2


def by_surface(k, rate):
    """Rate of a particle of size k."""
    return rate * np.cbrt(k * k)


@dataclass(frozen=True)
class Shedding(UnaryProcess):
    """Particles of three units or more lose two of them, in proportion to their surface."""

    rate: float
    name: ClassVar[str] = "shedding"
    least: ClassVar[int] = 3
    entries: ClassVar[int] = 2
    law: ClassVar = staticmethod(by_surface)
    outcome: ClassVar = staticmethod(shed)
    daughters: ClassVar[Detached] = Detached(2)

    @property
    def parameters(self):
        """What the law takes last."""
        return (self.rate,)

    def rates(self, sizes):
        """Rates of many sizes."""
        return by_surface(sizes, self.rate)


# %%
# **An initial condition** has a number density, and a law of sizes with its inverse.
@dataclass(frozen=True)
class Uniform(Initial):
    """All sizes up to a largest one alike."""

    most: int
    density: float = 1.0
    name: ClassVar[str] = "uniform"

    @property
    def total(self):
        """Particles for each unit of volume."""
        return self.density

    def cumulative(self, sizes):
        """Share of the particles that are no larger."""
        return np.clip(np.floor(sizes) / self.most, 0.0, 1.0)

    def quantile(self, share):
        """Return the size below or at which a share of the particles lies."""
        return np.maximum(np.ceil(np.asarray(share) * self.most), 1).astype(np.int64)


# %%
# Simulation and rate equations know nothing of each other's way to the result.
if __name__ == "__main__":
    model = sx.Model(Turbulent(0.1), [sx.processes.Aggregation(), Shedding(0.05)], Uniform(6, 0.5))
    times = np.linspace(0.5, 6, 12)
    simulated = sx.simulate(model, times, particles=50_000, seed=1)
    solved = sx.solve(model, times)
    sx.plot.save(sx.plot.moments(simulated, reference=solved), "extending.png")
    print(sx.analysis.compare(simulated, solved).verdict)
