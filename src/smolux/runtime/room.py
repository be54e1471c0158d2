"""Room for arrays that grow: asked for before they do, by all threads of this process together."""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock
from typing import Any

from smolux.errors import OutOfMemoryError

from . import resources

#: bytes that are left for all else: to write a checkpoint, to make the result
_RESERVE = float(1 << 26)
#: what is smaller is not asked for
_SMALL = 1 << 20

_lock = Lock()
#: what is being taken at the moment
_taken: dict[int, float] = {}
#: by how much the arrays of each owner have grown; their pages may not be in use yet
_grown: dict[int, float] = {}
#: memory in use before anything had grown
_before = 0.0


@contextmanager
def needed(size: float, what: str) -> Iterator[None]:
    """Make sure that so many bytes more can be had, for the block in which they are taken.

    Parameters
    ----------
    size : float
    what : str
        What they are for, the subject of a sentence in the plural.

    Raises
    ------
    OutOfMemoryError
        If they are not there, before anything is done or while it is.
    """
    left: float | None = None
    promise = object()
    with _lock:
        if size >= _SMALL:
            left = _left()
            if left is not None and size > left:
                raise OutOfMemoryError(_short(size, what, left))
            _taken[id(promise)] = size
    try:
        yield
    except MemoryError:
        raise OutOfMemoryError(_short(size, what, left)) from None
    finally:
        _taken.pop(id(promise), None)


def grown(owner: Any, size: float) -> None:
    """Take note that arrays have grown by so many bytes, until their owner is gone."""
    global _before
    if size < _SMALL:
        return
    with _lock:
        if not _grown:
            _before = resources.resident_memory()
        key = id(owner)
        if key not in _grown:
            weakref.finalize(owner, _grown.pop, key, None)
        _grown[key] = _grown.get(key, 0.0) + size


def _left() -> float | None:
    """Bytes that are free and not promised to arrays whose pages are not in use yet."""
    free = resources.free_memory()
    if free is None:
        return None
    used = max(resources.resident_memory() - _before, 0.0)
    promised = max(sum(_grown.copy().values()) - used, 0.0) + sum(_taken.copy().values())
    return free - promised - _RESERVE


def _short(size: float, what: str, left: float | None) -> str:
    there = "" if left is None else f", and {amount(max(left, 0.0))} are free"
    return (
        f"memory: {what} need {amount(size)} more{there}: use fewer particles or replicas, end "
        "earlier, or let this process have more memory"
    )


def amount(size: float) -> str:
    """Write a number of bytes for a reader."""
    return f"{size / 1e9:.2f} GB" if size >= 1e8 else f"{size / 1e6:.2f} MB"
