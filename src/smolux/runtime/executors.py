"""Where tasks run: threads, processes, a Dask cluster, MPI; and what becomes of lost workers.

The only module that knows of Dask and MPI, which are loaded when they are asked for.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from smolux.errors import InputError, WorkerError

from .resources import cores

KINDS = ("threads", "processes", "dask", "mpi")
#: times that tasks whose workers died are run again, none of them getting done
RETRIES = 3


def adapted(executor: Any) -> Any:
    """Return the executor of a Dask client; anything else as it is."""
    if type(executor).__module__.startswith("distributed.") and hasattr(executor, "get_executor"):
        # every task is run, though it may look like an earlier one
        return executor.get_executor(pure=False)
    return executor


def _is_dask(executor: Executor) -> bool:
    return getattr(executor, "_client", None) is not None


def workers_of(executor: Executor) -> int:
    """Tasks that an executor runs at a time; many if it does not say."""
    if _is_dask(executor):
        # a cluster that is only being started has none yet
        return sum(executor._client.nthreads().values()) or 1000  # type: ignore[attr-defined]
    found = getattr(executor, "_max_workers", None) or getattr(executor, "num_workers", None)
    return int(found) if found else 1000


# --- tasks ----------------------------------------------------------------------------------------


def completed(
    executor: Executor,
    call: Callable[..., Any],
    tasks: Sequence[tuple[Any, ...]],
    tick: float,
    enough: Callable[[], bool] = lambda: False,
) -> Iterator[tuple[int, Future[Any]] | None]:
    """Run tasks, those whose worker dies again; yield each when it is done.

    If the workers die over and over, the tasks left are run one by one, so that the one that kills
    them is known: it fails with a `WorkerError`, the others have their result.

    Parameters
    ----------
    executor : Executor
        A pool of processes is replaced by another one like it if it breaks.
    call : callable
    tasks : sequence of tuple
        The arguments of each.
    tick : float
        Seconds after which None is yielded, if nothing was done meanwhile.
    enough : callable
        If it says so, tasks that have not begun are left out.

    Yields
    ------
    (int, Future) or None
        The number of a task, and its future with a result or an exception.
    """
    left = dict(enumerate(tasks))
    pool, deaths = executor, 0
    try:
        while left and not enough():
            before = len(left)
            alone = deaths > RETRIES
            batch = dict([next(iter(left.items()))]) if alone else left
            lost: BaseException | None = None
            for found in _round(pool, call, dict(batch), tick, enough):
                if found is None:
                    yield None
                elif _died(found[1]):
                    lost = found[1].exception() if not found[1].cancelled() else CancelledError()
                else:
                    del left[found[0]]
                    yield found
            if lost is not None:
                pool = _renewed(pool, executor)
                deaths = 1 if len(left) < before else deaths + 1
                if alone:
                    deaths = RETRIES + 1
                    k = next(iter(left))
                    del left[k]
                    reason = str(lost) or type(lost).__name__
                    yield k, _failed(WorkerError(f"the worker that computes it dies ({reason})"))
    finally:
        if pool is not executor:
            pool.shutdown(wait=False, cancel_futures=True)


def _round(
    pool: Executor,
    call: Callable[..., Any],
    tasks: dict[int, tuple[Any, ...]],
    tick: float,
    enough: Callable[[], bool],
) -> Iterator[tuple[int, Future[Any]] | None]:
    """Submit tasks once and yield them as they end, with a worker lost or not."""
    futures: dict[Future[Any], int] = {}
    try:
        for k, task in tasks.items():
            try:
                futures[pool.submit(call, *task)] = k
            except BrokenExecutor as error:  # it broke while there were tasks to submit
                yield k, _failed(error)
        while futures:
            ended, _ = wait(futures, tick, FIRST_COMPLETED)
            if not ended:
                yield None
            for future in ended:
                yield futures.pop(future), future
            if enough():
                # Dask gives up what runs, too, and begins what was submitted first
                running = list(futures)[: workers_of(pool)] if _is_dask(pool) else []
                futures = {f: k for f, k in futures.items() if f in running or not f.cancel()}
    finally:
        for future in futures:
            future.cancel()


def _failed(error: BaseException) -> Future[Any]:
    future: Future[Any] = Future()
    future.set_exception(error)
    return future


def _died(future: Future[Any]) -> bool:
    """Whether a task ended because its worker did."""
    if future.cancelled():
        return True
    error = future.exception()
    return isinstance(error, (BrokenExecutor, CancelledError)) or type(error).__name__ in (
        "KilledWorker",  # of Dask
    )


def _renewed(pool: Executor, given: Executor) -> Executor:
    """Return a pool in place of one that lost a worker: itself, if it finds others by itself."""
    if not isinstance(pool, ProcessPoolExecutor):
        return pool
    if pool is not given:
        pool.shutdown(wait=False, cancel_futures=True)
    like: dict[str, Any] = {
        "max_workers": getattr(pool, "_max_workers", None),
        "mp_context": getattr(pool, "_mp_context", None),
        "initializer": getattr(pool, "_initializer", None),
        "initargs": getattr(pool, "_initargs", ()),
    }
    return ProcessPoolExecutor(**like)


# --- executors by name ----------------------------------------------------------------------------


@contextmanager
def opened(
    executor: str, workers: int | None = None, address: str | None = None
) -> Iterator[Executor | None]:
    """Open an executor by its name in case files.

    Parameters
    ----------
    executor : {"threads", "processes", "dask", "mpi"}
    workers : int, optional
        How many; as many as there are cores, or as MPI or the cluster has.
    address : str, optional
        Of the scheduler of a Dask cluster; a cluster on this machine is started without one.

    Yields
    ------
    Executor or None
        None for threads without a given number, which is what `simulate` does by itself.

    Raises
    ------
    InputError
        If what it needs is not installed, or cannot be reached.
    """
    if executor == "threads":
        if workers is None:
            yield None
            return
        with ThreadPoolExecutor(workers) as threads:
            yield threads
    elif executor == "processes":
        from multiprocessing import get_context

        # fresh processes: copies of one with threads may never get going
        with ProcessPoolExecutor(workers or cores(), get_context("spawn"), _ignore_ctrl_c) as pool:
            yield pool
    elif executor == "dask":
        with _dask(workers, address) as client:
            yield adapted(client)
    else:
        with _mpi(workers) as pool:
            yield pool


def _ignore_ctrl_c() -> None:
    """Leave it to the main process, which Ctrl-C reaches too."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def _dask(workers: int | None, address: str | None) -> Iterator[Any]:
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise InputError(missing("dask", "distributed")) from None
    if address is None:
        with (
            LocalCluster(
                n_workers=workers or cores(), threads_per_worker=1, dashboard_address=None
            ) as cluster,
            Client(cluster) as client,
        ):
            yield client
        return
    try:
        client = Client(address, timeout=20)
    except (OSError, ValueError) as error:
        raise InputError(
            f"address = {address!r}: no Dask scheduler answers there ({error}); start one with: "
            "dask scheduler"
        ) from None
    with client:
        yield client


def _mpi(workers: int | None) -> Any:
    try:
        from mpi4py.futures import MPIPoolExecutor
    except ImportError:
        raise InputError(missing("mpi", "mpi4py")) from None
    except RuntimeError as error:
        raise InputError(
            f"executor = 'mpi': mpi4py finds no MPI library ({error}); load that of your cluster, "
            "often by: module load openmpi"
        ) from None
    return MPIPoolExecutor(workers)


def check_installed(executor: str) -> None:
    """Refuse an executor whose package is not there, before anything is opened.

    Raises
    ------
    InputError
    """
    package = {"dask": "distributed", "mpi": "mpi4py"}.get(executor)
    if package is not None and find_spec(package) is None:
        raise InputError(missing(executor, package))


def missing(kind: str, package: str) -> str:
    """Message for an extra that is not installed."""
    return (
        f"executor = {kind!r}: needs {package}, which is not installed: "
        f'pip install "smolux[{kind}]"'
    )
