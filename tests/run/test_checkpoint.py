"""A run that is stopped goes on from its checkpoint as if nothing had happened."""

from __future__ import annotations

import json
import pickletools
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import runs

import shared
import smolux as sx
from shared import EVERY, QUICK, VARYING
from smolux.core.state import BUDGET, GROW
from smolux.errors import InputError, Interrupted
from smolux.runtime import resources, room
from smolux.stochastic import checkpoint as checkpoints
from smolux.stochastic import replicas

pytestmark = shared.stopped
slow = pytest.mark.slow

TIMES = [0.0, 0.3, 1.0, 2.0]
SETTINGS: dict[str, Any] = {"particles": 2000, "replicas": 3, "seed": 5, "sizes": 40}


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(replicas, "_SLICE", 1e-9)  # return to Python as often as can be
    return tmp_path / "run.npz"


def simulate(method: str = runs.METHODS[0], rate: Any = VARYING, **settings: Any) -> Any:
    return sx.simulate(runs.model(rate), TIMES, method=method, **SETTINGS | settings)


def stopped(path: Path, method: str = runs.METHODS[0], **settings: Any) -> Any:
    ds = simulate(method, checkpoint=path, time_limit=1e-9, **settings)
    assert not ds.attrs["complete"]
    return ds


def go_on(path: Path, most: int = 10_000, **settings: Any) -> tuple[Any, int]:
    """Resume until the end; return the dataset and how often the run was stopped."""
    for stops in range(most):
        ds = sx.resume(path, time_limit=1e-9, **settings)
        if ds.attrs["complete"]:
            return ds, stops
    raise AssertionError("a run that is stopped again and again must come to its end")


@pytest.mark.parametrize(
    ("method", "distribution"),
    [
        # whole populations are written besides all else
        pytest.param(m.values[0], whole, marks=m.marks if whole or m.values[0] in QUICK else slow)
        for m in EVERY
        for whole in (False, True)
    ],
)
def test_stopped_again_and_again(method: str, distribution: bool, path: Path) -> None:
    # a constant rate brings fewer events
    given: dict[str, Any] = {} if method in QUICK else {"rate": 0.1, "particles": 6000}
    given["distribution"] = distribution
    expected = simulate(method, **given)
    part = stopped(path, method, **given)
    assert part.attrs["stopped"] == "the time limit of 1e-09 s is reached"
    assert part.attrs["checkpoint"] == str(path)
    assert any(str(path) in text for text in json.loads(part.attrs["warnings"]))
    assert np.isnan(part["collisions"].isel(time=-1)).all()
    ds, stops = go_on(path)
    assert stops >= 1  # besides the first
    assert ds.attrs["complete"]
    assert json.loads(ds.attrs["warnings"]) == []
    runs.assert_same(expected, ds)
    assert expected.attrs["events"] == ds.attrs["events"]
    # what was reached before is part of it
    reached = ~np.isnan(part["collisions"].values)
    np.testing.assert_array_equal(
        part["collisions"].values[reached], ds["collisions"].values[reached]
    )


@shared.repaired
def test_a_raised_bound_is_kept(path: Path) -> None:
    """All replicas find their bound broken before the run is first stopped."""
    model = runs.model(0.1, c1=0.0)
    law = model.kernel
    low = replace(model, kernel=shared.Low(law.expression, law.names, law.values))
    given: dict[str, Any] = {"method": "acceptance-rejection"} | SETTINGS
    expected = sx.simulate(low, TIMES, **given)
    part = sx.simulate(low, TIMES, checkpoint=path, time_limit=1e-9, **given)
    assert not part.attrs["complete"]
    ds, _ = go_on(path, model=low)
    runs.assert_same(expected, ds)
    assert "above its bound 3 times" in ds.attrs["warnings"]
    assert sx.results.warnings(ds) == sx.results.warnings(expected)


@shared.extinction
def test_replicas_that_have_ended_stay_so(path: Path) -> None:
    """Some have merged to one cluster when the run is stopped, and some have not."""
    given: dict[str, Any] = {
        "method": "acceptance-rejection", "particles": 20, "replicas": 2000, "seed": 5,
        "population": "fixed-volume", "sizes": 20,
    }  # fmt: skip
    model, times = runs.model(0.0), [500.0]
    expected = sx.simulate(model, times, **given)
    part = sx.simulate(model, times, checkpoint=path, time_limit=1e-9, **given)
    while not np.isfinite(part["extinction_time"]).any():
        part = sx.resume(path, time_limit=1e-9)
    assert np.isnan(part["extinction_time"]).any()
    ds, _ = go_on(path)
    runs.assert_same(expected, ds)
    assert np.isfinite(ds["extinction_time"]).all()


def test_interrupted_from_the_keyboard(path: Path) -> None:
    def press(progress: Any) -> None:
        raise KeyboardInterrupt

    with pytest.raises(Interrupted, match="interrupted") as caught:
        simulate(checkpoint=path, progress=press)
    assert caught.value.checkpoint == path
    ds, _ = go_on(path)
    runs.assert_same(simulate(), ds)


def test_an_error_of_progress_is_not_swallowed(path: Path) -> None:
    def fail(progress: Any) -> None:
        raise ZeroDivisionError("of the user")

    with pytest.raises(ZeroDivisionError, match="of the user"):
        simulate(checkpoint=path, progress=fail)


def test_a_rate_that_is_no_number_late_keeps_what_was_computed(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    serve = replicas.Group._serve

    def late(group: Any) -> None:
        serve(group)
        if group.fraction > 0.3:
            raise InputError("a rate is nan; it must be a finite number")

    for file in (None, path):
        with monkeypatch.context() as patch:
            patch.setattr(replicas.Group, "_serve", late)
            with pytest.raises(InputError, match="finite number") as caught:
                simulate(checkpoint=file)
        ds: Any = caught.value.dataset
        assert caught.value.checkpoint == file
        assert not ds.attrs["complete"]
        assert "finite number" in ds.attrs["warnings"]
        # the replica that fell had come past the second time, and not to the last
        assert np.isfinite(ds["number_density"].values[:, 1]).any()
        assert np.isnan(ds["number_density"].values[:, 3]).any()
    runs.assert_same(simulate(), sx.resume(path))


@pytest.mark.parametrize("failure", ["asked for", "refused"])
@pytest.mark.parametrize("method", EVERY)
def test_no_memory_to_grow_keeps_what_was_computed(
    method: str, failure: str, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = {m.name: m for m in sx.methods.METHODS}[method]()
    kind, given = type(made), {"rate": 0.1, "particles": 6000}
    expected = simulate(method, **given)

    def growing(group: Any) -> None:
        if group.fraction > 0.3 and BUDGET in group.codes:
            group.codes[group.codes == BUDGET] = GROW

    def refuse(*_: Any) -> None:
        raise MemoryError

    serve = replicas.Group._serve
    with monkeypatch.context() as patch:
        # as if the store were full, late in the run
        patch.setattr(replicas.Group, "_serve", lambda group: (growing(group), serve(group)))
        patch.setattr(kind, "growth", lambda *_: 1 << 40)
        patch.setattr(kind, "grow", refuse)
        if failure == "asked for":
            patch.setattr(resources, "free_memory", lambda: float(1 << 30))
        else:
            patch.setattr(resources, "free_memory", lambda: None)
        with pytest.raises(InputError, match=r"memory: .* need 1099.51 GB more") as caught:
            simulate(method, checkpoint=path, **given)
    assert ("1.01 GB are free" in str(caught.value)) == (failure == "asked for")
    assert caught.value.checkpoint == path
    ds: Any = caught.value.dataset
    assert not ds.attrs["complete"]
    # a store that is really full may come first
    assert np.isfinite(ds["number_density"].values[:, 0]).any()
    runs.assert_same(expected, sx.resume(path))


def test_no_memory_for_a_population_keeps_what_was_computed(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: dict[str, Any] = {"method": "acceptance-rejection", "rate": 0.1, "distribution": True}
    expected, asked = simulate(**given), iter(range(10_000))
    with monkeypatch.context() as patch:
        patch.setattr(room, "_SMALL", 0)
        patch.setattr(resources, "free_memory", lambda: 1e12 if next(asked) < 7 else 0.0)
        with pytest.raises(InputError, match=r"the clusters of replica \d, to be kept, need"):
            simulate(checkpoint=path, **given)
    runs.assert_same(expected, sx.resume(path))


def test_a_checkpoint_that_was_not_written_is_not_named(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(checkpoints.np, "savez", full)
    ds = stopped(path)
    assert "checkpoint" not in ds.attrs
    assert "go on" not in ds.attrs["warnings"]
    assert "no checkpoint was written" in ds.attrs["warnings"]

    def press(progress: Any) -> None:
        raise KeyboardInterrupt

    with pytest.raises(Interrupted, match="no checkpoint was written") as caught:
        simulate(checkpoint=path, progress=press)
    assert caught.value.checkpoint is None
    assert "go on" not in str(caught.value)


def test_without_a_checkpoint() -> None:
    ds = simulate(particles=100_000, time_limit=1e-9)
    assert not ds.attrs["complete"]
    assert "checkpoint" not in ds.attrs
    assert ds["n"].sizes["time"] == len(TIMES)


def test_a_checkpoint_now_and_then(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written = []
    save = checkpoints.save
    monkeypatch.setattr(checkpoints, "save", lambda *a: (written.append(1), save(*a)))
    ds = simulate(checkpoint=path, checkpoint_every=1e-9)
    assert len(written) > 2
    runs.assert_same(simulate(), ds)
    # the latest leads to the same end
    runs.assert_same(ds, sx.resume(path))


# --- files that are none -------------------------------------------------------------------------


def one_message(path: Path, *words: str, **settings: Any) -> None:
    with pytest.raises(InputError) as caught:
        sx.resume(path, **settings)
    (message,) = caught.value.problems
    for word in words:
        assert word in message


def test_missing_file(tmp_path: Path) -> None:
    one_message(tmp_path / "none.npz", "none.npz", "no such file")


def test_damaged_files(path: Path) -> None:
    stopped(path)
    whole = path.read_bytes()
    broken = path.with_name("broken.npz")
    step = max(len(whole) // 40, 1)
    cuts = [whole[:n] for n in range(0, len(whole), step)]
    middle = len(whole) // 2
    changed = whole[:middle] + bytes(255 - b for b in whole[middle : middle + 200])
    for content in (*cuts, b"text", changed + whole[middle + 200 :]):
        broken.write_bytes(content)
        one_message(broken, "broken.npz", "damaged")


def edited(path: Path, **changes: Any) -> None:
    """Write a checkpoint anew with other entries of its description."""
    with np.load(path) as file:
        arrays = dict(file)
    meta = json.loads(arrays["meta"].tobytes())
    for key, change in changes.items():
        meta[key] = change(meta[key])
    arrays["meta"] = np.frombuffer(json.dumps(meta).encode(), np.uint8)
    np.savez(path, **arrays)


def test_another_version(path: Path) -> None:
    stopped(path)
    edited(path, version=lambda v: v + 1)
    one_message(path, "run.npz", f"version {checkpoints.VERSION + 1}")


def test_another_model(path: Path) -> None:
    stopped(path)
    one_message(path, "model", "run.npz", model=runs.model(0.3))
    runs.assert_same(simulate(), go_on(path, model=runs.model(runs.VARYING))[0])


def test_unknown_method(path: Path) -> None:
    stopped(path)
    edited(path, plan=lambda p: p | {"decided": p["decided"] | {"method": {"name": "invers"}}})
    one_message(path, "invers", "did you mean 'inverse'?")


@pytest.mark.parametrize("lost", ["0/state/rng", "0/codes", "0/tally/counts", "0/windows/edges"])
def test_an_array_is_missing(path: Path, lost: str) -> None:
    stopped(path)
    with np.load(path) as file:
        arrays = {name: values for name, values in file.items() if name != lost}
    np.savez(path, **arrays)
    one_message(path, "run.npz", "damaged")


# --- what is written -----------------------------------------------------------------------------


def test_a_full_disk_leaves_the_older_file(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stopped(path)
    older = path.read_bytes()

    def full(*_: Any, **__: Any) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(checkpoints.np, "savez", full)
        ds = sx.resume(path, time_limit=1e-9)
    found = json.loads(ds.attrs["warnings"])
    (warning,) = [text for text in found if "no checkpoint was written" in text]
    assert "No space left" in warning
    assert ds.attrs["checkpoint"] == str(path)  # the older one
    assert path.read_bytes() == older
    assert [p.name for p in path.parent.iterdir()] == [path.name]
    runs.assert_same(simulate(), go_on(path)[0])


def test_a_plan_is_read_as_it_was_written(path: Path) -> None:
    """Of settings none of which is what it is if nothing is said."""
    plan = runs.plan(
        runs.model(0.1), [0.25, 2.0], "size-class", weighting=sx.weighting.WeightFunction(0.5),
        population="none", particles=3000, replicas=9, seed=2**70, orders=(0.5, 2), sizes=7,
        bins_per_octave=3, distribution=True, target_error=0.01, target="M2", max_replicas=77,
        subvolumes=3, remix=0.5,
    )  # fmt: skip
    checkpoints.save(path, plan, [])
    assert checkpoints.load(path) == (plan, [])


def test_no_pickle(path: Path) -> None:
    stopped(path, distribution=True)
    with zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            content = archive.read(name)
            assert content.startswith(b"\x93NUMPY")
            assert b"'descr': '|O'" not in content[:200]
    with np.load(path, allow_pickle=False) as file:
        assert all(file[name].dtype.kind in "biuf" for name in file.files)
    with pytest.raises(Exception):  # noqa: B017, PT011
        list(pickletools.genops(path.read_bytes()))


def test_a_pickle_is_not_run(tmp_path: Path) -> None:
    path = tmp_path / "bad.npz"
    np.savez(path, meta=np.array([{"version": 1}], object))
    one_message(path, "bad.npz", "damaged")
