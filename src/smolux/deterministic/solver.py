"""The deterministic entry point: checks the arguments, steps to the output times, observes."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..content import frozen
from ..errors import InputError, Interrupted
from ..model import Model
from ..results import to_dataset, told
from .arguments import DIRECT_LIMIT, Settings, check
from .equations import Equations
from .integrate import Integrator
from .observe import Observer, Snapshot
from .operator import OperatorFactory
from .window import Window

if TYPE_CHECKING:
    import xarray as xr

    from ..records import Records

Float = NDArray[np.float64]

_TICK = 0.2
#: negative densities beyond this share of the number density are told
_NOISE = 1e-10


@dataclass(frozen=True)
class Progress:
    """How far a solution is.

    Attributes
    ----------
    events : int
        Time steps so far.
    fraction : float
        Share of the time that is done, 0 to 1.
    events_per_second : float
    seconds_left : float
        Estimated from the time done so far; NaN when nothing is known yet.
    compile_seconds : float
        Always zero: nothing is compiled.
    time : float
        Time reached.
    window : int
        The number of sizes now.
    bounds_seconds : float
        Always zero: nothing is bounded.
    """

    events: int
    fraction: float
    events_per_second: float
    seconds_left: float
    compile_seconds: float
    time: float
    window: int
    bounds_seconds: float = 0.0


def solve(
    model: Model,
    times: ArrayLike,
    *,
    method: str = "auto",
    tolerance: float = 1e-8,
    largest: int | None = None,
    max_size: int | None = None,
    orders: Sequence[float] = (0, 1, 2, 3),
    sizes: int = 1024,
    bins_per_octave: int = 4,
    gel: str = "inert",
    progress: Callable[[Progress], None] | None = None,
) -> xr.Dataset:
    """Solve the rate equations of a model: the limit of `simulate` for many particles.

    Parameters
    ----------
    model : Model
        The physics.
    times : array_like of shape (T,)
        Output times, ascending, zero or more.
    method : {"auto", "direct", "low-rank"}
        How sums over pairs of the M sizes are taken: all pairs, ``O(M^2)``, or by R factors of the
        kernel and fast Fourier transforms, ``O(M R log M)``. "auto" takes the second unless the
        kernel is far from low rank or M is small.
    tolerance : float
        Relative error allowed in a time step, in a norm that bounds the errors of all moments of
        orders 0 to 3. The error of the result is about as large.
    largest : int, optional
        Keep the sizes ``1 .. largest`` only; if left out, the number of sizes grows with the
        clusters.
    max_size : int, optional
        The most sizes it may grow to; if left out 2**20, for the direct sum 2**13, and 2**12
        where a gel forms.
    orders : sequence of float
        Orders p of the moments ``M_p = sum_k k**p n_k``.
    sizes : int
        Densities are given size by size up to this size, in bins above.
    bins_per_octave : int
        Bins for each doubling of size.
    gel : {"inert", "reacts"}
        What mass beyond the last size does, which after gelation is the gel. Inert, it takes no
        part: the solution of Stockmayer. Or it reacts with the sizes below at the rate that the
        kernel has for very large partners: the solution of Flory, to which `simulate` tends; for
        aggregation alone.
    progress : callable, optional
        Called with a `Progress` a few times a second.

    Returns
    -------
    xarray.Dataset
        As from `simulate`, with one replica, the volume 1 and collisions per unit volume;
        ``particles`` and ``largest`` are NaN. The attribute ``mass_error`` lists, for each time, by
        what share the mass in the window differs from that at the start, and ``window`` the number
        of sizes.

    Raises
    ------
    InputError
        With every mistake in the arguments; or when a rate becomes negative.
    SolverError
        If the solution cannot be continued, with the time reached.
    Interrupted
        On Ctrl-C; holds the dataset of what was reached.

    Warns
    -----
    SmoluxWarning
        If more of the mass than the tolerance lies beyond the last size.

    References
    ----------
    S. A. Matveev, A. P. Smirnov and E. E. Tyrtyshnikov, J. Comput. Phys. 282, 23 (2015),
    doi:10.1016/j.jcp.2014.11.003 (low-rank factors and FFT); E. Hairer and G. Wanner, Solving
    Ordinary Differential Equations II, 2nd ed. (Springer, 1996), section IV.8 (time steps).

    Examples
    --------
    >>> import smolux as sx
    >>> ds = sx.solve(sx.Model(kernel=sx.kernels.Constant()), times=[2.0])
    >>> round(float(ds["number_density"].item()), 8)
    0.5
    """
    settings = check(
        model, times, method, tolerance, largest, max_size, orders, sizes, bins_per_octave, gel
    )
    model = frozen(model)
    started = time.perf_counter()
    run = _Run(model, settings, progress)
    try:
        run.finish()
    except KeyboardInterrupt:
        dataset = to_dataset(model, run.records(time.perf_counter() - started))
        reached = run.integrator.t
        raise Interrupted(f"stopped at t = {reached:.6g}", dataset) from None
    return told(to_dataset(model, run.records(time.perf_counter() - started)))


class _Run:
    """A solution on its way."""

    def __init__(
        self, model: Model, settings: Settings, progress: Callable[[Progress], None] | None
    ) -> None:
        self.model, self.settings, self.progress = model, settings, progress
        self.shots: list[Snapshot] = []
        self.started = self.told = time.perf_counter()
        self.factory = OperatorFactory(model.kernel, settings.method, 0.1 * settings.tolerance)
        self.limit = settings.limit
        if not settings.given and self.limit > DIRECT_LIMIT and self.factory.direct:
            self.limit = max(DIRECT_LIMIT, 2 * model.initial.largest)
        order = max(3.0, float(settings.orders.max()))
        window = Window(self.limit, order, settings.tolerance, settings.fixed)
        start = model.initial.largest
        if start > self.limit and not settings.fixed:
            raise InputError(
                f"max_size = {self.limit}: the initial sizes reach {start}; "
                "raise max_size, or give largest to leave out what lies beyond it"
            )
        sizes = window.first(start)
        n = model.initial.densities(max(sizes, start))
        mass = float(n @ np.arange(1.0, len(n) + 1.0))
        self.equations = Equations(model, self.factory, sizes, mass, settings.gel == "reacts")
        self.observer = Observer(
            settings.orders, settings.sizes, settings.bins_per_octave, mass, model.processes
        )
        self.integrator = Integrator(
            self.equations, n[:sizes], window, settings.tolerance, settings.orders
        )

    def finish(self) -> None:
        """Go through the output times."""
        for t in self.settings.times:
            self.integrator.advance(t, self._tell)
            self.shots.append(self.observer(self.integrator.n, self.integrator.collisions))

    def _tell(self) -> None:
        now = time.perf_counter()
        if self.progress is None or now - self.told < _TICK:
            return
        self.told = now
        seconds = now - self.started
        fraction = self.integrator.t / self.settings.times[-1]
        self.progress(
            Progress(
                events=self.integrator.steps,
                fraction=fraction,
                events_per_second=self.integrator.steps / seconds,
                seconds_left=seconds * (1.0 / fraction - 1.0) if fraction > 0 else np.nan,
                compile_seconds=0.0,
                time=self.integrator.t,
                window=self.equations.largest,
            )
        )

    def records(self, seconds: float) -> Records:
        """Return what was observed so far."""
        records = self.observer.records(self.settings.times, self.shots)
        operator = self.equations.operator
        records.attributes |= {
            "method": "solve",
            "operator": operator.name,
            "rank": operator.rank,
            "kernel_error": operator.error,
            "integrator": "Radau IIA, order 7",
            "tolerance": self.settings.tolerance,
            "gel": self.settings.gel,
            "steps": self.integrator.steps,
            "rejected_steps": self.integrator.rejected,
            "rate_evaluations": self.equations.evaluations,
            "mass_correction": self.integrator.corrected,
            "wall_seconds": seconds,
            "complete": len(self.shots) == len(self.settings.times),
        }
        records.warnings = self._warnings()
        return records

    def _warnings(self) -> list[str]:
        found = [*self.model.initial.remarks, *self.factory.notes]
        tolerance = self.settings.tolerance
        late = [t for t, shot in zip(self.settings.times, self.shots, strict=False)
                if abs(shot.mass_error) > tolerance]  # fmt: skip
        if late:
            worst = self.shots[-1].mass_error
            found.append(
                f"from t = {late[0]:.6g} on mass lies beyond the {self.equations.largest} sizes "
                f"kept, {-worst:.3g} of it at the end: {self._cure()}"
            )
        negative = min((shot.negative for shot in self.shots), default=0.0)
        if negative < -_NOISE:
            found.append(
                f"densities fell below zero by up to {-negative:.1e} of the number density and "
                "were set to zero: take a smaller tolerance"
            )
        return found

    def _cure(self) -> str:
        if self.model.kernel.gels:
            effect = (
                "it reacts with them (Flory), as in a simulation"
                if self.settings.gel == "reacts"
                else "it is taken as inert (Stockmayer), where a simulation lets it react (Flory); "
                "gel='reacts' follows that"
            )
            return f"after gelation this is the gel, and {effect}"
        if self.settings.fixed:
            return "leave out largest, so that the number of sizes grows, or raise it"
        return f"raise max_size (now {self.limit})"
