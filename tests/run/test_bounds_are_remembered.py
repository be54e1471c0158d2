"""Bounds are found once for all groups and runs, and never remembered of what may have changed."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import runs

import smolux as sx
from smolux.functions.law import Law
from smolux.kernels import Additive
from smolux.runtime import files
from smolux.stochastic import bounds_cache, tables
from smolux.stochastic.rates import rates_for
from smolux.weighting import MassFlow, Number, WeightFunction

BOXES = [np.array(side, float) for side in ([1, 2, 9], [1, 3, 11], [2, 2, 40], [4, 3, 47])]
height = 1.0


@pytest.fixture(autouse=True)
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    """Begin with nothing that is remembered; compiled code is where it always is."""
    monkeypatch.setattr(bounds_cache, "cache_directory", lambda: tmp_path)
    forget()
    yield tmp_path / "bounds"
    forget()


def forget() -> None:
    """Forget all, as a new process does."""
    bounds_cache._bounds_of.cache_clear()
    tables.latest.forget()


def step(i: float, j: float) -> float:
    return height * (i + j)


def weight(size: Any) -> Any:
    return height * size


@pytest.mark.parametrize("weighting", [Number(), MassFlow(), WeightFunction(0.5)])
def test_the_second_time_bounds_are_the_same_and_nothing_is_proved(
    monkeypatch: pytest.MonkeyPatch, weighting: Any
) -> None:
    kernel, calls = Additive(0.25), []
    plain = type(weighting).bounds

    def counted(self: Any, kernel: Any) -> Any:
        found = plain(self, kernel)
        return lambda *box: calls.append(box) or found(*box)

    monkeypatch.setattr(type(weighting), "bounds", counted)
    first, second = (rates_for(sx.Model(kernel), weighting).bounds(*BOXES) for _ in range(2))
    assert len(calls) == 1
    for one, other, right in zip(first, second, plain(weighting, kernel)(*BOXES), strict=True):
        np.testing.assert_array_equal(one, right)
        np.testing.assert_array_equal(other, right)
        one[:] = 0.0  # what is given away is a copy
    np.testing.assert_array_equal(
        rates_for(sx.Model(kernel), weighting).bounds(*BOXES)[0], second[0]
    )
    other_boxes = [side + 1.0 for side in BOXES]
    assert (rates_for(sx.Model(kernel), weighting).bounds(*other_boxes)[1] != second[1]).all()


@pytest.mark.parametrize("weighting", [Number(), WeightFunction(weight)])
def test_what_a_function_reads_may_change(monkeypatch: pytest.MonkeyPatch, weighting: Any) -> None:
    kernel = sx.kernels.from_function(step)
    before = rates_for(sx.Model(kernel), weighting).bounds(*BOXES)[1]
    monkeypatch.setitem(globals(), "height", 2.0)
    factor = 2.0 if isinstance(weighting, Number) else 1.0  # twice the kernel, half the factor
    after = rates_for(sx.Model(kernel), weighting).bounds(*BOXES)[1]
    np.testing.assert_allclose(after, factor * before)


def test_laws_and_weightings_are_told_apart() -> None:
    """On disk, and in the table that was made last."""
    formula, sizes = sx.kernels.formula, np.arange(1.0, 6.0)
    kernels = formula("a*(i + j)", a=1.0), formula("a*(i + j)", a=2.0), formula("i*j")
    weightings = Number(), WeightFunction(0.5)
    # of the latest table the one differs by its weighting, or else by its kernel
    orders = (
        [(k, w) for k in kernels for w in weightings],
        [(k, w) for w in weightings for k in kernels],
    )
    for kinds in orders:  # the second time they are read
        for kernel, weighting in kinds:
            rates, right = rates_for(sx.Model(kernel), weighting), weighting.bounds(kernel)
            for found, expected in zip(rates.bounds(*BOXES), right(*BOXES), strict=True):
                np.testing.assert_array_equal(found, expected)
            np.testing.assert_array_equal(rates.table(5), rates.arrays(sizes[:, None], sizes))
        forget()


def test_no_more_than_some_are_remembered() -> None:
    rates = rates_for(sx.Model(Additive(0.125)), MassFlow())
    for k in range(1, 80):
        lower, upper = rates.bounds(*(side + k for side in BOXES))
        assert (lower <= upper).all()
    kept = rates.bounds.__wrapped__  # type: ignore[attr-defined]
    assert len(kept._known) <= bounds_cache._MOST


# --- on disk -------------------------------------------------------------------------------------


def slip(i: float, j: float, scale: float = 1.0) -> float:
    """A smooth law whose intervals are wide: radii, slip and diffusion of each, then of both."""
    a, b = i ** (1 / 3), j ** (1 / 3)
    one = (1 + (1.257 + 0.4 * math.exp(-1.1 * a)) / a) / a
    two = (1 + (1.257 + 0.4 * math.exp(-1.1 * b)) / b) / b
    jump = ((2 * a + one) ** 3 - (4 * a * a + one * one) ** 1.5) / (6 * a * one) - 2 * a
    other = ((2 * b + two) ** 3 - (4 * b * b + two * two) ** 1.5) / (6 * b * two) - 2 * b
    reach, spread = a + b, math.sqrt(jump * jump + other * other)
    return scale * (one + two) * reach / (reach / (reach + spread) + 0.1 * (one + two) / reach)


def pairs_of_classes() -> list[np.ndarray]:
    """Boxes as the size-class method asks for."""
    edges = np.unique(np.rint(2.0 ** (np.arange(2, 17) / 2)))
    g, h = np.triu_indices(len(edges) - 1)
    return [edges[g], edges[g + 1] - 1, edges[h], edges[h + 1] - 1]


class Looked:
    """Counts how often bounds are looked for, and in how many cells."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.calls = self.cells = 0
        plain = Law.interval

        def counted(law: Any, i: Any, j: Any) -> Any:
            if np.size(i.lo) > 1:  # else it is asked whether there are bounds at all
                self.calls, self.cells = self.calls + 1, self.cells + np.size(i.lo)
            return plain(law, i, j)

        monkeypatch.setattr(Law, "interval", counted)


def rates_of(kernel: Any, weighting: Any) -> Any:
    """Return rates without the checks of a model, which look at the law, too."""
    return rates_for(SimpleNamespace(kernel=kernel), weighting)  # type: ignore[arg-type]


def found(kernel: Any, boxes: Any, weighting: Any = None) -> np.ndarray:
    return np.array(rates_of(kernel, weighting or Number()).bounds(*boxes))


def test_few_cells_are_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was a million cells, and bounds far off."""
    kernel, boxes = sx.kernels.from_function(slip), pairs_of_classes()
    looked = Looked(monkeypatch)
    lower, upper = kernel.bounds(*boxes)
    assert looked.calls < 12
    assert looked.cells < 60_000
    a, b, c, d = (side[:, None, None] for side in boxes)
    share = np.linspace(0, 1, 15)
    values = kernel(a * (b / a) ** share[:, None], c * (d / c) ** share).reshape(len(upper), -1)
    assert (values <= upper[:, None]).all()
    assert (values >= lower[:, None]).all()
    assert (upper <= 1.025 * values.max(axis=1)).all()
    assert (lower >= 0.95 * values.min(axis=1)).all()


@pytest.mark.parametrize("weighting", [Number(), WeightFunction(0.5)])
def test_a_new_process_looks_for_nothing(
    monkeypatch: pytest.MonkeyPatch, folder: Path, weighting: Any
) -> None:
    kernel, boxes, looked = sx.kernels.from_function(slip), pairs_of_classes(), Looked(monkeypatch)
    first = found(kernel, boxes, weighting)
    (file,) = folder.iterdir()
    calls = looked.calls
    assert calls
    forget()
    np.testing.assert_array_equal(found(kernel, boxes, weighting), first)
    assert looked.calls == calls
    for damaged in (b"", file.read_bytes()[:-8], file.read_bytes()[:-1] + b"x"):
        forget()
        file.write_bytes(damaged)
        np.testing.assert_array_equal(found(kernel, boxes, weighting), first)
        assert looked.calls > calls  # found afresh, and written
        calls = looked.calls
        forget()
        np.testing.assert_array_equal(found(kernel, boxes, weighting), first)
        assert looked.calls == calls


def test_what_is_asked_for_and_no_more(folder: Path) -> None:
    kernel = sx.kernels.from_function(slip)
    found(kernel, BOXES)
    assert len(list(folder.iterdir())) == 1
    found(kernel, [side + 1.0 for side in BOXES])
    assert len(list(folder.iterdir())) == 2
    found(sx.kernels.from_function(slip, scale=2.0), BOXES)
    assert len(list(folder.iterdir())) == 3
    found(kernel, BOXES, MassFlow())
    assert len(list(folder.iterdir())) == 4
    # analysis is no search, and a class of the user may be anything
    mine = type("Mine", (type(kernel),), {"__module__": "mine"})
    found(Additive(0.25), BOXES)
    found(mine(kernel.user, kernel.values), BOXES)
    found(sx.kernels.from_function(slip, bounds=lambda *box: (0.0, 1e3)), BOXES)
    assert len(list(folder.iterdir())) == 4


@pytest.mark.parametrize("weighting", [Number(), WeightFunction(weight)])
def test_what_a_function_reads_is_part_of_what_is_kept(
    monkeypatch: pytest.MonkeyPatch, weighting: Any
) -> None:
    kernel = sx.kernels.from_function(step)
    before = found(kernel, BOXES, weighting)
    forget()
    monkeypatch.setitem(globals(), "height", 2.0)
    factor = 2.0 if isinstance(weighting, Number) else 1.0
    np.testing.assert_allclose(found(kernel, BOXES, weighting), factor * before)


def test_other_code_finds_its_own(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    kernel = sx.kernels.from_function(slip)
    for decides in ("_code", "_machine"):
        found(kernel, BOXES)
        before = set(folder.iterdir())
        forget()
        monkeypatch.setattr(bounds_cache, decides, lambda decides=decides: f"another {decides}")
        found(kernel, BOXES)
        assert len(set(folder.iterdir()) - before) == 1
        forget()


@pytest.mark.parametrize("where", ["a file", "off"])
def test_without_a_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, where: str) -> None:
    kernel = sx.kernels.from_function(slip)
    right = kernel.bounds(*BOXES)
    (tmp_path / "file").write_text("")
    given = tmp_path / "file" if where == "a file" else None
    monkeypatch.setattr(bounds_cache, "cache_directory", lambda: given)
    np.testing.assert_array_equal(found(kernel, BOXES), right)


def test_the_folder_does_not_grow_without_end(
    monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    kernel = sx.kernels.from_function(step)
    monkeypatch.setattr(bounds_cache, "_MOST_FILES", 6)
    monkeypatch.setattr(bounds_cache, "_BETWEEN", 1)
    folder.mkdir()
    for name, age in ((".old.01234567", 2.0 * files._STALE_SECONDS), (".new.01234567", 0.0)):
        left = folder / name
        left.write_text("")
        os.utime(left, (time.time() - age,) * 2)
    for k in range(20):
        found(kernel, [side + k for side in BOXES])
        assert len(list(folder.iterdir())) <= 7
    unfinished = [f.name for f in folder.iterdir() if f.name.startswith(".")]
    assert unfinished == [".new.01234567"]


def test_threads_wait_for_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel, boxes, looked = sx.kernels.from_function(slip), pairs_of_classes(), Looked(monkeypatch)
    right = kernel.bounds(*boxes)
    alone, looked.calls = looked.calls, 0
    bounds = rates_of(kernel, Number()).bounds
    with ThreadPoolExecutor(4) as pool:
        for one in pool.map(lambda _: bounds(*boxes), range(8)):
            np.testing.assert_array_equal(one, right)
    assert looked.calls == alone


@pytest.mark.parametrize("method", ["size-class", "acceptance-rejection"])
def test_runs_are_the_same_bit_for_bit(folder: Path, method: str) -> None:
    given = {"method": method, "weighting": "number", "particles": 150, "replicas": 3, "seed": 5}
    first = sx.simulate(runs.model(), [1.0, 3.0], **given)
    assert list(folder.iterdir())
    forget()
    runs.assert_same(first, sx.simulate(runs.model(), [1.0, 3.0], **given))


# --- time and tables -----------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["size-class"])
def test_the_time_is_a_number_of_its_own(monkeypatch: pytest.MonkeyPatch, method: str) -> None:
    ticks = iter(range(10**9))
    monkeypatch.setattr(bounds_cache.time, "thread_time", lambda: float(next(ticks)))
    told: list[Any] = []
    given = {"particles": 150, "replicas": 3, "seed": 5, "progress": told.append}
    ds = sx.simulate(runs.model(), [1.0, 3.0], method=method, **given)
    assert ds.attrs["bounds_seconds"] >= 2.0  # windows of time, and bounds of pairs of classes
    assert told[-1].bounds_seconds == ds.attrs["bounds_seconds"]
    before = bounds_cache.spent()
    runs.plan(runs.model(), [1.0, 3.0], "auto")
    assert bounds_cache.spent() > before


def larger_first(i: float, j: float) -> float:
    if i < j:
        i, j = j, i
    return 1.0 + math.sqrt(i) / j


class Asked:
    """Counts the pairs for which a law is called from Python."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.calls = self.pairs = 0
        plain = sx.kernels.FunctionKernel.__call__

        def counted(kernel: Any, i: Any, j: Any) -> Any:
            self.calls, self.pairs = self.calls + 1, self.pairs + np.broadcast(i, j).size
            return plain(kernel, i, j)

        monkeypatch.setattr(sx.kernels.FunctionKernel, "__call__", counted)


def test_large_tables_of_functions_without_arrays_are_compiled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kernel, sizes = sx.kernels.from_function(larger_first), np.arange(1.0, 181)
    assert not kernel.takes_arrays
    right, asked = kernel(sizes[:, None], sizes), Asked(monkeypatch)
    np.testing.assert_allclose(rates_of(kernel, Number()).table(180), right, rtol=1e-14)
    assert asked.pairs == 0
    weighted = rates_of(kernel, MassFlow()).table(180)
    np.testing.assert_allclose(weighted, right * (1 / sizes[:, None] + 1 / sizes), rtol=1e-14)
    assert asked.pairs == 0
    rates_of(kernel, Number()).table(20)  # too few to compile for
    assert asked.pairs == 400


def test_every_group_has_the_same_table(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel, asked = sx.kernels.from_function(step), Asked(monkeypatch)
    one, two = (rates_of(kernel, Number()).table(20) for _ in range(2))
    assert asked.calls == 1
    one[:] = 0.0  # what is given away is a copy
    assert (two > 0.0).all()
    monkeypatch.setitem(globals(), "height", 2.0)
    np.testing.assert_array_equal(rates_of(kernel, Number()).table(20), 2.0 * two)
