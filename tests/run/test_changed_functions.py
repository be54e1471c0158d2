"""A function whose globals, helpers or closure change is another function, as in a notebook."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
from typing import Any

import numba
import numpy as np
import pytest

import smolux as sx
from smolux import processes
from smolux.deterministic.splitting import Splits
from smolux.functions.content import digest, frozen, is_frozen
from smolux.jit.compile import user_piece
from smolux.stochastic.make_plan import make_plan
from smolux.stochastic.time_windows import time_windows_for

slow = pytest.mark.slow
METHODS = [
    pytest.param(m.name, marks=() if m.name == "acceptance-rejection" else slow)
    for m in sx.methods.METHODS
]

CELL = "def K(i, j):\n    return a * (i + j) / 2000\n"

height = 0.5


def helper(x: float) -> float:
    return height * x if x > 0.0 else 0.0


compiled_helper = numba.njit(helper)


def by_helper(i: float, j: float) -> float:
    return helper(i + j)


def by_compiled(i: float, j: float) -> float:
    return compiled_helper(i + j)


def reads_itself(x: float) -> float:
    return x if x < 2.0 else height * reads_itself(x - 1.0)


def in_time(t: float) -> float:
    return height + 0.0 * t


def splits(i: float, j: float) -> float:
    return height / (i + j)


def density(K: Any, method: str) -> float:
    model = sx.Model(sx.kernels.from_function(K), initial=sx.initial.monodisperse(size=1000))
    ds = sx.simulate(
        model, [1.0], particles=1000, replicas=4, seed=1, population="fixed-volume", method=method
    )
    return float(ds["number_density"].mean())


@pytest.mark.parametrize("method", METHODS)
def test_a_cell_that_is_run_again_is_what_runs(method: str) -> None:
    # the number density is exp(-a t/2); four replicas give it to 0.007
    space: dict[str, Any] = {"a": 0.5, "__name__": "notebook"}
    exec(CELL, space)
    assert density(space["K"], method) == pytest.approx(np.exp(-0.25), abs=0.03)
    space["a"] = 2.0
    changed = density(space["K"], method)
    assert changed == pytest.approx(np.exp(-1.0), abs=0.03)
    exec(CELL, space)
    assert density(space["K"], method) == changed


NEW_PROCESS = """
import json, sys
import smolux as sx
from smolux.jit.compile import statistics
space = {"a": 2.0, "__name__": "notebook"}
exec(sys.argv[1], space)
model = sx.Model(sx.kernels.from_function(space["K"]), initial=sx.initial.monodisperse(size=1000))
ds = sx.simulate(
    model, [1.0], particles=1000, replicas=4, seed=1, population="fixed-volume", method=sys.argv[2]
)
print(json.dumps([float(ds["number_density"].mean()), statistics["hits"]]))
"""


def test_a_new_process_finds_the_code_of_what_it_has_seen() -> None:
    method, space = "acceptance-rejection", {"a": 0.5, "__name__": "notebook"}
    exec(CELL, space)
    density(space["K"], method)
    space["a"] = 2.0
    here = density(space["K"], method)
    command = [sys.executable, "-c", NEW_PROCESS, CELL, method]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    # what this process has compiled for the changed function is what that one runs
    assert json.loads(done.stdout) == [here, 1]
    assert here == pytest.approx(np.exp(-1.0), abs=0.03)


def call(function: Any, x: float) -> float:
    """Call a compiled piece, which has no wrapper for Python."""
    piece = user_piece(frozen(function))

    @numba.njit
    def outer(x: float) -> float:
        return piece(x, 1.0)

    return float(outer(x))


@pytest.mark.parametrize("K", [by_helper, by_compiled])
def test_helpers_are_those_of_now(K: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    sizes = np.arange(1.0, 99.0)
    for value in (0.5, 3.0):
        monkeypatch.setitem(globals(), "height", value)
        assert call(K, 3.0) == 4.0 * value
        kernel = sx.kernels.from_function(K)
        np.testing.assert_array_equal(kernel(sizes, 1.0), value * (sizes + 1.0))
        assert float(kernel(1.0, 1.0)) == 2.0 * value


def test_a_function_that_calls_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(globals(), "height", 3.0)
    assert frozen(reads_itself)(4.5) == 3.0**3 * 1.5
    monkeypatch.setitem(globals(), "height", 2.0)
    assert frozen(reads_itself)(4.5) == 2.0**3 * 1.5


def test_what_is_frozen_does_not_change(monkeypatch: pytest.MonkeyPatch) -> None:
    now = frozen(by_helper)
    assert is_frozen(now)
    assert frozen(by_helper) is frozen(now) is now
    monkeypatch.setitem(globals(), "height", 3.0)
    assert now(1.0, 1.0) == 1.0
    other = frozen(by_helper)
    assert other is not now
    assert other(1.0, 1.0) == 6.0
    monkeypatch.setitem(globals(), "height", 0.5)
    assert frozen(by_helper) is now


def test_a_list_that_is_read_is_that_of_the_start() -> None:
    held = [2.0, 3.0]
    now = frozen(lambda i, j: held[0] * i * j)
    held[0] = 5.0
    assert now(1.0, 1.0) == 2.0


def test_attributes_of_classes_and_objects_are_content() -> None:
    class Settings:
        width = 1.0

    def K(i: float, j: float) -> float:
        return Settings.width * (i + j)

    before = digest(K)
    Settings.width = 2.0
    assert digest(K) != before


def test_bounds_in_time_are_those_of_now(monkeypatch: pytest.MonkeyPatch) -> None:
    for value in (0.0, 5.0):
        monkeypatch.setitem(globals(), "height", value)
        kinds = [processes.Aggregation(), processes.Source(1.0, varying=in_time)]
        plan = planned(sx.Model(sx.kernels.Constant(), kinds))
        windows = time_windows_for(plan.model.processes, 1.0)
        assert windows.bounds[:-1, 1].min() >= value
        assert windows.bounds[:-1, 1].max() <= 1.2 * value


def planned(model: sx.Model) -> Any:
    return make_plan(
        model, [1.0], method="inverse", particles=100, replicas=2, seed=1, orders=(0, 1), sizes=8
    )


def test_the_solver_sees_the_change(monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    for value in (0.5, 3.0):
        monkeypatch.setitem(globals(), "height", value)
        kinds = [processes.Aggregation(), processes.Fragmentation(splits)]
        model = sx.Model(sx.kernels.from_function(by_helper), kinds)
        written = [processes.Aggregation(), processes.Fragmentation(f"{value}/(i + j)")]
        same = sx.Model(sx.kernels.formula(f"{value}*(i + j)"), written)
        one, other = (sx.solve(m, [0.05], window=64, method="direct") for m in (model, same))
        np.testing.assert_allclose(one["n"], other["n"], rtol=1e-9, atol=1e-14)
        found.append(float(one["number_density"].item()))
    assert found[0] != pytest.approx(found[1], rel=0.01)


def test_rates_asked_for_outside_a_run_see_the_change(monkeypatch: pytest.MonkeyPatch) -> None:
    process = processes.Fragmentation(splits)
    sizes, found = np.arange(1.0, 9.0), []
    for value in (0.5, 3.0):
        monkeypatch.setitem(globals(), "height", value)
        terms = Splits(process.daughters.law, 8)
        found.append((terms.rates / value, terms.gain(sizes[None, :])[0] / value))
    np.testing.assert_allclose(*found, rtol=1e-12)


def test_a_plan_is_sent_by_value(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(globals(), "height", 3.0)
    sent = pickle.dumps(planned(sx.Model(sx.kernels.from_function(by_helper))))
    monkeypatch.setitem(globals(), "height", 0.5)
    assert float(pickle.loads(sent).model.kernel(1.0, 1.0)) == 6.0


listed = [1.0, 2.0]


def of_a_list(i: float, j: float) -> float:
    return listed[0] * (i + j)


def a_truth(i: float, j: float) -> bool:
    return i + j > 0.0


def test_what_cannot_be_compiled_is_said_in_a_line() -> None:
    with pytest.raises(sx.InputError, match=r"the kernel 'of_a_list': .*arrays or tuples") as found:
        density(of_a_list, "acceptance-rejection")
    assert len(str(found.value).splitlines()) == 1


def test_a_truth_value_is_a_number() -> None:
    piece = user_piece(frozen(a_truth))
    outer = numba.njit(lambda i, j: piece(i, j))
    assert outer(1.0, 2.0) == 1.0
    assert outer.nopython_signatures[0].return_type == numba.float64
    assert sx.kernels.from_function(a_truth)([1.0, 2.0], 1.0).dtype == float


@slow
def test_a_truth_value_is_a_rate() -> None:
    model = sx.Model(sx.kernels.from_function(a_truth))
    ds = sx.simulate(
        model, [2.0], particles=2000, replicas=4, seed=1, method="acceptance-rejection"
    )
    assert float(ds["number_density"].mean()) == pytest.approx(0.5, abs=0.03)
