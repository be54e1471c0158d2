"""Memory and cores that this process may use: those of its job or container, not of the machine."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

try:
    import resource
except ImportError:  # not on Windows
    resource = None  # type: ignore[assignment]

_ROOT = Path("/")


def available_memory(root: Path = _ROOT) -> float | None:
    """Bytes that this process may use; None if nothing is known.

    Parameters
    ----------
    root : Path
        The root of the file system in which limits of control groups are looked up.
    """
    found = [_installed(), _address_space(root)]
    found += [_number(file) for file in _files(root, "memory", _MEMORY)]
    known = [x for x in found if x is not None]
    return min(known) if known else None


def free_memory(root: Path = _ROOT) -> float | None:
    """Bytes that this process may take besides those that it has; None if nothing is known.

    Of the machine, of every control group above, and below the limit of addresses; what files keep
    in memory is free. `root` as for `available_memory`.
    """
    found = [_free_on_the_machine(root), _address_space(root)]
    found += [_free_in_group(file) for file in _files(root, "memory", _MEMORY)]
    known = [x for x in found if x is not None]
    return max(min(known), 0.0) if known else None


def resident_memory(root: Path = _ROOT) -> float:
    """Bytes of memory that this process has in use, 0 if that is not known."""
    pages = _text(root / "proc/self/statm").split()
    return float(int(pages[1]) * os.sysconf("SC_PAGE_SIZE")) if len(pages) > 1 else 0.0


def cores(root: Path = _ROOT) -> int:
    """Cores that this process may use, at least one; `root` as for `available_memory`."""
    if hasattr(os, "sched_getaffinity"):
        found = len(os.sched_getaffinity(0))
    else:
        found = os.cpu_count() or 1
    shares = [_share(file) for file in _files(root, "cpu", _CPU)]
    # a part of a core more is used too
    return max(1, min([found, *(int(-(-x // 1)) for x in shares if x is not None)]))


#: files of control groups of version 2 and 1
_MEMORY = ("memory.max", "memory.limit_in_bytes")
#: beside them: what the group has, and the line of memory.stat with what files keep
_USED = {
    _MEMORY[0]: ("memory.current", "inactive_file"),
    _MEMORY[1]: ("memory.usage_in_bytes", "total_inactive_file"),
}
_CPU = ("cpu.max", "cpu.cfs_quota_us")


def _installed() -> float | None:
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):  # not known on this system
        return None


def _free_on_the_machine(root: Path) -> float | None:
    kilobytes = _line(root / "proc/meminfo", "MemAvailable:")
    return _installed() if kilobytes is None else 1024.0 * kilobytes


def _free_in_group(file: Path) -> float | None:
    """Bytes below the limit of a control group that nothing needs."""
    limit = _number(file)
    current, reclaimable = _USED[file.name]
    used = _number(file.with_name(current))
    if limit is None or used is None:
        return limit
    return limit - used + (_line(file.with_name("memory.stat"), reclaimable) or 0.0)


def _line(file: Path, name: str) -> float | None:
    """Read the number of a line that begins with a name."""
    for line in _text(file).splitlines():
        words = line.split()
        if words[:1] == [name]:
            return float(words[1])
    return None


def _address_space(root: Path) -> float | None:
    """Room that is left below the limit of addresses."""
    if resource is None:
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return None
    pages = _text(root / "proc/self/statm").split()
    used = int(pages[0]) * os.sysconf("SC_PAGE_SIZE") if pages else 0
    return float(max(limit - used, 0))


def _files(root: Path, controller: str, names: tuple[str, str]) -> Iterator[Path]:
    """Yield the files with the limits of the control groups of this process, and of those above."""
    mount = root / "sys/fs/cgroup"
    for line in _text(root / "proc/self/cgroup").splitlines():
        _, _, rest = line.partition(":")
        controllers, _, path = rest.partition(":")
        if not controllers:
            base, name = mount, names[0]
        elif controller in controllers.split(","):
            base, name = mount / controller, names[1]
        else:
            continue
        group = PurePosixPath(path.lstrip("/"))
        # in a container the path may be that outside, and its group the root
        for folder in (group, *group.parents):
            yield base / folder / name


def _number(file: Path) -> float | None:
    try:
        return float(int(_text(file)))
    except ValueError:  # "max", or no such file
        return None


def _share(file: Path) -> float | None:
    """Cores that a quota of processor time comes to."""
    if file.name == _CPU[0]:
        words = _text(file).split()
    else:
        words = [_text(file), _text(file.with_name("cpu.cfs_period_us"))]
    try:
        quota, period = map(int, words)
    except ValueError:
        return None
    return quota / period if quota > 0 and period > 0 else None


def _text(file: Path) -> str:
    try:
        return file.read_text().strip()
    except OSError:
        return ""
