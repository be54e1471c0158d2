"""A grid of runs: what is swept over, what is kept, what fails, what goes on."""

from __future__ import annotations

import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import smolux as sx
from shared import FORMULA
from smolux.errors import InputError, Interrupted
from smolux.sweeps import Folder, grid, read_axes
from smolux.sweeps.points import derived, make_sweep

CASE = f"""\
title = "grid"
[kernel]
formula = "{FORMULA}"
c0 = 1.0
c1 = 0.5
c2 = 0.0
c3 = 0.0
[[processes]]
name = "aggregation"
[[processes]]
name = "shattering"
rate = 0.1
[run]
times = [0.5, 1]
particles = 150
replicas = 3
seed = 7
sizes = 32
method = "acceptance-rejection"
"""
OVER = {"kernel.c1": [0.5, 0.25], "processes.shattering.rate": [0.1, 0.2, 0.3]}


@pytest.fixture
def case(tmp_path: Path) -> Path:
    file = tmp_path / "case.toml"
    file.write_text(CASE)
    return file


def values(over: Any) -> Any:
    return {axis.key: list(axis.values) for axis in read_axes(over)}


# --- what is swept over --------------------------------------------------------------------------


def test_lists_and_ranges() -> None:
    assert values(
        ["kernel.a=0.5:1:11", "x.y=1e-3:1e-1:5:log", "run.method=inverse, acceptance-rejection"]
    ) == {
        "kernel.a": [0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.0],
        "x.y": [0.001, 0.00316227766017, 0.01, 0.0316227766017, 0.1],
        "run.method": ["inverse", "acceptance-rejection"],
    }
    assert values(["a.b=1,2.5,3e2"]) == {"a.b": [1, 2.5, 300.0]}
    assert values(["a.b=2:1:3"]) == {"a.b": [2.0, 1.5, 1.0]}
    assert values(["a.b=7"]) == {"a.b": [7]}
    assert values(['a.b="0.1, 2", min(t, 2), [1, 2]']) == {"a.b": ["0.1, 2", "min(t, 2)", [1, 2]]}
    assert values(["a.b=1 m^3, 2 m^3"]) == {"a.b": ["1 m^3", "2 m^3"]}
    assert values({"a.b": np.array([1.0, 2.0]), "c.d": "1:2:2", "e.f": 3}) == {
        "a.b": [1.0, 2.0], "c.d": [1.0, 2.0], "e.f": [3],
    }  # fmt: skip


@pytest.mark.parametrize(
    ("over", "words"),
    [
        ("kernel.a", "must be key=values"),
        ("kernel.a=", "there is no value"),
        ("kernel.a=1:2", "start:stop:count"),
        ("kernel.a=1:2:3:cubic", "start:stop:count"),
        ("kernel.a=1:2:2.5", "start:stop:count"),
        ("kernel.a=1:2:1", "2 values or more"),
        ("kernel.a=1:1:3", "two different ends"),
        ("kernel.a=0:1:3:log", "above zero"),
        ("kernel.a=1,2,1.0", "stands there twice"),
    ],
)
def test_mistakes_in_what_is_swept_over(over: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        read_axes([over])
    (message,) = caught.value.problems
    assert over in message
    assert words in message


def test_all_mistakes_at_once() -> None:
    with pytest.raises(InputError) as caught:
        read_axes(["a.b=1:2", "c.d", "e.f=1", "e.f=2"])
    assert len(caught.value.problems) == 3
    with pytest.raises(InputError, match="nothing to sweep over"):
        read_axes([])
    with pytest.raises(InputError, match="1000000 points"):
        read_axes(["a.b=0:1:1000", "c.d=0:1:1000"])


def test_mistakes_in_the_case_come_before_anything_is_computed(case: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        sx.sweep(case, ["run.particles=1,100,1.5"], directory=tmp_path / "s")
    assert [p.split(":")[0] for p in caught.value.problems] == [
        "--over run.particles=1", "--over run.particles=1.5",
    ]  # fmt: skip
    with pytest.raises(InputError, match="no such key"):
        sx.sweep(case, ["kernel.c1=1", "run.particel=100"], directory=tmp_path / "s")
    with pytest.raises(InputError, match="time_limit"):
        sx.sweep(case, ["kernel.c1=1"], sets=["run.time_limit=9"], directory=tmp_path / "s")
    with pytest.raises(InputError, match=r"lower run\.sizes"):
        sx.sweep(
            case, ["kernel.c1=0:1:20"], sets=["run.sizes=1e7", "run.replicas=200"],
            directory=tmp_path / "s",
        )  # fmt: skip
    assert not (tmp_path / "s").exists()


# --- the result ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def told() -> list[Any]:
    """What the sweep that is expected has told of its progress."""
    return []


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory, told: list[Any]) -> Any:
    folder = tmp_path_factory.mktemp("expected")
    (folder / "case.toml").write_text(CASE)
    return sx.sweep(folder / "case.toml", OVER, directory=folder / "s", progress=told.append)


def test_progress_is_that_of_all_points(expected: Any, told: list[Any]) -> None:
    last = told[-1]
    assert (last.done, last.fraction, last.seconds_left) == (6, 1.0, 0.0)
    assert last.events == int(expected["collisions"].isel(time=-1).sum())


def test_a_dimension_for_each_key(expected: Any) -> None:
    assert expected["moment"].dims == (*OVER, "replica", "time", "order")
    assert expected["kernel.c1"].values.tolist() == OVER["kernel.c1"]
    assert (expected["point_status"] == "done").all()
    assert len(np.unique(expected["point_seed"])) == 6
    assert json.loads(expected.attrs["sweep"]) == OVER
    assert expected.attrs["complete"] == 1


def test_each_point_is_the_run_of_its_case(expected: Any) -> None:
    place = {"kernel.c1": 0.25, "processes.shattering.rate": 0.3}
    point = expected.sel(place)
    kernel = sx.kernels.formula(FORMULA, c0=1.0, c1=0.25, c2=0.0, c3=0.0)
    ds = sx.simulate(
        sx.Model(kernel, [sx.processes.Aggregation(), sx.processes.Shattering(0.3)]), [0.5, 1],
        particles=150, replicas=3, sizes=32, method="acceptance-rejection",
        seed=int(point["point_seed"]),
    )  # fmt: skip
    for name in ("moment", "n", "collisions", "largest", "events"):
        np.testing.assert_array_equal(point[name], ds[name])
    assert int(point["point_seed"]) == derived(7, place)


def test_seeds_follow_from_that_of_the_case_and_the_values() -> None:
    place = {"kernel.c1": 0.5, "run.particles": 100}
    seed = derived(7, place)
    assert seed == derived(7, {"run.particles": 100.0, "kernel.c1": 0.5})
    others = [derived(8, place), derived(7, place | {"kernel.c1": 0.6}), derived(7, {})]
    assert len({seed, *others}) == 4


def test_what_a_folder_holds_is_what_was_asked_for(case: Path, tmp_path: Path) -> None:
    made, drawn = make_sweep(case, read_axes({"kernel.c1": [0.5, 0.25]}), ["run.particles=160"])
    assert not drawn
    for point, value in zip(made.points(), (0.5, 0.25), strict=True):
        kernel, run = point.case.model.kernel, point.case.run
        assert run is not None
        assert (kernel.parameters[1], run.particles) == (value, 160)
        assert run.seed == derived(7, point.values)
    folder = Folder(tmp_path / "s")
    assert folder.begin(made, False) == folder.load() == made
    # one that was drawn stays
    assert folder.begin(replace(made, seed=8), True) == made


def test_seeds_do_not_depend_on_the_other_points(case: Path, tmp_path: Path, expected: Any) -> None:
    over = ["processes.shattering.rate=0.9,0.2", "kernel.c1=0.5"]
    ds = sx.sweep(case, over, directory=tmp_path / "s")
    place = {"kernel.c1": 0.5, "processes.shattering.rate": 0.2}
    np.testing.assert_array_equal(ds.sel(place)["moment"], expected.sel(place)["moment"])


@pytest.mark.slow
def test_points_that_differ_in_their_shapes(case: Path, tmp_path: Path) -> None:
    ds = sx.sweep(
        case, ["run.replicas=2,3", "run.method=inverse,acceptance-rejection"],
        directory=tmp_path / "s", sets=["run.sizes=2"],
    )  # fmt: skip
    assert ds.sizes["replica"] == 3
    assert np.isnan(ds["largest"].sel({"run.replicas": 2}).isel(replica=2)).all()
    assert np.isfinite(ds["largest"].sel({"run.replicas": 3})).all()
    assert (ds["bin_lower"] < ds["bin_upper"]).all()
    assert (np.diff(ds["bin"]) > 0).all()
    # a bin is a place, whatever the point
    total = ds["n"].sum("size") + ds["n_bin"].sum("bin")
    seen = np.isfinite(ds["largest"])
    np.testing.assert_allclose(total.where(seen, 0), ds["number_density"].where(seen, 0))


def test_seeds_can_be_swept_over(case: Path, tmp_path: Path) -> None:
    ds = sx.sweep(case, {"run.seed": [1, 2]}, directory=tmp_path / "s")
    assert ds["point_seed"].values.tolist() == ["1", "2"]


def test_the_rate_equations(case: Path, tmp_path: Path) -> None:
    head, _, _ = CASE.partition("[run]")
    case.write_text(head + "[solve]\ntimes = [0.5, 1]\ntolerance = 1e-4\n")
    ds = sx.sweep(case, {"kernel.c1": [0.0, 0.5]}, directory=tmp_path / "s")
    assert ds.attrs["method"] == "solve"
    assert (np.diff(ds["number_density"].isel(time=1, replica=0)) < 0).all()


def test_a_sweep_must_be_reduced_to_a_point(expected: Any) -> None:
    for call in (sx.summary, lambda ds: sx.analysis.oscillations(ds, "largest")):
        with pytest.raises(InputError, match=r"choose a point, such as ds\.sel"):
            call(expected)
    assert sx.summary(expected.isel(dict.fromkeys(OVER, 0)), sizes=()) is not None
    header, rows = sx.analysis.sweep_table(expected)
    assert header[:3] == [*OVER, "clusters"]
    assert [row[:2] for row in rows][:2] == [["0.5", "0.1"], ["0.5", "0.2"]]


def test_executors(case: Path, tmp_path: Path, expected: Any) -> None:
    seen: list[Any] = []
    with ProcessPoolExecutor(2) as pool:
        ds = sx.sweep(case, OVER, directory=tmp_path / "s", executor=pool, progress=seen.append)
    assert expected.drop_vars("point_seconds").equals(ds.drop_vars("point_seconds"))
    assert (seen[-1].done, seen[-1].fraction) == (6, 1.0)
    assert seen[-1].note == "6 of 6 points"
    assert seen[0].fraction == 0


# --- what stops it -------------------------------------------------------------------------------


def test_a_point_that_fails_does_not_lose_the_others(
    case: Path, tmp_path: Path, expected: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    compute = grid._computed

    def fail(this: Any, *rest: Any) -> Any:
        if this.model.processes[1].factor.constant == 0.2:
            raise ZeroDivisionError("no luck")
        return compute(this, *rest)

    with monkeypatch.context() as patch:
        patch.setattr(grid, "_computed", fail)
        ds = sx.sweep(case, OVER, directory=tmp_path / "s")
        assert ds.attrs["complete"] == 0
        assert sx.results.load(tmp_path / "s" / "results.nc").equals(ds)
    failed = ds.sel({"processes.shattering.rate": 0.2})
    assert (failed["point_status"] == "failed").all()
    assert (failed["point_message"] == "ZeroDivisionError: no luck").all()
    assert np.isnan(failed["moment"]).all()
    others = {"processes.shattering.rate": [0.1, 0.3]}
    np.testing.assert_array_equal(ds["moment"].sel(others), expected["moment"].sel(others))
    told = list(grid.failures(ds))
    assert told[0] == (
        "kernel.c1 = 0.5, processes.shattering.rate = 0.2", "ZeroDivisionError: no luck",
    )  # fmt: skip
    assert len(told) == 2
    # they are tried again, and only they
    before = times(tmp_path / "s")
    again = sx.sweep(case, OVER, directory=tmp_path / "s")
    assert expected.drop_vars("point_seconds").equals(again.drop_vars("point_seconds"))
    assert times(tmp_path / "s").items() >= before.items()


def test_if_all_fail_it_is_an_error(
    case: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(grid, "_computed", lambda *_: 1 / 0)
    with pytest.raises(InputError, match="every point failed"):
        sx.sweep(case, OVER, directory=tmp_path / "s")


def times(folder: Path) -> dict[str, int]:
    return {p.name: p.stat().st_mtime_ns for p in (folder / "points").glob("*.nc")}


def test_stopped_and_gone_on_with(case: Path, tmp_path: Path, expected: Any) -> None:
    def press(progress: Any) -> None:
        if progress.done == 3:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted, match="3 of 6 points are finished"):
        sx.sweep(case, OVER, directory=tmp_path / "s", progress=press)
    before = times(tmp_path / "s")
    assert len(before) == 3
    (tmp_path / "s" / "points" / ".00004.ab12.nc").write_bytes(b"half")
    ds = sx.sweep(case, OVER, directory=tmp_path / "s")
    assert expected.drop_vars("point_seconds").equals(ds.drop_vars("point_seconds"))
    assert times(tmp_path / "s").items() >= before.items()
    assert len(list((tmp_path / "s" / "points").iterdir())) == 6


def test_a_folder_holds_one_sweep(case: Path, tmp_path: Path) -> None:
    over = {"kernel.c1": [0.5]}
    sx.sweep(case, over, directory=tmp_path / "s")
    for given in (
        {"over": {"kernel.c1": [0.6]}},
        {"over": over, "sets": ["run.particles=160"]},
        {"over": over, "sets": ["run.seed=8"]},
    ):
        with pytest.raises(InputError, match="holds another sweep"):
            sx.sweep(case, directory=tmp_path / "s", **given)
    case.write_text(CASE.replace("c0 = 1.0", "c0 = 1.1"))
    with pytest.raises(InputError, match="holds another sweep"):
        sx.sweep(case, over, directory=tmp_path / "s")
    with pytest.raises(InputError, match="is not empty"):
        sx.sweep(case, over, directory=tmp_path)
    with pytest.raises(InputError, match="is a file"):
        sx.sweep(case, over, directory=case)


def test_a_seed_that_was_drawn_stays(case: Path, tmp_path: Path) -> None:
    case.write_text(CASE.replace("seed = 7\n", ""))
    over = {"kernel.c1": [0.5]}
    first = sx.sweep(case, over, directory=tmp_path / "s")
    again = sx.sweep(case, over, directory=tmp_path / "s")
    axes = read_axes(over)
    assert first.attrs["seed"] == again.attrs["seed"]
    assert make_sweep(case, axes, [])[0].seed != make_sweep(case, axes, [])[0].seed
    assert Folder(tmp_path / "s").load().seed == int(first.attrs["seed"])


def test_a_result_of_another_case_is_not_taken_for_one(case: Path, tmp_path: Path) -> None:
    over = {"kernel.c1": [0.5, 0.25]}
    sx.sweep(case, over, directory=tmp_path / "s")
    points = tmp_path / "s" / "points"
    (points / "00001.nc").write_bytes((points / "00000.nc").read_bytes())
    with pytest.raises(InputError, match=r"00001\.nc: is the result of another case"):
        sx.sweep(case, over, directory=tmp_path / "s")
