"""Arrays grow only where memory is free that is not promised to others."""

from __future__ import annotations

import gc
from typing import Any

import pytest

from smolux.errors import InputError, OutOfMemoryError
from smolux.runtime import resources, room

GB = 10**9


class Store:
    """What owns arrays."""


@pytest.fixture(autouse=True)
def machine(monkeypatch: pytest.MonkeyPatch) -> dict[str, float]:
    values = {"free": 10.0 * GB, "resident": 1.0 * GB}
    monkeypatch.setattr(resources, "free_memory", lambda: values["free"])
    monkeypatch.setattr(resources, "resident_memory", lambda: values["resident"])
    monkeypatch.setattr(room, "_grown", {})
    monkeypatch.setattr(room, "_RESERVE", 0.0)
    return values


def fits(size: float) -> bool:
    try:
        with room.needed(size, "tests"):
            return True
    except OutOfMemoryError:
        return False


def test_what_is_free_can_be_had(machine: dict[str, float]) -> None:
    assert fits(10 * GB)
    assert not fits(11 * GB)
    with pytest.raises(InputError, match=r"tests need 11\.00 GB more, and 10\.00 GB are free"):
        room.needed(11 * GB, "tests").__enter__()
    machine["free"] = 0.0
    assert fits(1000)  # it is not worth asking
    resources.free_memory = lambda: None  # type: ignore[assignment]
    assert fits(1e30)  # nothing is known


def test_what_others_are_taking_is_not_free() -> None:
    with room.needed(7 * GB, "tests"):
        assert fits(3 * GB)
        assert not fits(4 * GB)
    assert fits(4 * GB)


def test_what_has_grown_may_not_be_in_use_yet(machine: dict[str, float]) -> None:
    store = Store()
    room.grown(store, 4 * GB)
    assert not fits(7 * GB)
    machine["resident"] += 3 * GB
    machine["free"] -= 3 * GB
    assert fits(6 * GB)
    assert not fits(7 * GB)
    machine["resident"] -= 3 * GB
    machine["free"] += 3 * GB
    del store
    gc.collect()
    assert fits(10 * GB)


def test_an_allocation_that_fails_is_told_alike() -> None:
    def fail() -> Any:
        with room.needed(1e9, "tests"):
            raise MemoryError

    with pytest.raises(OutOfMemoryError, match=r"tests need 1\.00 GB more"):
        fail()
    assert fits(10 * GB)
