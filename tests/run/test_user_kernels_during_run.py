"""What a user's kernel or rate gets wrong only where the run arrives, and what then happens."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import runs
from scipy import stats

import smolux as sx
from shared import QUICK, extinction
from smolux.core.state import BY_FACTOR, BY_KERNEL, DONE, EVENTS, EXTINCT, REPAIRS, TIME
from smolux.errors import InputError, SmoluxWarning
from smolux.functions.time import TimeFunction
from smolux.kernels.formula_kernel import FormulaKernel
from smolux.runtime import files
from smolux.stochastic import assembly
from smolux.stochastic.replicas import Group

every_method = pytest.mark.parametrize(
    "method",
    [pytest.param(m, marks=() if m in QUICK else pytest.mark.slow) for m in runs.METHODS],
)
#: few buckets: a table for the many that are usual would be a million calls from Python
SETTINGS = {"inverse": sx.methods.Inverse(buckets=64)}
#: the square of 21, a size that no sample holds: it is not among the numbers that `odd` reads
SQUARE = 441.0


def odd(
    i: float, j: float, square: float = SQUARE, value: float = 1.0, total: float = 0.0,
    rest: float = 1.0,
) -> float:  # fmt: skip
    """Constant, but for pairs with one size; `value` above 8 stands for what is no number.

    Or constant for pairs of one `total`, and the `rest` for all others.
    """
    if i * i == square or j * j == square:
        if value == 9.0:
            return math.nan
        if value == 10.0:
            return math.inf
        return value
    return 1.0 if i + j == total else rest


def spike(t: float, low: float = 0.0, high: float = 0.0) -> float:
    # at t = 0.32706, which it does not name, and narrower than the distance of the samples
    if abs(t * t - 0.1069682) < 3.3e-5:
        return high
    return low


def rate(low: float, high: float) -> TimeFunction:
    """The spike with values as data, so that all tests here need one loop a method."""
    return replace(TimeFunction.of(spike), parameters=(low, high))


def model(value: float, bounds: Any = None, low: float = 0.0, high: float = 0.0) -> sx.Model:
    processes = [sx.processes.Aggregation(), sx.processes.Shattering(rate(low, high))]
    return sx.Model(sx.kernels.from_function(odd, value=value, bounds=bounds), processes)


def simulate(value: float, method: str, bounds: Any = None, **settings: Any) -> Any:
    given = {"particles": 2000, "replicas": 2, "seed": 5, "sizes": 40}
    chosen = SETTINGS.get(method, method)
    return sx.simulate(model(value, bounds), [30.0], method=chosen, **given | settings)


def one(*box: float) -> tuple[float, float]:
    return 1.0, 1.0


def below_one(*box: float) -> tuple[float, float]:
    return 0.0, 1.0


def eight(*box: float) -> tuple[float, float]:
    return 0.0, 8.0


@pytest.mark.parametrize(("value", "text"), [(9.0, "nan"), (10.0, "inf"), (-1.0, "-1")])
@every_method
def test_no_rate(method: str, value: float, text: str) -> None:
    # stated bounds: the values are seen by the method itself, whatever bounds are found
    with pytest.raises(InputError) as caught:
        simulate(value, method, eight)
    (message,) = caught.value.problems
    assert "'odd'" in message
    assert f"gave {text} " in message
    sizes = re.search(r"for the sizes (\d+) and (\d+)", message)
    assert sizes is not None
    assert 21 in map(int, sizes.groups())
    met = re.search(r"met at t = ([\d.e+-]+);", message)
    assert met is not None
    assert 0.0 < float(met[1]) < 30.0


@pytest.mark.parametrize("value", [9.0, 10.0, -1.0])
@every_method
def test_no_rate_where_bounds_are_sampled(method: str, value: float) -> None:
    with pytest.raises(InputError) as caught:
        simulate(value, method)
    (message,) = caught.value.problems
    assert re.search(r"sizes \d+ (and|to) \d+", message)
    assert "t = " in message


@extinction
@every_method
def test_a_size_that_is_never_reached_is_no_obstacle(method: str) -> None:
    ds = simulate(9.0, method, eight, particles=20, population="none")
    assert not any("above its bound" in w for w in sx.results.warnings(ds))


@pytest.mark.parametrize("bounds", [below_one, one])
@every_method
def test_bounds_that_do_not_hold_are_repaired(method: str, bounds: Any) -> None:
    right = simulate(8.0, method, eight)
    if method == "inverse":  # needs no bounds
        runs.assert_same(right, simulate(8.0, method, bounds))
        return
    with pytest.warns(SmoluxWarning, match="above its bound") as told:
        ds = simulate(8.0, method, bounds)
    (warning,) = sx.results.warnings(ds)
    assert [str(w.message) for w in told] == [warning]
    assert [w.filename for w in told] == [__file__]
    sizes = re.search(r"at the sizes (\d+) and (\d+)", warning)
    assert sizes is not None
    assert 21 in map(int, sizes.groups())
    # repaired, not ignored: the many collisions of this size take place
    a, b, plain = (float(x["n"].sel(size=21).mean()) for x in (ds, right, simulate(1.0, method)))
    assert abs(a - b) < 0.5 * (plain - b) + 1e-12


def test_a_size_that_breaks_one_bound_is_tried_with_all_classes() -> None:
    """Bounds of each pair of classes fail by themselves; one by one that took 4 to 9 repairs."""
    plan = runs.plan(model(8.0, below_one), [30.0], "size-class", particles=2000)
    group = Group.start(plan, 0, 20)
    group.advance(lambda: False)
    repairs = group.state.count[:, REPAIRS]
    assert repairs.min() >= 1
    assert repairs.max() <= 3


@every_method
def test_what_one_replica_repairs_changes_no_other(method: str) -> None:
    plan = runs.plan(model(8.0, one), [30.0], SETTINGS.get(method, method), particles=2000)
    found = []
    for parts in ([(0, 4)], [(k, 1) for k in range(4)]):
        groups = [Group.start(plan, *part) for part in parts]
        for group in groups:
            group.advance(lambda: False)
        found.append(np.concatenate([group.state.events for group in groups]))
    np.testing.assert_array_equal(*found)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "weighting"),
    [
        (sx.methods.AcceptanceRejection, "number"),
        (sx.methods.AcceptanceRejection, "mass-flow"),
        (sx.methods.SizeClass, "number"),
        (sx.methods.SizeClass, sx.weighting.WeightFunction(0.5)),
    ],
)
def test_events_in_a_row_are_those_of_the_loop(
    monkeypatch: pytest.MonkeyPatch, method: Any, weighting: Any
) -> None:
    """With repairs, shattering and doubling on the way, whole states are the same bit for bit."""
    bind, kernel = method.bind, sx.kernels.from_function(odd, value=8.0, bounds=below_one)
    physics = sx.Model(kernel, [sx.processes.Aggregation(), sx.processes.Shattering(0.05)])
    states = []
    for burst in (True, False):
        if not burst:
            plain = staticmethod(lambda *given: bind(*given)._replace(burst=None))
            monkeypatch.setattr(method, "bind", plain)
            monkeypatch.setattr(assembly, "_loops", {})
        plan = runs.plan(physics, [3.0, 30.0], method.name, weighting=weighting, particles=2000)
        group = Group.start(plan, 0, 2)
        group.advance(lambda: False)
        states.append(group.state)
    assert states[0].count[0, REPAIRS] > 0
    assert (states[0].events > 100).all()
    for name, values in states[0]._asdict().items():
        np.testing.assert_array_equal(values, getattr(states[1], name), name)


@pytest.mark.parametrize("sizes", [(500, 501), (37, 41)])
@every_method
def test_two_sizes_that_meet(method: str, sizes: tuple[int, int]) -> None:
    """Nothing else does: the rate is one for one sum of sizes only, which the user states."""
    total = float(sum(sizes))
    kernel = sx.kernels.from_function(odd, square=0.0, total=total, rest=1e-9, breakpoints=[total])
    physics = sx.Model(
        kernel, model(1.0).processes, sx.initial.from_sizes(dict.fromkeys(sizes, 0.5))
    )
    ds = sx.simulate(
        physics, [1.0], particles=1000, replicas=8, seed=1, method=SETTINGS.get(method, method)
    )
    # of both there are 1/2 / (1 + t/2), and one particle less for each that is gone
    mean = float(ds["number_density"].mean())
    assert abs(mean - 5 / 6) < 4.5 * 0.3 / np.sqrt(8 * 1000)


# --- rates of processes --------------------------------------------------------------------------


def with_rate(low: float, high: float, method: str, end: float = 0.5, **settings: Any) -> Any:
    given = {"particles": 200_000, "replicas": 2, "seed": 5, "sizes": 40}
    chosen, times = SETTINGS.get(method, method), [0.4 * end, end]
    return sx.simulate(model(1.0, one, low, high), times, method=chosen, **given | settings)


@every_method
def test_a_rate_above_its_sampled_bound_is_repaired(method: str) -> None:
    with pytest.warns(SmoluxWarning, match="above its sampled bound"):
        ds = with_rate(1.0, 5.0, method)
    (warning,) = sx.results.warnings(ds)
    assert "shattering" in warning
    assert "spike" in warning
    assert "of 2 replicas" in warning
    with pytest.warns(SmoluxWarning, match="in 1 of 1 replicas"):
        alone = with_rate(1.0, 5.0, method, replicas=1)
    runs.assert_same(ds, alone)


@every_method
def test_a_rate_that_turns_negative_where_it_was_not_tried(method: str) -> None:
    with pytest.raises(InputError) as caught:
        with_rate(1.0, -1.0, method)
    (message,) = caught.value.problems
    assert "shattering, spike, is -1 at t = 0.32" in message
    assert "zero or more" in message
    # not if the run ends before
    assert sx.results.warnings(with_rate(1.0, -1.0, method, 0.2, particles=100, replicas=1)) == []


def test_a_rate_that_is_seen_to_turn_negative() -> None:
    with pytest.raises(InputError, match=r"is -0\.\d+ at t = 0\.\d+") as caught:
        sx.simulate(runs.model("0.1 - t"), [0.2, 0.5], method=runs.METHODS[0])
    assert "shattering" in str(caught.value)


# --- what was raised stays raised, when a run goes on ---------------------------------------------


class Low(FormulaKernel):
    """A law that is one half at most by what is stated."""

    rigorous = False

    def bounds(self, a: Any, b: Any, c: Any, d: Any) -> tuple[Any, Any]:
        shape = np.broadcast(a, b, c, d).shape
        return np.zeros(shape), np.full(shape, 0.5)


def in_pieces(group: Group, path: Path, budget: int, look: Any) -> Group:
    """Advance each replica by so many candidates, then write and read all; `look` in between."""
    while not group.done:
        for r in np.flatnonzero(group.codes != DONE):
            alone = np.full(len(group.codes), DONE)
            alone[r] = group.codes[r]
            group._call(alone, budget)
            group.codes[r] = alone[r]
        group._serve()
        look(group)
        group = runs.written(group, path)
    return group


def assert_same_end(one: Group, other: Group) -> None:
    for kind in ("state", "tally"):
        for name, values in getattr(one, kind)._asdict().items():
            np.testing.assert_array_equal(values, getattr(getattr(other, kind), name), name)


def test_a_raised_bound_of_the_kernel_lasts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four particles with K = 1; the first candidate is above the bound and raises it.

    Then three are left in the volume four, and merge at the rates 3/4 and 1/4 whatever was stated.
    """
    monkeypatch.setattr(files, "_sync", lambda *_: None)  # nothing here is to last
    known = runs.model(0.0, sx.initial.monodisperse(), c1=0.0)
    law = known.kernel
    assert isinstance(law, FormulaKernel)
    physics = replace(known, kernel=Low(law.expression, law.names, law.values))
    plan = runs.plan(
        physics, [4.0, 1e6], "acceptance-rejection", population="none", particles=4, sizes=4,
        replicas=400, bins_per_octave=1,
    )  # fmt: skip
    whole = Group.start(plan, 0, plan.replicas)
    whole.advance(lambda: False)
    first = np.full(plan.replicas, np.nan)

    def look(group: Group) -> None:
        one = group.state.count[:, EVENTS] == 1
        first[one] = group.state.clock[one, TIME]

    group = in_pieces(Group.start(plan, 0, plan.replicas), tmp_path / "run.npz", 1, look)
    assert_same_end(whole, group)
    rest = (group.state.clock[:, EXTINCT] - first) / 4.0
    exact = stats.kstest(rest, lambda t: 1 - 1.5 * np.exp(-t) + 0.5 * np.exp(-3 * t))
    assert exact.pvalue > 1e-4
    assert (group.tally.counts[:, 1] == [0, 0, 0, 0, 1]).all()  # output after the extinction
    # every pair was missed as often as it was met, until one was
    np.testing.assert_allclose(group.state.missed[:, BY_KERNEL], 1.0)


@extinction
def test_a_raised_bound_of_a_factor_leaves_the_others_their_rates() -> None:
    """Two monomers merge at the rate 1/2; that they shatter twice as often as stated is nothing."""
    stated = replace(rate(1.0, 1.0), stated=(0.0, 0.5))
    processes = [sx.processes.Aggregation(), sx.processes.Shattering(stated)]
    with pytest.warns(SmoluxWarning, match="in 1... of 4000 replicas"):
        ds = sx.simulate(
            sx.Model(sx.kernels.from_function(odd, bounds=one), processes), [1e6], seed=8, sizes=1,
            method="acceptance-rejection", population="fixed-volume", particles=2, replicas=4000,
            bins_per_octave=1,
        )  # fmt: skip
    assert stats.kstest(ds["extinction_time"], stats.expon(scale=2.0).cdf).pvalue > 1e-4


def test_a_raised_bound_of_a_factor_lasts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Dimers that merge or shatter, both at the rate one, of which one half is stated.

    From the first that shatters on, as many shatter as merge.
    """
    monkeypatch.setattr(files, "_sync", lambda *_: None)
    stated = replace(rate(1.0, 0.0), stated=(0.0, 0.5))
    processes = [sx.processes.Aggregation(), sx.processes.Shattering(stated)]
    dimers = sx.initial.monodisperse(size=2)
    physics = sx.Model(sx.kernels.from_function(odd, bounds=one), processes, dimers)
    plan = runs.plan(
        physics, [1.0], "acceptance-rejection", population="none", particles=6, sizes=4,
        replicas=200, bins_per_octave=1,
    )  # fmt: skip
    whole = Group.start(plan, 0, plan.replicas)
    whole.advance(lambda: False)
    before = np.zeros((plan.replicas, 2), int)

    def look(group: Group) -> None:
        none = before[:, 1] == 0
        before[none] = group.state.events[none]

    group = in_pieces(Group.start(plan, 0, plan.replicas), tmp_path / "run.npz", 4, look)
    assert_same_end(whole, group)
    raised = before[:, 1] > 0
    merged, shattered = (group.state.events - before)[raised].T
    excess = merged - shattered
    assert raised.sum() > 80
    assert abs(excess.mean()) < 4.5 * excess.std() / np.sqrt(len(excess))
    # for the one that shattered by the bound one did not
    np.testing.assert_allclose(group.state.missed[raised, BY_FACTOR + 1], 1.0)
