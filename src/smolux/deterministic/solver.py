"""The deterministic entry point: checks the arguments, steps to the output times, observes."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.errors import InputError, Interrupted, SolverError
from smolux.functions.content import frozen
from smolux.model import Model
from smolux.processes import Source
from smolux.results import to_dataset, told
from smolux.runtime.progress import Progress
from smolux.settings import SolverSettings

from .arguments import renamed
from .encounters import Encounters
from .equations import Equations
from .gel import may_gel
from .integrate import Integrator
from .observe import Observer, Snapshot
from .terms import unit_of
from .timemesh import TimeMesh
from .window import Window, usual_limit

if TYPE_CHECKING:
    import xarray as xr

    from smolux.results.records import Records

Float = NDArray[np.float64]

_TICK = 0.2
#: negative densities beyond this share of the number density are told
_NOISE = 1e-10


def solve(
    model: Model,
    times: ArrayLike,
    *,
    method: str = "auto",
    tolerance: float = 1e-8,
    window: int | None = None,
    max_window: int | None = None,
    orders: Sequence[float] = (0, 1, 2, 3),
    sizes: int = 1024,
    bins_per_octave: int = 4,
    gel: str = "inert",
    check: bool = False,
    progress: Callable[[Progress], None] | None = None,
    largest: int | None = None,
    max_size: int | None = None,
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
    window : int, optional
        Keep the sizes ``1 .. window`` only; if left out, the number of sizes grows with the
        clusters: before what merges beyond the last size matters.
    max_window : int, optional
        The largest size it may grow to; if left out there are 2**20 sizes at most, for the direct
        sum 2**13, and 2**12 where a gel forms.
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
    check : bool
        Solve once more, at a tenfold tolerance and on another window, and keep the difference: the
        variable ``error`` over ``time``.
    progress : callable, optional
        Called with a `Progress` a few times a second.
    largest, max_size : int, optional
        Former names of `window` and `max_window`.

    Returns
    -------
    xarray.Dataset
        As from `simulate`, with one replica, the volume 1 and collisions per unit volume;
        ``particles`` and ``largest`` are NaN. Attributes: ``mass_error`` lists, for each time, by
        what share of all mass, with what came in, that in the window differs from what it would be
        if none went beyond the last size; ``mass_beyond`` what share went there, ``window`` the
        last size. ``number_defect`` and ``mass_defect`` tell by what share of all that was ever
        there densities differ from the account of what the processes make and take.

    Raises
    ------
    InputError
        With every mistake in the arguments; or when a rate becomes negative: then with the dataset
        of what was reached.
    SolverError
        If the solution cannot be continued, or if number and mass do not come out as they must:
        with the time reached and the dataset.
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
    window = renamed("window", window, "largest", largest)
    max_window = renamed("max_window", max_window, "max_size", max_size)
    given = {
        "times": times, "method": method, "tolerance": tolerance, "window": window,
        "max_window": max_window, "orders": orders, "sizes": sizes,
        "bins_per_octave": bins_per_octave, "gel": gel, "check": check,
    }  # fmt: skip
    settings = SolverSettings.for_model(model, given)
    model = frozen(model)
    dataset = Run(model, settings, progress).dataset()
    if check:
        dataset = with_error(dataset, model, settings)
    return told(dataset)


class Run:
    """A solution on its way.

    Parameters
    ----------
    model : Model
        Frozen.
    settings : SolverSettings
    progress : callable, optional
    room : int
        The first window is so many times larger than usual.
    """

    def __init__(
        self,
        model: Model,
        settings: SolverSettings,
        progress: Callable[[Progress], None] | None = None,
        room: int = 1,
    ) -> None:
        self.model, self.settings, self.progress = model, settings, progress
        self.physics = physics = model.reduced
        self.shots: list[Snapshot] = []
        self.started = self.told = time.perf_counter()
        start = model.initial.densities(model.initial.largest)
        unit = unit_of(model, start)
        tolerance = 0.1 * settings.tolerance
        self.encounters = Encounters(physics, settings.method, tolerance, unit)
        window = self._window(unit)
        count = min(room * window.first(largest_size(model) // unit), window.limit)
        n = np.zeros(count)
        inside = start[unit - 1 :: unit][:count]
        n[: len(inside)] = inside
        mass = float(start @ np.arange(1.0, len(start) + 1.0))
        reacts = settings.gel == "reacts"
        self.equations = Equations(physics, self.encounters, count, mass, reacts, unit)
        laws = [process.factor for process in model.processes] + self.encounters.factors
        self.integrator = Integrator(
            self.equations,
            n,
            window,
            TimeMesh.of(laws, settings.times[-1], settings.tolerance),
            settings.tolerance,
            np.array(settings.orders),
        )
        self.observer = Observer(
            np.array(settings.orders),
            settings.sizes,
            settings.bins_per_octave,
            mass,
            model.processes,
        )

    @property
    def _may_gel(self) -> bool:
        return any(may_gel(law) for law in self.encounters.merging)

    def _window(self, unit: int) -> Window:
        """Return the rules for the number of sizes, which are multiples of the unit."""
        model, settings, cut = self.model, self.settings, self.model.cut
        largest, given = largest_size(model), settings.window or settings.max_window
        if given is None:
            hindered = not model.only_aggregates
            limit = usual_limit(largest // unit, self._may_gel, hindered, self.encounters.direct)
        else:
            limit = max(given // unit, 1)
        if cut is not None:  # nothing is ever larger
            limit = min(limit, max(cut // unit, 1))
        most = given or limit * unit
        if largest > most and settings.window is None:
            raise InputError(
                f"max_window = {most}: sizes reach {largest} at the start or from a "
                "source; raise max_window, or give window to leave out what lies beyond it"
                if given is not None
                else f"initial, source: sizes reach {largest}, and there are {limit} sizes at "
                "most; measure sizes in a larger unit, or give window to leave out what lies "
                "beyond it"
            )
        order = max(3.0, *settings.orders)
        return Window(limit, order, settings.tolerance, settings.window is not None)

    def dataset(self) -> xr.Dataset:
        """Go through the output times; what was reached comes with what ends it."""
        try:
            for t in self.settings.times:
                self.integrator.advance(t, self._tell)
                run = self.integrator
                self.shots.append(self.observer(run.n, self.equations.sizes, run.totals))
        except KeyboardInterrupt:
            message = f"stopped at t = {self.integrator.t:.6g}"
            raise Interrupted(message, self._dataset()) from None
        except (InputError, SolverError) as error:
            error.dataset = self._dataset()
            raise
        return self._dataset()

    def _dataset(self) -> xr.Dataset:
        return to_dataset(self.model, self.records(time.perf_counter() - self.started))

    def _tell(self) -> None:
        now = time.perf_counter()
        if self.progress is None or now - self.told < _TICK:
            return
        self.told = now
        seconds = now - self.started
        fraction = self.integrator.t / self.settings.times[-1]
        self.progress(
            Progress(
                fraction,
                "solving",
                self.integrator.steps,
                "steps",
                self.integrator.steps / seconds,
                seconds * (1.0 / fraction - 1.0) if fraction > 0 else np.nan,
                counts={
                    "time": self.integrator.t, "window": int(self.equations.sizes[-1]),
                },
            )
        )  # fmt: skip

    def records(self, seconds: float) -> Records:
        """Return what was observed so far."""
        records = self.observer.records(self.settings.times, self.shots)
        sums = self.encounters
        records.attributes |= {
            "method": "solve",
            "operator": sums.name,
            "rank": sums.rank,
            "kernel_error": sums.error,
            "integrator": "Radau IIA, order 7",
            "tolerance": self.settings.tolerance,
            "gel": self.settings.gel,
            "steps": self.integrator.steps,
            "rejected_steps": self.integrator.rejected,
            "rate_evaluations": self.equations.evaluations,
            "unit": self.equations.unit,
            "mass_beyond": [shot.beyond for shot in self.shots],
            "number_defect": self.integrator.account.number,
            "mass_defect": self.integrator.account.mass,
            "terms_defect": self.integrator.account.apart,
            "wall_seconds": seconds,
            "complete": len(self.shots) == len(self.settings.times),
        }
        records.warnings = self._warnings()
        return records

    def _warnings(self) -> list[str]:
        found = [*self.model.initial.remarks, *self.encounters.notes]
        tolerance = self.settings.tolerance
        late = [t for t, shot in zip(self.settings.times, self.shots, strict=False)
                if shot.beyond > tolerance]  # fmt: skip
        if late:
            found.append(
                f"from t = {late[0]:.6g} on mass lies beyond the {self.equations.count} sizes "
                f"kept, {self.shots[-1].beyond:.3g} of it at the end: {self._cure()}"
            )
        negative = min((shot.negative for shot in self.shots), default=0.0)
        if negative < -_NOISE:
            found.append(
                f"densities fell below zero by up to {-negative:.1e} of the number density and "
                "were set to zero: take a smaller tolerance"
            )
        return found

    def _cure(self) -> str:
        if self._may_gel:
            effect = (
                "it reacts with them (Flory), as in a simulation"
                if self.settings.gel == "reacts"
                else "it is taken as inert (Stockmayer), where a simulation lets it react (Flory); "
                "gel='reacts' follows that"
            )
            return f"after gelation this is the gel, and {effect}"
        if self.settings.window is not None:
            return "leave out window, so that the number of sizes grows, or raise it"
        return f"raise max_window (now {self.integrator.window.limit * self.equations.unit})"


def largest_size(model: Model) -> int:
    """Return the largest size at the start or from a source."""
    sources = [int(p.table[0][-1]) for p in model.processes if isinstance(p, Source)]
    return max([model.initial.largest, *sources])


def with_error(dataset: xr.Dataset, model: Model, settings: SolverSettings) -> xr.Dataset:
    """Add the largest relative difference of number density and moments from a looser solution."""
    looser = replace(settings, tolerance=min(10.0 * settings.tolerance, 0.1))
    other = Run(model, looser, room=1 if settings.window else 2).dataset()
    found = np.zeros(dataset.sizes["time"])
    for name in ("number_density", "moment"):
        one, two = (x[name].values.reshape(1, len(found), -1)[0] for x in (dataset, other))
        scale = np.maximum(np.abs(one), np.finfo(float).tiny)
        found = np.maximum(found, (np.abs(one - two) / scale).max(axis=1))
    described = {"long_name": "relative difference from a solution of a tenfold tolerance"}
    return dataset.assign(error=("time", found, described))
