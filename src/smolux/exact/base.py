"""What every exact solution has."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.checks import numbers
from smolux.errors import InputError

Float = NDArray[np.float64]


def check_times(times: ArrayLike) -> Float:
    """Return times as an array of floats.

    Raises
    ------
    InputError
        If one is negative or not a number.
    """
    t = numbers("times", times)
    if not np.all(t >= 0):
        raise InputError(f"times = {times!r}: must be zero or more")
    return t


def check_sizes(sizes: ArrayLike) -> Float:
    """Return sizes as an array of floats that hold whole numbers.

    Raises
    ------
    InputError
        If one is not a whole number of at least 1.
    """
    k = numbers("sizes", sizes)
    if not np.all((k >= 1) & (k == np.floor(k)) & np.isfinite(k)):
        raise InputError(f"sizes = {sizes!r}: must be whole numbers of at least 1")
    return k


@dataclass(frozen=True)
class Solution:
    """The exact solution of the rate equations for monomers of a given density.

    A law is written once, for unit density and a kernel without its prefactor. The rate equations
    keep their form under ``n -> c n``, ``t -> t / (c scale)``, which serves every other case.

    Parameters
    ----------
    density : float
        Monomers per unit volume at time zero: also the mass per unit volume.
    scale : float
        Prefactor of the kernel, volume per time.

    Attributes
    ----------
    name : str
        What is solved.
    formula : str
        The kernel and the processes.
    reference : str
        Where the solution comes from.
    """

    density: float = 1.0
    scale: float = 1.0
    name: ClassVar[str]
    formula: ClassVar[str]
    reference: ClassVar[str]

    def __post_init__(self) -> None:
        problems = [
            f"{key} = {value!r}: must be a positive finite number"
            for key, value in (("density", self.density), ("scale", self.scale))
            if not (np.isfinite(value) and value > 0)
        ]
        problems += self._problems()
        if problems:
            raise InputError(problems)

    def _problems(self) -> list[str]:
        return []

    # What a law provides, for unit density and unit prefactor, at one time.

    def _densities(self, t: float, k: Float) -> Float:
        raise NotImplementedError

    def _moments(self, t: float) -> tuple[float, float, float, float]:
        """Moments of order 0, 1, 2, 3 of the clusters of finite size."""
        raise NotImplementedError

    def _collisions(self, t: float) -> float:
        """Collisions so far per unit volume; each merger takes one cluster away."""
        return 1.0 - self._moments(t)[0]

    def _gel_time(self) -> float:
        return math.inf

    def _halvings(self, end: float) -> list[float]:
        """Return the times before `end` at which M0 has fallen to 1/2, 1/4, 1/8, ..."""
        import scipy.optimize

        def excess(t: float, level: float) -> float:
            return self._moments(t)[0] - level

        times: list[float] = []
        level = 0.5
        while self._moments(end)[0] <= level:
            times.append(scipy.optimize.brentq(excess, 0.0, end, (level,), xtol=1e-300, rtol=1e-14))
            level /= 2
        return times

    # What the user sees.

    def _reduced(self, times: ArrayLike) -> Float:
        return check_times(times) * (self.density * self.scale)

    @property
    def gel_time(self) -> float:
        """When an infinite cluster appears; infinite if none does."""
        return self._gel_time() / (self.density * self.scale)

    def densities(self, times: ArrayLike, sizes: ArrayLike) -> Float:
        """Evaluate the number densities of given sizes.

        Parameters
        ----------
        times : array_like
            Any shape.
        sizes : array_like of int
            Any shape.

        Returns
        -------
        ndarray of shape ``times.shape + sizes.shape``
            Per unit volume; NaN where the law is not known.
        """
        t, k = self._reduced(times), check_sizes(sizes)
        rows = [self._densities(float(x), k.ravel()) for x in t.ravel()]
        return self.density * np.array(rows, float).reshape(t.shape + k.shape)

    def moment(self, times: ArrayLike, order: float, *, gel: bool = False) -> Float:
        """Moment ``M_p = sum_k k**p n_k``.

        Parameters
        ----------
        times : array_like
            Any shape.
        order : float
            The exponent ``p``; known are 0, 1, 2 and 3.
        gel : bool
            Count the infinite cluster too, as a simulation does: the mass is then conserved, and
            the orders above 1 are infinite from the gel time on.

        Returns
        -------
        ndarray of the shape of `times`
            NaN where the moment is not known.
        """
        t = self._reduced(times)
        if order not in (0, 1, 2, 3):
            return np.full(t.shape, np.nan)
        values = np.array([self._moments(float(x))[int(order)] for x in t.ravel()], float)
        values = self.density * values.reshape(t.shape)
        if gel and order == 1:
            return np.full(t.shape, float(self.density))
        if gel and order > 1:
            return np.where(t >= self._gel_time(), np.inf, values)
        return values

    def gel_mass(self, times: ArrayLike) -> Float:
        """Mass per unit volume in the infinite cluster; NaN where it is not known."""
        t = self._reduced(times)
        if np.isinf(self._gel_time()):
            return np.zeros(t.shape)
        return np.where(t <= self._gel_time(), 0.0, self.density - self.moment(times, 1))

    def collisions(self, times: ArrayLike) -> Float:
        """Collisions of two particles so far, per unit volume."""
        t = self._reduced(times)
        values = np.array([self._collisions(float(x)) for x in t.ravel()], float)
        return self.density * values.reshape(t.shape)

    def simulated_collisions(
        self, times: ArrayLike, particles: int, *, doubling: bool = True
    ) -> Float:
        """Return the expected number of collisions in a simulation of many particles.

        With doubling, the volume and all in it are doubled each time half of the particles are
        left, so that later collisions count more.

        Parameters
        ----------
        times : array_like
            Any shape.
        particles : int
            Number at the start.
        doubling : bool
            Whether the volume is doubled, or stays fixed.
        """
        t = self._reduced(times)
        flat = t.ravel()
        reached = np.array([self._collisions(float(x)) for x in flat], float)
        total = reached.copy()
        if doubling and flat.size:
            known = flat[np.isfinite(reached)]
            for h, start in enumerate(self._halvings(float(known.max(initial=0.0)))):
                added = np.maximum(reached - self._collisions(start), 0.0)
                total += 2.0**h * added
        return particles * total.reshape(t.shape)
