"""The entry point for very many replicas of a small system."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from smolux.checks import whole
from smolux.confidence import quantile
from smolux.errors import InputError, Interrupted, OutOfMemoryError
from smolux.methods.base import Method
from smolux.model import Model
from smolux.model_dict import model_to_dict
from smolux.results import provenance, told
from smolux.runtime.progress import Progress
from smolux.runtime.resources import cores
from smolux.weighting.base import Weighting

from .batches import Batch, Sampler, interleaved, make_sampler

Float = NDArray[np.float64]

LONG_NAMES = {
    "mean": "mean over the replicas",
    "standard_error": "standard error of the mean",
    "lower": "lower end of the 95 % interval of the mean",
    "upper": "upper end of the 95 % interval of the mean",
    "variance": "variance of one replica",
    "variance_lower": "lower end of the 95 % interval of the variance",
    "variance_upper": "upper end of the 95 % interval of the variance",
    "cost": "processor seconds of one replica",
    "cost_lower": "lower end of the 95 % interval of the cost",
    "cost_upper": "upper end of the 95 % interval of the cost",
    "collisions": "collisions of one replica, on average",
}


class Collected:
    """What the batches of one sampler add up to."""

    def __init__(self, first: Batch) -> None:
        self.moments, self.totals = first.moments, first.totals
        #: replicas and processor seconds of each batch
        self.spent = [(first.moments.count, first.seconds)]

    def add(self, batch: Batch) -> None:
        """Add a batch to those before it."""
        self.moments += batch.moments
        self.totals += batch.totals
        self.spent.append((batch.moments.count, batch.seconds))

    def cost(self) -> tuple[float, float, int]:
        """Processor seconds of a replica, the relative standard error of that, and batches."""
        counts, seconds = np.array(self.spent).T
        mean = float(seconds.sum() / counts.sum())
        each = self.each()
        error = float(np.std(each, ddof=1) / np.sqrt(len(each))) if len(each) > 1 else np.nan
        return mean, error / mean if mean > 0 else np.nan, len(each)

    def each(self) -> Float:
        """Processor seconds of a replica in each batch; the last may be shorter and is left out."""
        counts, seconds = np.array(self.spent).T
        whole_ones = counts == counts[0]
        return np.asarray(seconds[whole_ones] / counts[whole_ones])

    def variables(self) -> dict[str, Any]:
        """Return the variables of the Dataset, without those that `ensemble` alone knows."""
        moments = self.moments
        cost, relative, batches = self.cost()
        ratio = float(np.exp(quantile(batches) * relative))
        dims = ("observable", "time")
        lower, upper = moments.interval()
        low, high = moments.variance_interval()
        return {
            "mean": (dims, moments.mean),
            "standard_error": (dims, moments.error),
            "lower": (dims, lower),
            "upper": (dims, upper),
            "variance": (dims, moments.variance),
            "variance_lower": (dims, low),
            "variance_upper": (dims, high),
            "cost": ((), cost),
            "cost_lower": ((), cost / ratio),
            "cost_upper": ((), cost * ratio),
            "collisions": ((), self.totals.collisions / moments.count),
        }


def ensemble(
    model: Model,
    times: ArrayLike,
    observables: Sequence[str] = ("number_density", "M2"),
    *,
    method: str | Method = "auto",
    weighting: str | Weighting = "number",
    population: str = "doubling",
    particles: int = 100,
    replicas: int = 1_000_000,
    seed: int | None = None,
    threads: int | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> xr.Dataset:
    """Simulate very many replicas of a small system and keep their statistics only.

    The replicas are those of `simulate` with the same seed. Nothing is kept of a single one, so the
    memory does not depend on how many there are.

    Parameters
    ----------
    model : Model
        The physics.
    times : array_like of shape (T,)
        Output times, ascending, zero or more.
    observables : sequence of str
        ``"number_density"``, ``"largest"``, ``"M2"`` (the moment of any order) or ``"n_50"`` (the
        density of any size).
    method, weighting, population, particles
        As for `simulate`. With ``weighting="auto"`` the first observable is what it is chosen for.
    replicas : int
        Independent runs, 2 or more.
    seed : int, optional
        Drawn and stored if left out. The same seed gives the same numbers on any number of threads.
    threads : int, optional
        All cores if left out.
    progress : callable, optional
        Called with a `Progress`: a number, the share that is done, with all else beside it.

    Returns
    -------
    xarray.Dataset
        Over observable and time: ``mean``, ``standard_error``, ``lower`` and ``upper``, the 95 %
        interval of the mean; ``variance`` of one replica, ``variance_lower`` and
        ``variance_upper``, its 95 % interval, which the fourth moment gives for many replicas,
        whatever the law. Of one replica: ``cost`` in processor seconds, without compilation, with
        its interval from the scatter over batches; ``collisions``.

    Raises
    ------
    InputError
        With every mistake in the arguments, or when the kernel gives no valid rate; if that is
        found late, with the statistics of the replicas before as its ``dataset``.
    Interrupted
        On Ctrl-C, with the same.

    Warns
    -----
    SmoluxWarning
        What `smolux.results.warnings` lists, as `simulate` does.

    Examples
    --------
    >>> import smolux as sx
    >>> model = sx.Model(kernel=sx.kernels.Constant())
    >>> ds = sx.ensemble(model, [5.0], particles=100, replicas=1000, seed=1)
    >>> bool(abs(ds["mean"].sel(observable="number_density") - 0.289).max() < 0.01)
    True
    """
    problems: list[str] = []
    workers = checked_threads(threads, problems)
    sampler = make_sampler(
        model, times, observables, method, weighting, population, particles, replicas, seed,
        problems,
    )  # fmt: skip
    begun = time.perf_counter()
    names = [observables] if isinstance(observables, str) else list(observables)

    def dataset(found: list[Collected], *remarks: str) -> xr.Dataset:
        collected = found[0]
        spent = sum(seconds for _, seconds in collected.spent)
        attributes = {
            **described(sampler, found, int(replicas)),
            "warnings": [*collected.totals.warnings(sampler.plan), *remarks],
            "collisions_per_second": collected.totals.collisions / spent,
            "wall_seconds": time.perf_counter() - begun,
        }
        coordinates = {"observable": names, "time": np.array(sampler.plan.times)}
        given = provenance("Statistics of an ensemble", attributes)
        return labelled(xr.Dataset(collected.variables(), coordinates, given), LONG_NAMES)

    return told(collect([sampler], int(replicas), workers, progress, dataset))


def collect(
    samplers: Sequence[Sampler],
    replicas: int,
    workers: int,
    progress: Callable[[Progress], None] | None,
    dataset: Callable[..., xr.Dataset],
) -> xr.Dataset:
    """Run the replicas of all samplers in turns and return ``dataset(collected, *remarks)`` of all.

    Raises
    ------
    InputError, Interrupted
        With the dataset of the turns that were complete, if there are any.
    """
    found: list[Collected] = []

    def kept(*problems: str) -> xr.Dataset | None:
        if not found:
            return None
        count = found[0].moments.count
        return dataset(found, *problems, f"statistics of {count} of {replicas} replicas")

    try:
        for turn in interleaved(samplers, replicas, workers, progress):
            if found:
                for each, batch in zip(found, turn, strict=True):
                    each.add(batch)
            else:
                found = [Collected(batch) for batch in turn]
    except KeyboardInterrupt:
        raise Interrupted("interrupted", kept()) from None
    except (InputError, MemoryError) as error:
        late = error if isinstance(error, InputError) else OutOfMemoryError()
        late.dataset = kept(*late.problems)
        raise late from None
    return dataset(found)


def checked_threads(threads: Any, problems: list[str]) -> int:
    """Return how many threads to use; all cores for None. Note what is wrong."""
    number = cores() if threads is None else whole(threads)
    if number is None or number < 1:
        problems.append(f"threads = {threads!r}: must be a whole number of at least 1, or None")
        return 1
    return number


def described(sampler: Sampler, found: Sequence[Collected], wanted: int) -> dict[str, Any]:
    """Return the attributes that say what was simulated, of the replicas that were `wanted`."""
    plan, replicas = sampler.plan, found[0].moments.count
    return {
        "model": model_to_dict(plan.model),
        "method": plan.method.name,
        "method_reason": plan.reason or "asked for",
        "weighting": plan.weighting.name,
        "weighting_reason": plan.weighting_reason or "asked for",
        "weighting_settings": plan.weighting.settings,
        "population": plan.population,
        "initial_particles": plan.particles,
        "replicas": replicas,
        "complete": replicas == wanted,
        "seed": str(plan.seed),
    }


def labelled(ds: xr.Dataset, long_names: dict[str, str]) -> xr.Dataset:
    """Give the variables their long names and units."""
    for name in map(str, ds.data_vars):
        ds[name].attrs["long_name"] = long_names[name]
        if name.startswith("cost"):
            ds[name].attrs["units"] = "s"
    return ds
