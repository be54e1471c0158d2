"""Memory and cores of the job or container, from files as the system has them."""

from __future__ import annotations

from pathlib import Path

import pytest

from smolux.runtime import resources

MANY = 1 << 62


def system(root: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n")
    return root


@pytest.fixture(autouse=True)
def large(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resources, "_installed", lambda: float(MANY))
    monkeypatch.setattr(resources, "_address_space", lambda root: None)
    monkeypatch.setattr(resources.os, "sched_getaffinity", lambda _: set(range(64)), raising=False)


V2 = "proc/self/cgroup", "0::/job/step"
V1 = "proc/self/cgroup", "5:cpuacct,cpu:/job\n3:memory:/job\n1:pids:/job"
GROUP = "sys/fs/cgroup"


@pytest.mark.parametrize(
    ("files", "memory", "cores"),
    [
        ({}, MANY, 64),
        ({V2[0]: V2[1], f"{GROUP}/job/step/memory.max": "max"}, MANY, 64),
        ({V2[0]: V2[1], f"{GROUP}/job/step/memory.max": "1000000"}, 1e6, 64),
        ({V2[0]: V2[1], f"{GROUP}/job/memory.max": "2000000"}, 2e6, 64),
        ({V2[0]: "0::/", f"{GROUP}/memory.max": "3000000"}, 3e6, 64),
        ({V2[0]: V2[1], f"{GROUP}/job/cpu.max": "150000 100000"}, MANY, 2),
        ({V2[0]: V2[1], f"{GROUP}/job/cpu.max": "max 100000"}, MANY, 64),
        ({V2[0]: V2[1], f"{GROUP}/job/step/cpu.max": "1000 100000"}, MANY, 1),
        ({V1[0]: V1[1], f"{GROUP}/memory/job/memory.limit_in_bytes": "4000000"}, 4e6, 64),
        (
            {
                V1[0]: V1[1],
                f"{GROUP}/cpu/job/cpu.cfs_quota_us": "300000",
                f"{GROUP}/cpu/job/cpu.cfs_period_us": "100000",
            },
            MANY,
            3,
        ),
        (
            {
                V1[0]: V1[1],
                f"{GROUP}/cpu/job/cpu.cfs_quota_us": "-1",
                f"{GROUP}/cpu/job/cpu.cfs_period_us": "100000",
            },
            MANY,
            64,
        ),
    ],
)
def test_limits_of_control_groups(
    files: dict[str, str], memory: float, cores: int, tmp_path: Path
) -> None:
    root = system(tmp_path, files)
    assert resources.available_memory(root) == memory
    assert resources.cores(root) == cores


def test_a_limit_of_addresses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    rlimit = pytest.importorskip("resource")
    monkeypatch.setattr(resources.resource, "getrlimit", lambda _: (10**9, 10**9))
    page = resources.os.sysconf("SC_PAGE_SIZE")
    root = system(tmp_path, {"proc/self/statm": "1000 10 5 1 0 7 0"})
    assert resources._address_space(root) == 10**9 - 1000 * page
    monkeypatch.setattr(
        resources.resource, "getrlimit", lambda _: (rlimit.RLIM_INFINITY, rlimit.RLIM_INFINITY)
    )
    assert resources._address_space(root) is None


MEMINFO = {"proc/meminfo": "MemTotal: 100 kB\nMemAvailable:    7000 kB"}


@pytest.mark.parametrize(
    ("files", "free"),
    [
        (MEMINFO, 7000 * 1024),
        (MEMINFO | {V2[0]: V2[1], f"{GROUP}/job/step/memory.max": "max"}, 7000 * 1024),
        (
            {
                V2[0]: V2[1],
                f"{GROUP}/job/step/memory.max": "5000",
                f"{GROUP}/job/step/memory.current": "4000",
                f"{GROUP}/job/step/memory.stat": "anon 3000\ninactive_file 500\nfile 900",
            },
            1500,
        ),
        (
            {
                V1[0]: V1[1],
                f"{GROUP}/memory/job/memory.limit_in_bytes": "5000",
                f"{GROUP}/memory/job/memory.usage_in_bytes": "6000",
                f"{GROUP}/memory/job/memory.stat": "inactive_file 1\ntotal_inactive_file 200",
            },
            0,
        ),
    ],
)
def test_what_is_free(files: dict[str, str], free: float, tmp_path: Path) -> None:
    assert resources.free_memory(system(tmp_path, files)) == free


def test_what_is_resident(tmp_path: Path) -> None:
    page = resources.os.sysconf("SC_PAGE_SIZE")
    root = system(tmp_path, {"proc/self/statm": "1000 10 5 1 0 7 0"})
    assert resources.resident_memory(root) == 10 * page
