"""Bounds of rates, remembered: in this process, and on disk for the next one.

Bounds of a law of the user are a search. Every group of replicas asks for the same, and so does
every later run. What is remembered is known by its content: the law with all that it reads, its
parameters, the weighting, the boxes, the code that finds bounds, and what decides the last bit of
a number on this machine. So bounds are the same bit for bit wherever they come from.

A file holds one answer behind its checksum, see `smolux.runtime.files.keep`; a damaged one is found
anew, and a folder that cannot be written to costs time, not the run.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import platform
import threading
import time
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import lru_cache, wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from smolux.functions.content import digest
from smolux.jit.compile import cache_directory
from smolux.kernels.base import Kernel
from smolux.runtime.files import keep, kept
from smolux.weighting.base import Weighting

Float = NDArray[np.float64]
Given = ParamSpec("Given")
Found = TypeVar("Found")

#: raised whenever what a file holds changes
_FORMAT = 2
#: the most answers that are remembered of a law in a process
_MOST = 64
#: files and bytes beyond which the oldest files are removed, until half are left
_MOST_FILES, _MOST_BYTES = 4096, 1 << 25
#: files that are written between two looks at how many there are
_BETWEEN = 64


class Bounds:
    """Bounds over boxes of sizes, each found once.

    Parameters
    ----------
    bounds : callable
        See `smolux.kernels.base.Kernel.bounds`.
    content : str, optional
        What the law is, for the disk; without it nothing is kept there.
    """

    def __init__(self, bounds: Callable[..., tuple[Any, Any]], content: str | None = None) -> None:
        self._bounds, self._content = bounds, content
        self._known: dict[str, tuple[Float, Float]] = {}
        self._lock = threading.Lock()

    def __call__(self, a: Any, b: Any, c: Any, d: Any) -> tuple[Float, Float]:
        """See `smolux.kernels.base.Kernel.bounds`; the arrays are copies."""
        boxes = np.stack(np.broadcast_arrays(*(np.asarray(x, float) for x in (a, b, c, d))))
        what = f"{self._content} {boxes.shape} ".encode() + boxes.tobytes()
        key = hashlib.sha256(what).hexdigest()
        with self._lock:  # another thread that asks for the same waits for it
            found = self._known.get(key) or self._found(key, boxes)
        return found[0].copy(), found[1].copy()

    def _found(self, key: str, boxes: Float) -> tuple[Float, Float]:
        shape = boxes.shape[1:]
        kept = _read(key, boxes[0].size) if self._content else None
        if kept is None:
            lower, upper = (np.array(x, float) for x in self._bounds(*boxes))
            if self._content:
                _write(key, lower, upper)
        else:
            lower, upper = (x.reshape(shape) for x in kept)
        while len(self._known) >= _MOST:
            self._known.pop(next(iter(self._known)), None)
        self._known[key] = lower, upper
        return lower, upper


def bounds_of(kernel: Kernel, weighting: Weighting) -> Callable[..., tuple[Float, Float]]:
    """Return the bounds of the simulated rate, remembered; kernel and weighting are frozen."""
    try:
        return _bounds_of(kernel, weighting, digest(kernel.rate))
    except TypeError:  # parameters that have no hash
        return weighting.bounds(kernel)


@lru_cache(maxsize=16)
def _bounds_of(kernel: Kernel, weighting: Weighting, rate: str) -> Bounds:
    return Bounds(weighting.bounds(kernel), _content(kernel, weighting))


def _content(kernel: Kernel, weighting: Weighting) -> str | None:
    """Digest of all that decides bounds; None if finding them is no work, or not all is known."""
    if weighting.weight is None and not kernel.searched:
        return None
    if any(not type(x).__module__.startswith("smolux.") for x in (kernel, weighting)):
        return None  # a class of the user may be anything
    given = (_FORMAT, _code(), _machine(), _parts(kernel), _parts(weighting))
    return digest(given)  # type: ignore[arg-type]


def _parts(value: Any) -> Any:
    """Take dataclasses apart: their texts tell functions by their addresses."""
    if is_dataclass(value) and not isinstance(value, type):
        return (type(value), *(_parts(getattr(value, f.name)) for f in fields(value)))
    return value


@lru_cache(maxsize=1)
def _code() -> str:
    """Digest of the code that finds bounds."""
    home, found = Path(__file__).parent, hashlib.sha256()
    for file in sorted(
        [*home.glob("*.py"), *home.glob("kernels/*.py"), *home.glob("weighting/*.py")]
    ):
        with contextlib.suppress(OSError):
            found.update(file.name.encode() + file.read_bytes())
    return found.hexdigest()


@lru_cache(maxsize=1)
def _machine() -> str:
    """Return what decides the last bit of a number."""
    features: dict[str, bool] = {}
    with contextlib.suppress(AttributeError):  # a private name of NumPy
        features = np._core._multiarray_umath.__cpu_features__  # type: ignore[attr-defined]
    used = sorted(name for name, present in features.items() if present)
    return repr((np.__version__, platform.machine(), platform.libc_ver(), used))


def _folder() -> Path | None:
    base = cache_directory()
    return None if base is None else base / "bounds"


def _read(key: str, count: int) -> tuple[Float, Float] | None:
    folder, body = _folder(), None
    if folder is None:
        return None
    with contextlib.suppress(OSError):
        body = kept(folder / key)
        if body is not None:
            os.utime(folder / key)  # the oldest are those that were not wanted for longest
    if body is None or len(body) != 16 * count:
        return None
    lower, upper = np.frombuffer(body, "<f8").astype(float).reshape(2, count)
    return lower, upper


_written = 0


def _write(key: str, lower: Float, upper: Float) -> None:
    global _written
    folder = _folder()
    if folder is None:
        return
    body = np.stack([lower.ravel(), upper.ravel()]).astype("<f8").tobytes()
    with contextlib.suppress(OSError):
        keep(folder / key, body)
        if _written % _BETWEEN == 0:
            _tidy(folder)
        _written += 1


def _tidy(folder: Path) -> None:
    """Remove the oldest files if they are too many."""
    held = []
    for entry in os.scandir(folder):
        with contextlib.suppress(OSError):
            about = entry.stat()
            if not entry.name.startswith("."):  # else it is being written
                held.append((about.st_mtime, about.st_size, entry.path))
    files, size = len(held), sum(size for _, size, _ in held)
    if files <= _MOST_FILES and size <= _MOST_BYTES:
        return
    for _, length, path in sorted(held):
        if files <= _MOST_FILES // 2 and size <= _MOST_BYTES // 2:
            return
        with contextlib.suppress(OSError):
            os.unlink(path)
        files, size = files - 1, size - length


class _Clock(threading.local):
    seconds = 0.0
    running = False


_clock = _Clock()


def spent() -> float:
    """Processor seconds that this thread has spent on bounds and tables of rates so far."""
    return _clock.seconds


def timed(function: Callable[Given, Found]) -> Callable[Given, Found]:
    """Count the processor time of a function as spent on bounds."""

    @wraps(function)
    def counted(*args: Given.args, **kwargs: Given.kwargs) -> Found:
        if _clock.running:
            return function(*args, **kwargs)
        _clock.running, start = True, time.thread_time()
        try:
            return function(*args, **kwargs)
        finally:
            _clock.seconds += time.thread_time() - start
            _clock.running = False

    return counted
