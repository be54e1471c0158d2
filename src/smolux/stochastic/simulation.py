"""The stochastic entry point: checks the arguments, drives the loop in slices, observes."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from smolux.functions.content import frozen
from smolux.methods.base import Method
from smolux.model import Model
from smolux.results import told
from smolux.runtime.executors import adapted, workers_of
from smolux.runtime.progress import Progress
from smolux.runtime.resources import cores
from smolux.settings import Control, Settings
from smolux.weighting.base import Weighting

from . import checkpoint as checkpoints
from .bounds_cache import spent
from .driving import ExecutorRun, ThreadRun
from .make_plan import decided
from .subvolumes import start

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Progress", "resume", "simulate"]


def simulate(
    model: Model,
    times: ArrayLike,
    *,
    method: str | Method = "auto",
    weighting: str | Weighting = "number",
    population: str = "doubling",
    particles: int = 100_000,
    replicas: int = 8,
    seed: int | None = None,
    orders: Sequence[float] = (0, 1, 2, 3),
    sizes: int = 1024,
    bins_per_octave: int = 4,
    distribution: bool = False,
    executor: Executor | None = None,
    progress: Callable[[Progress], None] | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    checkpoint_every: float = 600.0,
    time_limit: float | None = None,
    target_error: float | None = None,
    target: str = "number_density",
    max_replicas: int = 1000,
    subvolumes: int = 1,
    remix: float = 1.0,
) -> xr.Dataset:
    """Simulate the exact jump process of a model (Marcus-Lushnikov), several replicas of it.

    Parameters
    ----------
    model : Model
        The physics.
    times : array_like of shape (T,)
        Output times, ascending, zero or more.
    method : str or Method
        How the next pair is found, see `smolux.methods.METHODS`; "auto" estimates the cost of an
        event and chooses, and the attributes ``method`` and ``method_reason`` of the result say
        what and why.
    weighting : str or Weighting
        What one simulated particle stands for, see `smolux.weighting.WEIGHTINGS`; "auto" chooses
        the one that is most efficient for the `target` in a short pilot, and the attributes
        ``weighting``, ``weighting_settings`` and ``weighting_reason`` say what and why.
    population : {"doubling", "fixed-volume", "none"}
        Double the volume, every particle once more, when half of the initial number are left; or
        do not.
    particles : int
        Simulated particles at the start; the volume is ``particles / density``.
    replicas : int
        Independent runs; error bars come from the spread over them.
    seed : int, optional
        Entropy of the random streams, one for each replica; drawn and stored if left out. The
        same seed gives the same numbers on any number of threads.
    orders : sequence of float
        Orders p of the moments ``M_p = sum_k k**p n_k``.
    sizes : int
        Densities are given size by size up to this size, in bins above.
    bins_per_octave : int
        Bins for each doubling of size.
    distribution : bool
        Keep the whole population at each time.
    executor : concurrent.futures.Executor, optional
        Where groups of replicas run; threads of this process if left out. Also the client of a Dask
        cluster. Other executors than threads run without checkpoints, and progress is that of
        whole groups. Groups whose worker died are run again.
    progress : callable, optional
        Called with a `Progress` a few times a second.
    checkpoint : path, optional
        File for checkpoints, written every `checkpoint_every` seconds and when the run is
        stopped. Left in place at the end: delete it when the result is saved.
    checkpoint_every : float
        Seconds between checkpoints.
    time_limit : float, optional
        Wall seconds after which the run stops with what was reached: the attribute ``complete`` of
        the result is then 0, and ``stopped`` and a warning say how to go on.
    target_error : float, optional
        As many replicas as make the half width of the 95 % interval of the `target` over its mean
        at most this at every output time. How many is chosen by pilots, `replicas` at first and at
        least 8, that are no part of the result, so that its mean has no bias. The result is that of
        a run with so many replicas from the start, bit for bit.
    target : str
        What `target_error` and ``weighting="auto"`` are about: ``"number_density"``,
        ``"largest"``, ``"M2"`` (any of the `orders`) or ``"n_5"`` (any size).
    max_replicas : int
        Where adding replicas ends; then the result has a warning.
    subvolumes : int
        Parts of each replica that are simulated side by side, one on each core, and mixed again
        and again: for one large system. Each has at least 1000 particles. What this adds to the
        bias is of the order of `subvolumes` times that of a finite population, see the page on
        many cores.
    remix : float
        Collisions for each particle from one mixing to the next.

    Returns
    -------
    xarray.Dataset
        With the dimensions replica, time, order, size, bin; see the page on the dataset.

    Raises
    ------
    InputError
        With every mistake in the arguments, or when the kernel gives no valid rate during the run,
        or when the particles would outgrow the memory: then its `dataset` holds what was reached,
        and its `checkpoint` the file, if one was asked for.
    Interrupted
        On Ctrl-C; holds the dataset of what was reached, and the checkpoint from which `resume`
        goes on, bit for bit, if one was written.
    WorkerError
        If processes of an executor die again and again; its `dataset` holds what others computed.

    Warns
    -----
    SmoluxWarning
        If the result is not all that was asked for, or may be off; `smolux.results.warnings` has
        the same of a result that was kept.

    Notes
    -----
    Waiting times are exponential, so every distribution of the process is exact, fluctuations
    included. The mean over replicas differs from the solution of the rate equations by
    ``O(1/particles)``; this bias is not part of the spread.

    Examples
    --------
    >>> import smolux as sx
    >>> model = sx.Model(kernel=sx.kernels.Constant())
    >>> ds = sx.simulate(model, times=[1, 10], particles=10_000, replicas=4, seed=1)
    >>> float(ds["moment"].sel(order=1).mean())
    1.0
    """
    given = dict(locals())
    before = spent()
    given["executor"] = adapted(executor)
    settings = Settings.for_model(given.pop("model"), given, Control.mistakes(given))
    control = Control.checked(given)
    plan = decided(frozen(model), settings)
    planned = spent() - before
    other = control.executor
    if other is not None and not isinstance(other, ThreadPoolExecutor):
        return told(ExecutorRun(plan, other, control.progress, workers_of(other), planned).finish())
    workers = max(1, cores() // plan.subvolumes)
    groups = [start(plan, *part) for part in plan.begin(workers)]
    return told(ThreadRun(plan, groups, control, workers, planned).finish())


def resume(
    checkpoint: str | os.PathLike[str],
    *,
    model: Model | None = None,
    executor: ThreadPoolExecutor | None = None,
    progress: Callable[[Progress], None] | None = None,
    checkpoint_every: float = 600.0,
    time_limit: float | None = None,
) -> xr.Dataset:
    """Go on from a checkpoint; the data are bit for bit those of an uninterrupted run.

    Parameters
    ----------
    checkpoint : path
        As written by `simulate`; kept up to date.
    model : Model, optional
        Needed only if the kernel or a rate is a Python function.
    executor, progress, checkpoint_every, time_limit
        As for `simulate`.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError, Interrupted
        As `simulate`, and if the file cannot be read.
    """
    given = dict(locals())
    control = Control.checked(given | {"executor": adapted(executor), "checkpoint": None})
    file = Path(checkpoint).expanduser()
    control, (plan, groups) = replace(control, checkpoint=file), checkpoints.load(file, model)
    workers = max(1, cores() // plan.subvolumes)
    return told(ThreadRun(plan, groups, control, workers, resumed=True).finish())
