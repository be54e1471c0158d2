"""What a method and a weighting are worth: bias, variance, cost and efficiency."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from smolux import exact as solutions
from smolux.confidence import quantile
from smolux.deterministic.solver import solve
from smolux.errors import InputError, SolverError
from smolux.methods.base import Method
from smolux.model import Model
from smolux.results import provenance, told
from smolux.runtime.progress import Progress
from smolux.weighting import WeightFunction
from smolux.weighting.base import Weighting

from .batches import Sampler, make_sampler
from .ensemble import LONG_NAMES, Collected, checked_threads, collect, described, labelled

Float = NDArray[np.float64]

#: half width of the 95 % interval of a normal law, in standard deviations
_NORMAL = 1.959963984540054

_LONG_NAMES = LONG_NAMES | {
    "reference": "value without bias",
    "bias": "mean over the replicas less the reference",
    "bias_lower": "lower end of the 95 % interval of the bias",
    "bias_upper": "upper end of the 95 % interval of the bias",
    "efficiency": "efficiency, 1 / (cost variance)",
    "efficiency_lower": "lower end of the 95 % interval of the efficiency",
    "efficiency_upper": "upper end of the 95 % interval of the efficiency",
    "ratio": "efficiency over that of the first scheme",
    "ratio_lower": "lower end of the 95 % interval of the ratio",
    "ratio_upper": "upper end of the 95 % interval of the ratio",
    "best": "whether no other is more efficient beyond chance (95 %)",
}


def efficiency(
    model: Model,
    methods: Sequence[str | Method] = ("auto",),
    weightings: Sequence[str | Weighting] = ("number", "mass-flow"),
    observables: Sequence[str] = ("number_density", "M2"),
    *,
    times: ArrayLike,
    population: str = "doubling",
    particles: int = 100,
    replicas: int = 20_000,
    seed: int | None = None,
    schemes: Sequence[tuple[str | Method, str | Weighting]] | None = None,
    exact: ArrayLike | None = None,
    threads: int | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> xr.Dataset:
    """Measure bias, variance, cost and efficiency of methods and weightings.

    The efficiency is ``1 / (cost variance)``: how fast the squared error of a mean over replicas
    falls with processor time. The bias is no part of it, and only more particles reduce it.

    Parameters
    ----------
    model : Model
        The physics.
    methods, weightings : sequence
        All pairs of them are measured, each as `simulate` takes it.
    observables, times, population, particles
        As for `ensemble`; the particles are the same for all.
    replicas : int
        Of each pair.
    seed : int, optional
        Of the first pair; those that follow have the numbers after it.
    schemes : sequence of (method, weighting), optional
        Only these pairs, whatever `methods` and `weightings` are.
    exact : array_like of shape (observables, times), optional
        What the bias is measured against. If left out: the exact solution of the model if one is
        known, else that of the rate equations by `solve`.
    threads, progress
        As for `ensemble`.

    Returns
    -------
    xarray.Dataset
        Over scheme (a method and a weighting), observable and time: what `ensemble` returns;
        ``bias``, ``efficiency`` and ``ratio``, the efficiency over that of the first scheme, each
        with its 95 % interval from ``_lower`` to ``_upper``; ``best``, whether no other scheme is
        more efficient beyond chance. A variance of zero makes the efficiency infinite. The
        ``reference`` is NaN where none is known.

    Raises
    ------
    InputError, Interrupted
        With the mistakes in the arguments; late in a run, and on Ctrl-C, as `ensemble` does, with
        what is known of all schemes.

    Warns
    -----
    SmoluxWarning
        What `smolux.results.warnings` lists.

    Notes
    -----
    Batches of all pairs are run in turn, and costs are compared turn by turn, so that other
    programs disturb all alike.

    References
    ----------
    A. Kolodko and K. Sabelfeld, WIAS Preprint 842 (2003), section 4.

    Examples
    --------
    >>> import smolux as sx
    >>> ds = sx.efficiency(
    ...     sx.Model(kernel=sx.kernels.Constant()),
    ...     methods=["acceptance-rejection"],
    ...     observables=["n_50"],
    ...     times=[20.0],
    ...     replicas=1000,
    ...     seed=1,
    ... )
    >>> number, flow = ds["variance"].values.ravel()
    >>> bool(flow < number / 3)
    True
    """
    problems: list[str] = []
    workers = checked_threads(threads, problems)
    pairs = _pairs(methods, weightings, schemes, problems)
    entropy = np.random.SeedSequence().entropy if seed is None else seed
    samplers: list[Sampler] = []
    for method, weighting in pairs:
        following = entropy + len(samplers) if isinstance(entropy, int) else entropy
        samplers.append(
            make_sampler(
                model, times, observables, method, weighting, population, particles, replicas,
                following, problems,  # type: ignore[arg-type]
            )
        )  # fmt: skip
    names = [observables] if isinstance(observables, str) else list(observables)
    reference, source = _reference(samplers[0], names, exact)
    labels = [(_label(m), _label(w)) for m, w in pairs]

    def dataset(found: list[Collected], *remarks: str) -> xr.Dataset:
        given = described(samplers[0], found, int(replicas)) | {
            "reference": source,
            "methods": [s.plan.method.name for s in samplers],
            "weightings": [_label(s.plan.weighting) for s in samplers],
            "warnings": [*_warnings(samplers, found, labels), *remarks],
        }
        for one in ("method", "method_reason", "weighting", "weighting_reason"):
            del given[one]
        del given["weighting_settings"]
        coordinates = {
            "scheme": [", ".join(pair) for pair in labels],
            "method": ("scheme", [m for m, _ in labels]),
            "weighting": ("scheme", [w for _, w in labels]),
            "observable": names,
            "time": np.array(samplers[0].plan.times),
        }
        variables = _variables(found, reference)
        ds = xr.Dataset(variables, coordinates, provenance("Efficiency of methods", given))
        return labelled(ds, _LONG_NAMES)

    return told(collect(samplers, int(replicas), workers, progress, dataset))


def _variables(found: Sequence[Collected], reference: Float) -> dict[str, Any]:
    """Return the variables of all schemes, side by side."""
    columns = [each.variables() for each in found]
    variables: dict[str, Any] = {
        name: (("scheme", *dims), np.array([column[name][1] for column in columns]))
        for name, (dims, _) in columns[0].items()
    }
    for name, values in (_compared(found) | _biased(found, reference)).items():
        variables[name] = (("scheme", "observable", "time"), values)
    return variables | {"reference": (("observable", "time"), reference)}


def _warnings(
    samplers: Sequence[Sampler], found: Sequence[Collected], labels: Sequence[tuple[str, str]]
) -> list[str]:
    """Return the warnings of all schemes, each with those that it is about, unless that is all."""
    schemes: dict[str, list[str]] = {}
    for sampler, each, label in zip(samplers, found, labels, strict=True):
        for text in each.totals.warnings(sampler.plan):
            schemes.setdefault(text, []).append(", ".join(label))
    return [
        text if len(about) == len(samplers) else f"{'; '.join(about)}: {text}"
        for text, about in schemes.items()
    ]


def _pairs(methods: Any, weightings: Any, schemes: Any, problems: list[str]) -> list[Any]:
    """Return the pairs to measure; any one, with problems, if there are none."""
    if schemes is None:
        listed = (
            _listed(k, v, problems) for k, v in (("methods", methods), ("weightings", weightings))
        )
        return list(product(*listed)) or [("auto", "number")]
    try:
        pairs = [(method, weighting) for method, weighting in schemes]
    except (TypeError, ValueError):
        pairs = []
    if not pairs:
        problems.append(f"schemes = {schemes!r}: must be a list of pairs (method, weighting)")
    return pairs or [("auto", "number")]


def _listed(what: str, given: Any, problems: list[str]) -> list[Any]:
    if isinstance(given, str) or not isinstance(given, Sequence) or not given:
        problems.append(f"{what} = {given!r}: must be a list of one or more")
        return []
    labels = [_label(each) for each in given]
    if len(set(labels)) < len(labels):
        problems.append(f"{what} = {given!r}: one comes twice")
    return list(given)


def _label(given: Any) -> str:
    """Return a name that also tells weight functions and settings apart."""
    if isinstance(given, str):
        return given
    if isinstance(given, WeightFunction):
        return f"{given.name}={given.w if given.exponent is None else format(given.w, 'g')}"
    return str(given.name) if isinstance(given, (Method, Weighting)) else repr(given)


def _reference(sampler: Sampler, names: Sequence[str], exact: Any) -> tuple[Float, str]:
    """Return values without bias, of shape (observables, times), and where they come from."""
    plan = sampler.plan
    shape = len(names), len(plan.times)
    if exact is not None:
        try:
            return np.reshape(np.asarray(exact, float), shape), "given"
        except (TypeError, ValueError):
            raise InputError(
                f"exact: must have the shape {shape}, a row of values in time for each observable"
            ) from None
    targets = sampler.targets
    values = np.full(shape, np.nan)
    solution = solutions.solution(plan.model)
    if solution is not None:
        for row, target in zip(values, targets, strict=True):
            if target.size is not None:
                row[:] = solution.densities(plan.times, [target.size])[:, 0]
            elif target.target != "largest":
                moment = target.order is not None
                row[:] = solution.moment(plan.times, target.order or 0.0, gel=moment)
        return values, "exact solution"
    reacts = plan.physics.kernel.gels and plan.model.only_aggregates
    gel: dict[str, Any] = {"gel": "reacts"} if reacts else {}
    try:
        ds = solve(plan.model, plan.times, orders=plan.orders, sizes=plan.sizes, **gel)
    except SolverError as error:
        return values, f"none: {error}"
    for row, target in zip(values, targets, strict=True):
        if target.size is not None:
            row[:] = ds["n"].sel(size=target.size).values.ravel()
        elif target.order is not None:
            row[:] = ds["moment"].sel(order=target.order).values.ravel()
        elif target.target == "number_density":
            row[:] = ds["number_density"].values.ravel()
    return values, "rate equations"


def _biased(found: Sequence[Collected], reference: Float) -> dict[str, Float]:
    """Return the bias of each pair and its interval."""
    moments = [each.moments for each in found]
    bias = np.array([m.mean - reference for m in moments])
    lower, upper = (np.array(ends) for ends in zip(*(m.interval() for m in moments), strict=True))
    return {"bias": bias, "bias_lower": lower - reference, "bias_upper": upper - reference}


def _compared(found: Sequence[Collected]) -> dict[str, Float]:
    """Return efficiencies, their ratios to the first, intervals of both, and which are best."""
    with np.errstate(divide="ignore", invalid="ignore"):
        values = np.array([1.0 / (each.cost()[0] * each.moments.variance) for each in found])
        scatter = np.array([each.moments.relative_error for each in found])
        ratio = values / values[0]
    # a chance of the normal law, as the many replicas give it; few batches have a wider one
    cost = np.array([_cost_error(each) for each in found])[:, None, None]
    spread = np.exp(np.hypot(_NORMAL * scatter, cost))
    between = [_cost_ratio_error(each, found[0]) for each in found]
    both = np.array(between)[:, None, None]
    wide = np.exp(np.sqrt(_NORMAL**2 * (scatter**2 + scatter[0] ** 2) + both**2))
    wide[0] = 1.0  # with itself
    best = np.argmax(np.nan_to_num(values, nan=-np.inf), axis=0)
    top, top_scatter = (np.take_along_axis(x, best[None], axis=0) for x in (values, scatter))
    rival = np.array([[_cost_ratio_error(each, other) for other in found] for each in found])
    apart = np.exp(np.sqrt(_NORMAL**2 * (scatter**2 + top_scatter**2) + rival[:, best] ** 2))
    with np.errstate(invalid="ignore"):
        equal = (values * apart >= top) | (np.arange(len(found))[:, None, None] == best)
        return {
            "efficiency": values,
            "efficiency_lower": values / spread,
            "efficiency_upper": values * spread,
            "ratio": ratio,
            "ratio_lower": ratio / wide,
            "ratio_upper": ratio * wide,
            "best": equal,
        }


def _cost_error(each: Collected) -> float:
    """Half width of the 95 % interval of the logarithm of a cost."""
    _, relative, batches = each.cost()
    return float(quantile(batches) * relative)


def _cost_ratio_error(one: Collected, other: Collected) -> float:
    """Half width of the same for two costs, from what they were in each turn."""
    if one is other:
        return 0.0
    ratios = np.log(one.each() / other.each())
    if len(ratios) < 2:
        return np.nan
    return float(quantile(len(ratios)) * np.std(ratios, ddof=1) / np.sqrt(len(ratios)))
