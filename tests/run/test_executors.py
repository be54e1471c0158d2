"""Where replicas run changes nothing; workers that die are no loss."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from concurrent.futures import (
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import runs

import smolux as sx
from smolux.errors import InputError, Interrupted, WorkerError
from smolux.runtime import executors
from smolux.runtime.executors import RETRIES, _renewed, completed, opened
from smolux.stochastic import driving, replicas
from smolux.stochastic import simulation as stochastic


class InThisProcess(Executor):
    """Runs tasks when they are submitted, but is no pool of threads."""

    _max_workers = 2

    def submit(self, call: Any, /, *arguments: Any, **named: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(call(*arguments, **named))
        except Exception as error:
            future.set_exception(error)
        return future


SETTINGS: dict[str, Any] = {
    "particles": 150, "replicas": 5, "seed": 5, "sizes": 40, "orders": (0, 1, 2),
    "method": "acceptance-rejection",
}  # fmt: skip

#: where other processes find what tests import
FOLDERS = [str(folder) for folder in Path(__file__).parents[:2]]


def simulate(**given: Any) -> Any:
    return sx.simulate(runs.model(0.1), [0.5, 3.0], **SETTINGS | given)


@pytest.fixture(scope="module")
def expected() -> Any:
    return simulate()


# --- tasks, in processes that die ----------------------------------------------------------------


def square(k: int, folder: Path, deaths: int) -> int:
    """Square a number, after so many processes have died of it."""
    for n in range(deaths):
        try:
            (folder / f"{k}-{n}").touch(exist_ok=False)
        except FileExistsError:
            continue
        os._exit(9)
    if k == 13:
        raise ValueError("thirteen")
    return k * k


def finished(pool: Executor, tasks: Any) -> dict[int, Any]:
    found: dict[int, Any] = {}
    for done in completed(pool, square, tasks, 0.1):
        if done is not None:
            assert done[0] not in found
            found[done[0]] = done[1].exception() or done[1].result()
    return found


def test_tasks_whose_worker_died_are_run_again(tmp_path: Path) -> None:
    with ProcessPoolExecutor(2) as pool:
        found = finished(pool, [(k, tmp_path, k % 2) for k in range(6)])
    assert found == {k: k * k for k in range(6)}


def test_a_pool_in_place_of_one_that_broke_is_like_it() -> None:
    with ProcessPoolExecutor(3, initializer=square, initargs=(2, Path(), 0)) as given:
        new: Any = _renewed(given, given)
        with new:
            assert new is not given
            assert (new._max_workers, new._initializer) == (3, square)
            assert new._initargs == (2, Path(), 0)


def test_one_that_kills_every_worker_is_found(tmp_path: Path) -> None:
    with ProcessPoolExecutor(2) as pool:
        found = finished(pool, [(k, tmp_path, 1000 if k == 2 else 0) for k in range(4)])
    assert isinstance(found.pop(2), WorkerError)
    assert found == {0: 0, 1: 1, 3: 9}
    # it was tried a few times, not for ever
    assert RETRIES <= len(list(tmp_path.iterdir())) <= RETRIES + 3


def test_an_error_of_a_task_is_its_own(tmp_path: Path) -> None:
    with ThreadPoolExecutor(2) as pool:
        found = finished(pool, [(k, tmp_path, 0) for k in (12, 13, 14)])
    assert (found[0], found[2]) == (144, 196)
    assert isinstance(found[1], ValueError)


def test_what_is_not_wanted_any_more_is_cancelled(tmp_path: Path) -> None:
    class Slow(Executor):
        def __init__(self) -> None:
            self.futures: list[Future[Any]] = []

        def submit(self, *_: Any, **__: Any) -> Future[Any]:  # type: ignore[override]
            self.futures.append(Future())
            return self.futures[-1]

    pool = Slow()
    tasks = completed(pool, square, [(1, tmp_path, 0)], 0.01)
    assert next(tasks) is None
    tasks.close()  # type: ignore[attr-defined]
    assert pool.futures[0].cancelled()


# --- runs ----------------------------------------------------------------------------------------


MARK = "SMOLUX_TEST_DEATHS"
_run_group = driving.run_group


def deadly_group(plan: Any, first: int, count: int) -> Any:
    """Run a group in a process that may die."""
    square(first, Path(os.environ[MARK].partition(":")[2]), int(os.environ[MARK].partition(":")[0]))
    return _run_group(plan, first, count)


@pytest.mark.parametrize("deaths", [1, 1000])
def test_a_run_survives_the_death_of_workers(
    deaths: int, expected: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(MARK, f"{deaths}:{tmp_path}")
    monkeypatch.setattr(driving, "run_group", deadly_group)
    with ProcessPoolExecutor(2) as pool:
        if deaths == 1:
            assert expected.equals(simulate(executor=pool))
        else:
            with pytest.raises(WorkerError, match=r"replicas \d+ to \d+.*fewer workers"):
                simulate(executor=pool)


@pytest.mark.parametrize("workers", [1, 2, 4])
def test_any_number_of_workers(workers: int, expected: Any, monkeypatch: Any) -> None:
    monkeypatch.setattr(stochastic, "cores", lambda: workers)
    assert expected.equals(simulate())
    with ThreadPoolExecutor(workers) as pool:
        assert expected.equals(simulate(executor=pool))
    with ProcessPoolExecutor(workers) as pool:
        assert expected.equals(simulate(executor=pool))


def test_progress_of_groups() -> None:
    seen: list[Any] = []
    with ProcessPoolExecutor(2) as pool:
        ds = simulate(executor=pool, progress=seen.append)
    assert [seen[0].fraction, seen[-1].fraction] == [0, 1]
    assert seen[-1].events == ds.attrs["events"]
    fractions = [p.fraction for p in seen]
    assert fractions == sorted(fractions)
    # five replicas in two groups
    assert {round(5 * f) for f in fractions} <= {0, 2, 3, 5}


def test_ctrl_c() -> None:
    def press(progress: Any) -> None:
        raise KeyboardInterrupt

    with ProcessPoolExecutor(1) as pool, pytest.raises(Interrupted) as caught:
        simulate(executor=pool, progress=press)
    assert caught.value.dataset is None  # nothing had come back


def test_ctrl_c_keeps_what_came_back(expected: Any) -> None:
    def press(progress: Any) -> None:
        if progress.fraction > 0:
            raise KeyboardInterrupt

    with InThisProcess() as pool, pytest.raises(Interrupted) as caught:
        simulate(executor=pool, progress=press)
    ds: Any = caught.value.dataset
    assert not ds.attrs["complete"]
    assert ds.sizes["replica"] == 5
    came = np.isfinite(ds["n"].values).all(axis=(1, 2))
    assert came.any()
    np.testing.assert_array_equal(ds["n"].values[came], expected["n"].values[came])


LARGE: dict[str, Any] = {"particles": 20_000, "replicas": 4}


def raise_late(monkeypatch: pytest.MonkeyPatch, kind: Any) -> None:
    """Let all groups but the first come upon an error late in their run."""
    serve = replicas.Group._serve

    def late(group: Any) -> None:
        serve(group)
        if group.first > 0 and group.fraction > 0.2:
            raise kind("a rate is nan; it must be a finite number")

    monkeypatch.setattr(replicas.Group, "_serve", late)


def keeps_what_there_is(error: InputError, expected: Any) -> None:
    ds: Any = error.dataset
    assert not ds.attrs["complete"]
    assert error.problems[0] in ds.attrs["warnings"]
    whole = np.isfinite(ds["n"].values).all(axis=(1, 2))
    assert whole[0]
    assert not whole[-1]
    np.testing.assert_array_equal(ds["n"].values[whole], expected["n"].values[whole])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the error is put into forked processes")
@pytest.mark.parametrize("kind", [InputError, MemoryError])
def test_a_late_error_keeps_what_others_computed(kind: Any, monkeypatch: Any) -> None:
    expected = simulate(**LARGE)
    raise_late(monkeypatch, kind)
    with ProcessPoolExecutor(2, get_context("fork")) as pool, pytest.raises(InputError) as caught:
        simulate(executor=pool, **LARGE)
    assert ("finite number" if kind is InputError else "memory") in str(caught.value)
    keeps_what_there_is(caught.value, expected)


def test_workers_that_die_leave_what_others_computed(expected: Any, monkeypatch: Any) -> None:
    group = driving.run_group

    def deadly(plan: Any, first: int, count: int) -> Any:
        if first == 0:
            return group(plan, first, count)
        raise BrokenExecutor("gone")

    monkeypatch.setattr(driving, "run_group", deadly)
    with InThisProcess() as pool, pytest.raises(WorkerError) as caught:
        simulate(executor=pool)
    ds: Any = caught.value.dataset
    np.testing.assert_array_equal(ds["n"].values[:1], expected["n"].values[:1])
    assert np.isnan(ds["n"].values[-1]).all()


# --- executors by name ---------------------------------------------------------------------------


def test_threads_and_processes_by_name(expected: Any) -> None:
    with opened("threads") as pool:
        assert pool is None
    with opened("threads", 3) as pool:
        assert executors.workers_of(pool) == 3  # type: ignore[arg-type]
    with opened("processes", 2) as pool:
        assert executors.workers_of(pool) == 2  # type: ignore[arg-type]
        assert expected.equals(simulate(executor=pool))


@pytest.mark.parametrize(("kind", "module"), [("dask", "distributed"), ("mpi", "mpi4py.futures")])
def test_what_is_missing_is_told_with_how_to_install_it(
    kind: str, module: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError) as caught, opened(kind):
        pass
    assert f'pip install "smolux[{kind}]"' in str(caught.value)


# --- Dask ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("processes", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_dask(processes: bool, expected: Any) -> None:
    distributed = pytest.importorskip("distributed")
    seen: list[Any] = []
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=processes, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        assert expected.equals(simulate(executor=client, progress=seen.append))
        assert seen[-1].fraction == 1
        with opened("dask", address=cluster.scheduler_address) as pool:
            assert executors.workers_of(pool) == 2  # type: ignore[arg-type]
            assert expected.equals(simulate(executor=pool))
            goal = {"replicas": 8, "target_error": 0.15}
            assert simulate(**goal).equals(simulate(executor=pool, **goal))


@pytest.mark.parametrize("kind", [InputError, MemoryError])
def test_a_late_error_on_dask_keeps_what_others_computed(kind: Any, monkeypatch: Any) -> None:
    distributed = pytest.importorskip("distributed")
    expected = simulate(**LARGE)
    raise_late(monkeypatch, kind)
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
        pytest.raises(InputError) as caught,
    ):
        simulate(executor=client, **LARGE)
    keeps_what_there_is(caught.value, expected)


def test_a_dask_worker_that_dies(
    expected: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    distributed = pytest.importorskip("distributed")
    monkeypatch.setenv(MARK, f"1:{tmp_path}")
    monkeypatch.setattr(driving, "run_group", deadly_group)
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as it,
        distributed.Client(it) as client,
    ):
        client.register_plugin(found_here())
        assert expected.equals(simulate(executor=client))
    assert list(tmp_path.iterdir())


def found_here() -> Any:
    """Let workers, new ones too, find the functions of this file."""
    from distributed import WorkerPlugin

    class Found(WorkerPlugin):
        def setup(self, worker: Any) -> None:
            sys.path.extend(FOLDERS)

    return Found()


def test_no_scheduler_at_an_address() -> None:
    pytest.importorskip("distributed")
    with (
        pytest.raises(InputError, match="no Dask scheduler answers"),
        opened("dask", address="nothing://127.0.0.1:1"),
    ):
        pass


# --- MPI -----------------------------------------------------------------------------------------


def test_mpi(tmp_path: Path, expected: Any) -> None:
    pytest.importorskip("mpi4py.futures")
    mpiexec = shutil.which("mpiexec", path=f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    if mpiexec is None:
        pytest.skip("there is no mpiexec")
    script = tmp_path / "run.py"
    script.write_text(
        "import sys\n"
        f"sys.path += {FOLDERS!r}\n"
        "import runs\nimport smolux as sx\nfrom smolux.runtime.executors import opened\n"
        "if __name__ == '__main__':\n"
        "    with opened('mpi') as pool:\n"
        f"        ds = sx.simulate(runs.model(0.1), [0.5, 3.0], executor=pool, **{SETTINGS!r})\n"
        "    sx.results.save(ds, 'found.nc')\n"
    )
    done = subprocess.run(
        [mpiexec, "-n", "2", sys.executable, "-m", "mpi4py.futures", str(script)],
        cwd=tmp_path, capture_output=True, text=True, timeout=200, check=False,
    )  # fmt: skip
    if done.returncode and "MPI library" in done.stderr:
        pytest.skip("mpi4py finds no MPI library")
    assert done.returncode == 0, done.stderr
    assert expected.equals(sx.results.load(tmp_path / "found.nc"))
